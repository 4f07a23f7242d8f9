// SPDX-License-Identifier: MIT
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

/// \file
/// Numpy arrays that look at memory of a C++ object, safely: none ever shows memory that the object
/// has freed, moved or half changed.

namespace python {

namespace py = pybind11;

/// The arrays that look at an object's memory. Each keeps the object alive, none can be written to,
/// and require_none() refuses to change the object while there is any.
class Views {
 public:
  Views() = default;
  Views(const Views&) = delete;
  Views& operator=(const Views&) = delete;

  /// An array that looks at `data`. self: the Python object that owns the memory and these Views;
  /// name: of the array, for messages; shape: numbers along each axis; strides: bytes from one to
  /// the next along each axis.
  template <class Number>
  py::array make(const py::object& self, const std::string& name, const Number* data,
                 std::vector<py::ssize_t> shape, std::vector<py::ssize_t> strides) {
    // What numpy makes of the array, slices of it, say, holds on to this.
    py::capsule holder(new View{self, *this, name},
                       [](void* view) { delete static_cast<View*>(view); });
    py::array array(py::dtype::of<Number>(), std::move(shape), std::move(strides), data, holder);
    array.attr("setflags")(py::arg("write") = false);
    return array;
  }

  /// Throws BufferError, as Python's own bytearray does, if an array is still there.
  void require_none(const std::string& call) const {
    std::string names;
    for (const auto& [name, count] : alive_)
      if (count > 0)
        names += (names.empty() ? "" : ", ") + name;
    if (!names.empty())
      throw py::buffer_error(call + ": the number of arrays that look at its memory (" + names +
                             ") is not 0; delete them first (del), or keep copies: x = sim." +
                             names.substr(0, names.find(',')) + ".copy()");
  }

 private:
  struct View {
    View(py::object object, Views& all, const std::string& its_name)
        : owner(std::move(object)), count(all.alive_[its_name]) {
      ++count;
    }
    ~View() { --count; } // before the owner goes, and with it the Views
    View(const View&) = delete;
    View& operator=(const View&) = delete;
    py::object owner;
    int& count;
  };

  std::map<std::string, int> alive_;
};

} // namespace python
