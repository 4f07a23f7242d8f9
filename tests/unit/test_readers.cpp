// SPDX-License-Identifier: MIT
// A number is a whole word, for every reader, and no locale changes what is read, written or said.

#include "talus/core/error.hpp"
#include "talus/io/bytes.hpp"
#include "talus/io/csv.hpp"
#include "talus/io/csv_table.hpp"
#include "talus/io/number.hpp"
#include "talus/io/stl.hpp"
#include "talus/io/vtk.hpp"

#include "../support/files.hpp"

#include <doctest/doctest.h>

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <limits>
#include <locale>
#include <stdexcept>
#include <string>
#include <vector>

namespace test_readers {

using namespace talus;
using support::contains;
using support::content;
using support::Folder;
using support::message_of;

namespace {

/// As in much of Europe: 1.234,5.
struct Commas : std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

/// The locale of the program while this lives.
struct CommaLocale {
  CommaLocale() : before(std::locale::global(std::locale(std::locale::classic(), new Commas))) {}
  ~CommaLocale() { std::locale::global(before); }
  std::locale before;
};

} // namespace

TEST_CASE("a number is a whole word") {
  for (const char* text : {"1.5", "+1.5", "15e-1", "15E-01", "1.50000", "0.15e+1", "01.5"})
    CHECK(parse_number<double>(text) == 1.5);
  CHECK(parse_number<double>("-.5") == -0.5);
  CHECK(parse_number<double>("5.") == 5);
  CHECK(std::signbit(parse_number<double>("-0").value()));
  CHECK(parse_number<double>("4.9e-324") == std::numeric_limits<double>::denorm_min());
  for (const char* text :
       {"",      " ",   "1,5",  "1.5D+03", "1.5d0", "2mm",  "2 ",       " 2",   "0x10",  "0x1p3",
        "1e",    "1e+", "e3",   ".",       "-",     "+-1",  "--1",      "1..5", "1.5.2", "1_000",
        "1'000", "nan", "-nan", "inf",     "1e999", "1.5f", "infinity", "½"})
    CHECK_FALSE(parse_number<double>(text).has_value());
  CHECK(parse_number<int>("-12") == -12);
  CHECK(parse_number<std::uint64_t>("18446744073709551615") == ~std::uint64_t{0});
  for (const char* text : {"1.0", "1e3", "2147483648", "12a", ""})
    CHECK_FALSE(parse_number<int>(text).has_value());
  CHECK_FALSE(parse_number<std::size_t>("-1").has_value());
}

TEST_CASE("header lines: each number is a word") {
  const Folder folder;
  const auto line = [&](const std::string& text) {
    std::ofstream(folder / "a") << text << "\n";
    double x = 0;
    int n = 0;
    detail::ByteReader(folder / "a").line("key", x, n);
    return x * n;
  };
  CHECK(line("key 2.5 2") == 5);
  for (const char* bad :
       {"key 2.5", "key 2.5.5 2", "key 2,5 2", "key 2.5 2.0", "key 2.5 2 3", "key 2.5D+00 2",
        "key 1 .5", "key  2.5 2", "key 2.5 2mm", "key nan 2", "key 1e999 2", "key 2.5 2 "}) {
    CAPTURE(bad);
    CHECK(contains(message_of<std::runtime_error>([&] { line(bad); }), "the line \"key\""));
  }
}

TEST_CASE("CSV: tables are read back, anything else is refused with its line") {
  const Folder folder;
  const auto file = folder / "t.csv";
  const double infinity = std::numeric_limits<double>::infinity();
  CsvWriter csv(file, {"time_s", "x, y \"m\""});
  csv.row(0.1, -1e-300);
  csv.row(std::nan(""), -infinity);
  csv.close();
  const CsvTable table = read_csv(file);
  CHECK(table.names == std::vector<std::string>{"time_s", "x, y \"m\""});
  CHECK(table.columns[0][0] == 0.1);
  CHECK(std::isnan(table.columns[0][1]));
  CHECK(table.columns[1] == std::vector<double>{-1e-300, -infinity});
  std::ofstream(file, std::ios::binary) << "\xef\xbb\xbf"
                                        << "a,b\r\n1,\"2\"\r\n";
  CHECK(read_csv(file).names[0] == "a");
  CHECK(read_csv(file).columns[1][0] == 2);
  const auto said = [&](const std::string& text) {
    std::ofstream(file, std::ios::binary) << text;
    return message_of<std::runtime_error>([&] { static_cast<void>(read_csv(file)); });
  };
  CHECK(contains(said(""), "it is empty"));
  CHECK(contains(said("a,b\n1,2\n3\n"), "line 3: it has 1 cells instead of 2"));
  CHECK(contains(said("a,b\n1,2,3\n"), "line 2: it has 3 cells instead of 2"));
  CHECK(contains(said("a,b\n1,2\n3,4.25"), "line 3: it is cut off"));
  CHECK(contains(said("a,b\n1,2\n\n"), "line 3: a is \"\""));
  CHECK(contains(said("a;b\n0,5;1,5\n"), "line 2: it has 3 cells instead of 1"));
  for (const char* bad : {"0;5", "1.5D+03", "2 mm", "2mm", "#N/A", "", "0x10", "NaN", "1e999"}) {
    CAPTURE(bad);
    CHECK(contains(said("a,b\n0,1\n7," + std::string(bad) + "\n"),
                   "line 3: b is \"" + std::string(bad) + "\"; allowed: a number"));
  }
}

TEST_CASE("no locale changes what is read, written or said") {
  const Folder folder;
  const CommaLocale comma;
  CHECK(parse_number<double>("1234.5") == 1234.5);
  CHECK_FALSE(parse_number<double>("1.234,5").has_value());
  CHECK(contains(message_of<std::invalid_argument>([] { require_positive("x", -12345.5); }),
                 "x is -12345.5;"));
  CHECK(contains(message_of<std::invalid_argument>([] { throw_invalid("n", 1234567, "0"); }),
                 "n is 1234567;"));
  std::ofstream stl(folder / "a.stl");
  stl.imbue(std::locale::classic());
  stl << "solid\nfacet normal 0 0 0\nouter loop\nvertex 1234.5 0 0\nvertex 0 0 0\nvertex 0 1 0\n"
         "endloop\nendfacet\nendsolid\n";
  stl.close();
  CHECK(read_stl(folder / "a.stl")[0][0][0] == 1234.5);
  CsvWriter csv(folder / "a.csv", {"x"});
  csv.row(1234567.5);
  csv.close();
  CHECK(content(folder / "a.csv") == "x\n1234567.5\n");
  CHECK(read_csv(folder / "a.csv").columns[0][0] == 1234567.5);
  detail::ByteWriter out;
  out.line("key", 1234567, 0.5);
  CHECK(out.bytes() == "key 1234567 0.5\n");
}

TEST_CASE("storage order: talus stores by columns, users' matrices are written as they mean") {
  Mat<2> m;
  m << 1, 2, 3, 4;
  CHECK(m.data()[1] == 3);
  static_assert(!RectMat<3, 2>::IsRowMajor && !Mat<3>::IsRowMajor && !Vec<1>::IsRowMajor);
  std::vector<double> by_columns, by_rows;
  const Eigen::Matrix<double, 2, 2, Eigen::RowMajor> rows = m;
  detail::VtkLayout<Mat<2>>::append(by_columns, m);
  detail::VtkLayout<Eigen::Matrix<double, 2, 2, Eigen::RowMajor>>::append(by_rows, rows);
  CHECK(by_columns == by_rows);
}

} // namespace test_readers
