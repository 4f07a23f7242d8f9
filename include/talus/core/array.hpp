// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <initializer_list>
#include <utility>
#include <vector>

namespace talus {

/// A std::vector whose elements are found by signed numbers too: nodes, cells and axes are int.
template <class T>
class Array : public std::vector<T> {
 public:
  using Base = std::vector<T>;
  using Base::operator[];

  Array() = default;
  explicit Array(std::size_t size) : Base(size) {}
  Array(std::size_t size, const T& value) : Base(size, value) {}
  Array(std::initializer_list<T> values) : Base(values) {}
  Array(Base values) : Base(std::move(values)) {}

  T& operator[](std::ptrdiff_t i) { return Base::operator[](static_cast<std::size_t>(i)); }
  T& operator[](int i) { return Base::operator[](static_cast<std::size_t>(i)); }
  T& operator[](unsigned i) { return Base::operator[](std::size_t{i}); }
  const T& operator[](std::ptrdiff_t i) const {
    return Base::operator[](static_cast<std::size_t>(i));
  }
  const T& operator[](int i) const { return Base::operator[](static_cast<std::size_t>(i)); }
  const T& operator[](unsigned i) const { return Base::operator[](std::size_t{i}); }
};

/// N values, as std::array has them, of a size and with indices that are int.
template <class T, int N>
struct SmallArray {
  T values[static_cast<std::size_t>(N)];

  constexpr T& operator[](std::size_t i) { return values[i]; }
  constexpr T& operator[](int i) { return values[i]; }
  constexpr const T& operator[](std::size_t i) const { return values[i]; }
  constexpr const T& operator[](int i) const { return values[i]; }
  constexpr void fill(const T& value) {
    for (T& each : values)
      each = value;
  }
  constexpr T* begin() { return values; }
  constexpr T* end() { return values + N; }
  constexpr const T* begin() const { return values; }
  constexpr const T* end() const { return values + N; }
  static constexpr int size() { return N; }
  friend bool operator==(const SmallArray&, const SmallArray&) = default;
};

} // namespace talus
