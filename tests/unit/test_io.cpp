// SPDX-License-Identifier: MIT
#include "talus/io/csv.hpp"
#include "talus/io/progress.hpp"
#include "talus/io/vtk.hpp"

#include "../support/files.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

namespace test_io {

namespace fs = std::filesystem;
using support::contains, support::content, support::Folder, support::message_of;
using talus::Index;
using talus::Mat;
using talus::Vec;

namespace {

/// The numbers of appended block `block` of a VTK file.
template <class Number = double>
std::vector<Number> appended(const std::string& file, int block) {
  std::size_t at = file.find("<AppendedData encoding=\"raw\">\n_") + 31;
  std::uint64_t bytes = 0;
  for (int b = 0;; ++b) {
    std::memcpy(&bytes, file.data() + at, sizeof bytes);
    at += sizeof bytes;
    if (b == block)
      break;
    at += bytes;
  }
  std::vector<Number> values(bytes / sizeof(Number));
  std::memcpy(values.data(), file.data() + at, bytes);
  return values;
}

/// A path whose temporary file is on a full disk.
fs::path on_full_disk(const Folder& folder, const char* name) {
  fs::create_symlink("/dev/full", (folder / name).string() + ".tmp");
  return folder / name;
}

} // namespace

TEST_CASE("CSV: header, numbers, texts") {
  const Folder folder;
  talus::CsvWriter csv(folder / "table.csv", {"time_s", "name, unit", "n"});
  csv.row(0.5, "plain", 3);
  csv.row(-1e-300, std::string("say \"a,b\""), std::size_t{7});
  csv.row(std::nan(""), "", true);
  csv.row(-std::nan(""), "x", -std::numeric_limits<double>::infinity());
  csv.close();
  CHECK(content(folder / "table.csv") == "time_s,\"name, unit\",n\n"
                                         "0.5,plain,3\n"
                                         "-1e-300,\"say \"\"a,b\"\"\",7\n"
                                         "nan,\"\",1\n"
                                         "nan,x,-inf\n");
}

TEST_CASE("CSV: numbers read back as they were") {
  const Folder folder;
  std::mt19937_64 random(1);
  std::vector<double> values;
  while (values.size() < 1000) {
    const std::uint64_t bits = random();
    double value = 0;
    std::memcpy(&value, &bits, sizeof value);
    if (std::isfinite(value))
      values.push_back(value);
  }
  values.push_back(0.1);
  values.push_back(std::numeric_limits<double>::denorm_min());
  values.push_back(std::numeric_limits<double>::max());
  talus::CsvWriter csv;
  CHECK_FALSE(csv.is_open());
  csv.open(folder / "v.csv", {"a", "b"});
  CHECK(csv.is_open());
  for (const double value : values)
    csv.row(std::vector<double>{value, -value});
  csv.flush();
  std::ifstream file(folder / "v.csv");
  std::string line;
  std::getline(file, line);
  for (const double value : values) {
    std::getline(file, line, ',');
    CHECK(std::strtod(line.c_str(), nullptr) == value);
    std::getline(file, line);
    CHECK(std::strtod(line.c_str(), nullptr) == -value);
  }
}

TEST_CASE("CSV: rows of another length and errors in writing are refused") {
  const Folder folder;
  talus::CsvWriter csv(folder / "table.csv", {"a", "b"});
  CHECK(contains(message_of<std::invalid_argument>([&] { csv.row(1.0); }), "is 1; allowed: 2"));
  CHECK_THROWS_AS(csv.row(1, 2, 3), std::invalid_argument);
  CHECK_THROWS_AS(csv.row(std::vector<double>(3)), std::invalid_argument);
  csv.row(1, 2); // still usable
  csv.close();
  CHECK(content(folder / "table.csv") == "a,b\n1,2\n");
  CHECK_THROWS_AS(csv.row(1, 2), std::logic_error);
  CHECK_THROWS_AS(csv.open(folder / "none.csv", {}), std::invalid_argument);

  const fs::path lost = folder.path / "missing" / "table.csv";
  const std::string message =
      message_of<std::runtime_error>([&] { talus::CsvWriter(lost, {"a"}); });
  CHECK(contains(message, lost.string()));
  CHECK(contains(message, "No such file"));
}

TEST_CASE("CSV: a full disk is reported" * doctest::skip(!fs::exists("/dev/full"))) {
  CHECK(contains(message_of<std::runtime_error>([] { talus::CsvWriter("/dev/full", {"a"}); }),
                 "/dev/full"));
}

TEST_CASE("VTK: values are appended as they are") {
  const Folder folder;
  const std::vector<Vec<2>> positions{{0.1, 0.2}, {1e-17, -3}};
  std::vector<Mat<2>> tensors(2);
  tensors[0] << 1, 2, 3, 4;
  tensors[1].setZero();
  talus::write_vtk_particles(folder / "p.vtp", positions,
                             {talus::vtk_field("a<b", std::vector<double>{1.5, 0.1}),
                              talus::vtk_field("velocity", positions),
                              talus::vtk_field("tensor", tensors),
                              talus::vtk_field("id", std::vector<std::size_t>{4, 5})});
  const std::string file = content(folder / "p.vtp");
  CHECK(contains(file, "Name=\"a&lt;b\" format")); // one component, as without a number
  CHECK(contains(file, "Name=\"velocity\" NumberOfComponents=\"3\""));
  CHECK(contains(file, "Name=\"tensor\" NumberOfComponents=\"9\""));
  CHECK(appended(file, 0) == std::vector<double>{1.5, 0.1});
  CHECK(appended(file, 1) == std::vector<double>{0.1, 0.2, 0, 1e-17, -3, 0});
  CHECK(appended(file, 2) ==
        std::vector<double>{1, 2, 0, 3, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  CHECK(appended(file, 3) == std::vector<double>{4, 5});
  CHECK(appended(file, 4) == std::vector<double>{0.1, 0.2, 0, 1e-17, -3, 0});
  CHECK_FALSE(fs::exists(folder / "p.vtp.tmp"));
}

TEST_CASE("VTK: nodes of an image, first axis fastest") {
  const Folder folder;
  SUBCASE("3-D") {
    const Index<3> nodes{2, 3, 2};
    const auto field = talus::vtk_node_field(
        "f", nodes, [](const Index<3>& i) { return 100.0 * i[2] + 10.0 * i[1] + i[0]; });
    CHECK(field.values == std::vector<double>{0, 1, 10, 11, 20, 21, 100, 101, 110, 111, 120, 121});
    talus::write_vtk_image<3>(folder / "g.vti", {1, 2, 3}, {0.1, 0.2, 0.3}, nodes, {field});
    const std::string file = content(folder / "g.vti");
    CHECK(contains(file, "WholeExtent=\"0 1 0 2 0 1\" Origin=\"1 2 3\" Spacing=\"0.1 0.2 0.3\""));
    CHECK(appended(file, 0) == field.values);
  }
  SUBCASE("2-D") {
    const Index<2> nodes{3, 2};
    const auto field = talus::vtk_node_field(
        "f", nodes, [](const Index<2>& i) { return Vec<2>(i[0], 10 * i[1]); });
    CHECK(field.components == 3);
    CHECK(field.values ==
          std::vector<double>{0, 0, 0, 1, 0, 0, 2, 0, 0, 0, 10, 0, 1, 10, 0, 2, 10, 0});
    talus::write_vtk_image<2>(folder / "g.vti", {1, 2}, {0.1, 0.2}, nodes, {field});
    CHECK(contains(content(folder / "g.vti"),
                   "WholeExtent=\"0 2 0 1 0 0\" Origin=\"1 2 0\" Spacing=\"0.1 0.2 1\""));
  }
}

TEST_CASE("VTK: an unstructured grid of particles") {
  const Folder folder;
  const std::vector<Vec<2>> positions{{0.1, 0.2}, {1e-17, -3}};
  talus::write_vtk_particles(folder / "p.vtu", positions,
                             {talus::vtk_field("id", std::vector<std::size_t>{4, 5})});
  const std::string file = content(folder / "p.vtu");
  CHECK(contains(file, "<VTKFile type=\"UnstructuredGrid\""));
  CHECK(contains(file, "NumberOfPoints=\"2\" NumberOfCells=\"2\""));
  CHECK(appended(file, 0) == std::vector<double>{4, 5});
  CHECK(appended(file, 1) == std::vector<double>{0.1, 0.2, 0, 1e-17, -3, 0});
  CHECK(appended<std::int64_t>(file, 2) == std::vector<std::int64_t>{0, 1});
  CHECK(appended<std::int64_t>(file, 3) == std::vector<std::int64_t>{1, 2});
  CHECK(appended<std::uint8_t>(file, 4) == std::vector<std::uint8_t>{1, 1});
}

TEST_CASE("VTK: of a grid only the cells at chosen nodes") {
  const Folder folder;
  SUBCASE("2-D: one cell, its nodes once around") {
    const Index<2> nodes{4, 3};
    const auto field = talus::vtk_node_field(
        "f", nodes, [](const Index<2>& i) { return Vec<2>(i[0], 10 * i[1]); });
    talus::write_vtk_cells<2>(folder / "g.vtu", {1, 2}, {0.5, 0.25}, nodes, {field},
                              [](const Index<2>& i) {
                                return i == Index<2>{3, 2};
                              });
    const std::string file = content(folder / "g.vtu");
    CHECK(contains(file, "NumberOfPoints=\"4\" NumberOfCells=\"1\""));
    CHECK(appended(file, 0) == std::vector<double>{2, 10, 0, 3, 10, 0, 3, 20, 0, 2, 20, 0});
    CHECK(appended(file, 1) ==
          std::vector<double>{2, 2.25, 0, 2.5, 2.25, 0, 2.5, 2.5, 0, 2, 2.5, 0});
    CHECK(appended<std::int32_t>(file, 2) == std::vector<std::int32_t>{0, 1, 2, 3});
    CHECK(appended<std::int64_t>(file, 3) == std::vector<std::int64_t>{4});
    CHECK(appended<std::uint8_t>(file, 4) == std::vector<std::uint8_t>{9});
  }
  SUBCASE("3-D: two cells that share four nodes") {
    const Index<3> nodes{2, 2, 3};
    const auto field = talus::vtk_node_field(
        "f", nodes, [](const Index<3>& i) { return 100.0 * i[2] + 10.0 * i[1] + i[0]; });
    talus::write_vtk_cells<3>(folder / "g.vtu", {0, 0, 0}, {1, 1, 1}, nodes, {field},
                              [](const Index<3>& i) { return i[2] == 1; });
    const std::string file = content(folder / "g.vtu");
    CHECK(contains(file, "NumberOfPoints=\"12\" NumberOfCells=\"2\""));
    CHECK(appended(file, 0) ==
          std::vector<double>{0, 1, 11, 10, 100, 101, 111, 110, 200, 201, 211, 210});
    CHECK(appended<std::int32_t>(file, 2) ==
          std::vector<std::int32_t>{0, 1, 2, 3, 4, 5, 6, 7, 4, 5, 6, 7, 8, 9, 10, 11});
    CHECK(appended<std::uint8_t>(file, 4) == std::vector<std::uint8_t>{12, 12});
  }
  SUBCASE("none") {
    const Index<2> nodes{4, 3};
    talus::write_vtk_cells<2>(folder / "g.vtu", {0, 0}, {1, 1}, nodes, {},
                              [](const Index<2>&) { return false; });
    CHECK(contains(content(folder / "g.vtu"), "NumberOfPoints=\"0\" NumberOfCells=\"0\""));
  }
  SUBCASE("a field of another size") {
    CHECK_THROWS_AS(talus::write_vtk_cells<2>(folder / "g.vtu", {0, 0}, {1, 1}, {3, 3},
                                              {{"f", 1, {1, 2}}},
                                              [](const Index<2>&) { return false; }),
                    std::invalid_argument);
    CHECK_FALSE(fs::exists(folder / "g.vtu"));
  }
}

TEST_CASE("VTK: wrong sizes are refused, nothing is written") {
  const Folder folder;
  const std::vector<Vec<3>> positions(2, Vec<3>::Zero());
  const auto file = folder / "p.vtp";
  const auto with = [&](talus::VtkField field) {
    return message_of<std::invalid_argument>(
        [&] { talus::write_vtk_particles(file, positions, {field}); });
  };
  CHECK(
      contains(with({"speed", 1, {1, 2, 3}}), "\"speed\": the number of values is 3; allowed: 2"));
  CHECK(contains(with({"speed", 0, {}}), "the number of components is 0"));
  CHECK_THROWS_AS(talus::write_vtk_image<2>(folder / "g.vti", {0, 0}, {1, 1}, {2, 0}, {}),
                  std::invalid_argument);
  CHECK_THROWS_AS(talus::write_vtk_image<2>(folder / "g.vti", {0, 0}, {1, 0}, {2, 2}, {}),
                  std::invalid_argument);
  CHECK(fs::is_empty(folder.path));
}

TEST_CASE("VTK: the series lists its frames relative to itself") {
  const Folder folder;
  talus::VtkSeries series(folder / "run.pvd");
  CHECK(contains(content(folder / "run.pvd"), "<Collection>\n</Collection>"));
  series.add(0, folder.path / "frames" / "p0.vtp");
  series.add(0.1, folder / "p&1.vtp");
  CHECK(contains(content(folder / "run.pvd"),
                 "<DataSet timestep=\"0\" part=\"0\" file=\"frames/p0.vtp\"/>\n"
                 "<DataSet timestep=\"0.1\" part=\"0\" file=\"p&amp;1.vtp\"/>\n"));
  CHECK_THROWS_AS(series.add(std::nan(""), "p.vtp"), std::invalid_argument);
  CHECK_FALSE(fs::exists(folder / "run.pvd.tmp"));
}

TEST_CASE("VTK: a series goes on after a resume, without the frames of what was lost") {
  const Folder folder;
  const fs::path list = folder / "run.pvd";
  {
    talus::VtkSeries series(list);
    for (const double time : {0.0, 0.1, 1e-7 + 0.2, 0.3})
      series.add(time, folder / "p&.vtp");
  }
  const std::string all = content(list);
  talus::VtkSeries::resume(list, 0.3);
  CHECK(content(list) == all);
  auto series = talus::VtkSeries::resume(list, 1e-7 + 0.2);
  CHECK_FALSE(contains(content(list), "0.3"));
  series.add(0.3, folder / "p&.vtp");
  CHECK(content(list) == all);
  talus::VtkSeries::resume(folder / "new.pvd", 0);
  CHECK(contains(content(folder / "new.pvd"), "<Collection>\n</Collection>"));
  std::ofstream(folder / "other.pvd") << "a letter\n";
  CHECK_THROWS_AS(talus::VtkSeries::resume(folder / "other.pvd", 0), std::runtime_error);
  CHECK_THROWS_AS(talus::VtkSeries::resume(list, std::nan("")), std::invalid_argument);
  CHECK(content(folder / "other.pvd") == "a letter\n");
}

TEST_CASE("VTK: errors in writing name the file and the reason") {
  const Folder folder;
  const std::vector<Vec<2>> none;
  const fs::path lost = folder.path / "missing" / "p.vtp";
  const std::string message =
      message_of<std::runtime_error>([&] { talus::write_vtk_particles(lost, none, {}); });
  CHECK(contains(message, lost.string()));
  CHECK(contains(message, "No such file"));
  CHECK_THROWS_AS(talus::VtkSeries(folder.path / "missing" / "r.pvd"), std::runtime_error);
  fs::create_directory(folder / "taken.vtp");
  CHECK_THROWS_AS(talus::write_vtk_particles(folder / "taken.vtp", none, {}), std::runtime_error);
  CHECK_FALSE(fs::exists(folder / "taken.vtp.tmp"));
}

TEST_CASE("VTK: a full disk keeps the old file" * doctest::skip(!fs::exists("/dev/full"))) {
  const Folder folder;
  const std::vector<Vec<2>> points(100000, Vec<2>::Ones()); // more than any buffer
  talus::write_vtk_particles(folder / "p.vtp", points, {});
  const std::string before = content(folder / "p.vtp");
  const fs::path path = on_full_disk(folder, "p.vtp");
  CHECK(contains(
      message_of<std::runtime_error>([&] { talus::write_vtk_particles(path, points, {}); }),
      path.string()));
  CHECK(content(path) == before);
  const fs::path small = on_full_disk(folder, "small.vtp"); // fits in the buffer: fails on closing
  CHECK_THROWS_AS(talus::write_vtk_particles(small, std::vector<Vec<2>>{}, {}), std::runtime_error);
  CHECK_FALSE(fs::exists(small));
  CHECK_FALSE(fs::is_symlink(small.string() + ".tmp"));
}

// Files for tests/tools/check_vtk.py, which reads them with VTK itself: X.vtp and X.vti, each with
// its values as X.csv. They stay if TALUS_VTK_SAMPLES names a folder.
TEST_CASE("VTK: samples for VTK's own readers") {
  const Folder temporary;
  const char* const wanted = std::getenv("TALUS_VTK_SAMPLES");
  const fs::path folder = wanted ? fs::path(wanted) : temporary.path;
  fs::create_directories(folder);
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;

  std::vector<Vec<3>> positions(50), velocities(50);
  std::vector<double> pressure(50);
  talus::CsvWriter csv(folder / "particles3.csv",
                       {"x", "y", "z", "pressure <Pa>", "velocity_0", "velocity_1", "velocity_2"});
  for (std::size_t p = 0; p < positions.size(); ++p) {
    for (int a = 0; a < 3; ++a) {
      positions[p][a] = normal(random);
      velocities[p][a] = 1e-200 * normal(random);
    }
    pressure[p] = p == 7 ? std::nan("") : normal(random);
    const Vec<3>&x = positions[p], &v = velocities[p];
    csv.row(x[0], x[1], x[2], pressure[p], v[0], v[1], v[2]);
  }
  csv.close();
  for (const char* name : {"particles3.vtp", "particles3.vtu"})
    talus::write_vtk_particles(
        folder / name, positions,
        {talus::vtk_field("pressure <Pa>", pressure), talus::vtk_field("velocity", velocities)});

  csv.open(folder / "particles2.csv", {"x", "y", "z", "speed"});
  csv.row(0.1, 0.7, 0, 1.0 / 3);
  csv.close();
  for (const char* name : {"particles2.vtp", "particles2.vtu"})
    talus::write_vtk_particles(folder / name, std::vector<Vec<2>>{{0.1, 0.7}},
                               {talus::vtk_field("speed", std::vector<double>{1.0 / 3})});

  csv.open(folder / "empty.csv", {"x", "y", "z", "speed"});
  csv.close();
  for (const char* name : {"empty.vtp", "empty.vtu"})
    talus::write_vtk_particles(folder / name, std::vector<Vec<3>>{},
                               {talus::vtk_field("speed", std::vector<double>{})});

  const Index<3> nodes3{4, 3, 2};
  const Vec<3> origin3(-1, 0.5, 2), spacing3(0.25, 0.5, 1);
  const auto f3 = [](const Index<3>& i) { return std::sin(i[0] + 7.0 * i[1] + 31.0 * i[2]); };
  csv.open(folder / "grid3.csv", {"x", "y", "z", "f"});
  for (int k = 0; k < 2; ++k)
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 4; ++i)
        csv.row(-1 + 0.25 * i, 0.5 + 0.5 * j, 2.0 + k, f3({i, j, k}));
  csv.close();
  talus::write_vtk_image(folder / "grid3.vti", origin3, spacing3, nodes3,
                         {talus::vtk_node_field("f", nodes3, f3)});

  const Index<2> nodes2{3, 2};
  const auto f2 = [](const Index<2>& i) { return Vec<2>(0.1 * i[0], 0.3 * i[1]); };
  csv.open(folder / "grid2.csv", {"x", "y", "z", "u_0", "u_1", "u_2"});
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 3; ++i)
      csv.row(0.5 * i, 0.25 * j, 0, 0.1 * i, 0.3 * j, 0);
  csv.close();
  talus::write_vtk_image<2>(folder / "grid2.vti", {0, 0}, {0.5, 0.25}, nodes2,
                            {talus::vtk_node_field("u", nodes2, f2)});

  // The cells at one node of these grids: one in 3-D, two in 2-D.
  const auto shown3 = [](const Index<3>& i) { return i == Index<3>{3, 2, 1}; };
  csv.open(folder / "cells3.csv", {"x", "y", "z", "f"});
  for (int k = 0; k < 2; ++k)
    for (const auto& [i, j] : {std::pair(2, 1), {3, 1}, {3, 2}, {2, 2}})
      csv.row(-1 + 0.25 * i, 0.5 + 0.5 * j, 2.0 + k, f3({i, j, k}));
  csv.close();
  talus::write_vtk_cells(folder / "cells3.vtu", origin3, spacing3, nodes3,
                         {talus::vtk_node_field("f", nodes3, f3)}, shown3);
  csv.open(folder / "cells2.csv", {"x", "y", "z", "u_0", "u_1", "u_2"});
  for (const auto& [i, j] : {std::pair(0, 0), {1, 0}, {1, 1}, {0, 1}, {2, 0}, {2, 1}})
    csv.row(0.5 * i, 0.25 * j, 0, 0.1 * i, 0.3 * j, 0);
  csv.close();
  talus::write_vtk_cells<2>(folder / "cells2.vtu", {0, 0}, {0.5, 0.25}, nodes2,
                            {talus::vtk_node_field("u", nodes2, f2)}, [](const Index<2>& i) {
                              return i == Index<2>{1, 0};
                            });

  talus::VtkSeries series(folder / "samples.pvd");
  series.add(0, folder / "particles3.vtp");
  series.add(0.1, folder / "particles2.vtp");
  series.add(0.2, folder / "empty.vtp");
  CHECK(contains(content(folder / "samples.pvd"), "file=\"particles2.vtp\""));
}

TEST_CASE("progress: lines in a log") {
  const Folder folder;
  const auto shown = [&](const talus::ProgressParams& params, const auto& body) {
    talus::ProgressParams p = params;
    p.stream = std::fopen((folder / "log").string().c_str(), "w");
    {
      talus::Progress progress("run", p);
      body(progress);
    }
    std::fclose(p.stream);
    return content(folder / "log");
  };
  const talus::ProgressParams eager{.log_seconds = 0}, modest{}, quiet{.quiet = true};
  const auto run = [](talus::Progress& progress) {
    for (int i = 0; i <= 1000; ++i)
      progress.update(i / 1000.0, "t = 1 s");
    progress.note("a remark");
    progress.finish("at rest");
  };
  const std::string log = shown(eager, run);
  CHECK(contains(log, "run   50 %  t = 1 s  0 s, about 0 s left\n"));
  CHECK(contains(log, "run  100 %  t = 1 s  0 s\n"));
  CHECK(contains(log, "\na remark\n"));
  CHECK(contains(log, "run  done in 0 s  at rest\n"));
  CHECK_FALSE(contains(log, "\r"));
  CHECK(shown(modest, run) == "a remark\nrun  done in 0 s  at rest\n");
  CHECK(shown(quiet, run).empty());
  CHECK(shown(eager, [](talus::Progress& p) { p.update(std::nan(""), "t = 2 s"); }) ==
        "run  t = 2 s  0 s\n");
}

TEST_CASE("progress: durations") {
  CHECK(talus::Progress::duration(0.4) == "0 s");
  CHECK(talus::Progress::duration(59.4) == "59 s");
  CHECK(talus::Progress::duration(59.6) == "1 min 00 s");
  CHECK(talus::Progress::duration(185) == "3 min 05 s");
  CHECK(talus::Progress::duration(7620) == "2 h 07 min");
  CHECK(talus::Progress::duration(std::numeric_limits<double>::infinity()).ends_with(" min"));
}

TEST_CASE("CSV: a table goes on where it was") {
  const Folder folder;
  talus::CsvWriter table(folder / "a.csv", {"x", "y"});
  table.row(1, 2);
  const auto bytes = table.size();
  table.row(3, 4);
  table.close();
  table.resume(folder / "a.csv", {"x", "y"}, bytes);
  table.row(5, 6);
  table.close();
  CHECK(content(folder / "a.csv") == "x,y\n1,2\n5,6\n");
  CHECK(contains(message_of<std::runtime_error>([&] {
                   talus::CsvWriter().resume(folder / "a.csv", {"x", "y"}, 1000);
                 }),
                 "it has 12 bytes instead of 1000"));
  CHECK_THROWS_AS(talus::CsvWriter().resume(folder / "none.csv", {"x"}, 0), std::runtime_error);
}

} // namespace test_io
