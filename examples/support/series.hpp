// SPDX-License-Identifier: MIT
#pragma once

#include "results.hpp"

#include "talus/io/csv.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace support {

/// A table of numbers in a file that is kept in memory as well, for pictures and means.
class Series {
 public:
  using Columns = std::vector<std::vector<double>>;

  Series(talus::CsvWriter& file, std::vector<std::string> names)
      : file_(&file), names_(std::move(names)), columns_(names_.size()) {}

  /// One number for each column.
  template <class... Numbers>
  void row(const Numbers&... numbers) {
    file_->row(numbers...);
    std::size_t c = 0;
    (columns_[c++].push_back(numbers), ...);
  }

  /// A column, by its name. Throws std::invalid_argument.
  const std::vector<double>& operator[](const std::string& name) const {
    const auto at = std::find(names_.begin(), names_.end(), name);
    if (at == names_.end())
      throw std::invalid_argument("no column " + name);
    return columns_[static_cast<std::size_t>(at - names_.begin())];
  }

  /// Mean of a column over the second half of its rows; not a number without rows.
  double late_mean(const std::string& name) const {
    const std::vector<double>& values = (*this)[name];
    const std::size_t begin = values.size() / 2;
    double sum = 0;
    for (std::size_t i = begin; i < values.size(); ++i)
      sum += values[i];
    return sum / static_cast<double>(values.size() - begin);
  }

  /// All numbers so far, to go on with after a restart.
  const Columns& columns() const { return columns_; }
  /// What is not a number is null in JSON.
  void restore(const nlohmann::json& columns) {
    for (std::size_t c = 0; c < columns_.size(); ++c)
      for (const nlohmann::json& value : columns.at(c))
        columns_[c].push_back(value_or_nan(value));
  }

 private:
  talus::CsvWriter* file_;
  std::vector<std::string> names_;
  Columns columns_;
};

} // namespace support
