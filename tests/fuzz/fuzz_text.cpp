// SPDX-License-Identifier: MIT
// What the example programs read: case files, tables to go on with, the summary of an earlier run;
// triangle meshes, maps and polygons.
// Any bytes give an error in words or a result. The first byte says which reader.

#include "input_file.hpp"

#include "support/command_line.hpp"
#include "support/policies.hpp"
#include "support/resume.hpp"

#include "talus/boundary/mesh_distance.hpp"
#include "talus/io/csv.hpp"
#include "talus/io/csv_table.hpp"
#include "talus/io/stl.hpp"
#include "talus/terrain/ascii_grid.hpp"
#include "talus/terrain/polygon.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>

namespace {

/// Calls `read` and takes only errors that are meant for the user.
template <class Read>
void in_words(const Read& read) {
  try {
    read();
  } catch (const std::invalid_argument& error) {
    if (std::string_view(error.what()).empty())
      std::abort();
  }
}

void read_case(std::string_view bytes) {
  const fuzz::fs::path path = fuzz::write("case.toml", bytes);
  in_words([&] {
    const support::Toml file = support::load_case_file(path.string());
    for (const char* key : {"material", "inclination_deg", "paper", "published"}) {
      in_words([&] { static_cast<void>(file.text(key)); });
      in_words([&] { static_cast<void>(file.number(key)); });
      in_words([&] { static_cast<void>(file.table(key).to_json()); });
      in_words([&] { file.table(key).only({"length", "width"}); });
    }
    in_words([&] {
      const support::GrainMaterial material = support::grain_material("beads", file.table("beads"));
      for (const char* law : {"constant", "stop", "mu-i", "hysteretic"})
        in_words([&] {
          support::AnyRheology rheology(
              support::rheology_params({.rheology = law}, material, std::nullopt, true));
          for (const double inertial : {0.0, 1e-3, 1.0, 1e300})
            static_cast<void>(rheology.friction(inertial));
        });
    });
  });
}

void resume_table(std::string_view bytes) {
  const fuzz::fs::path path = fuzz::write("table.csv", bytes);
  const std::size_t keep = bytes.empty() ? 0 : static_cast<unsigned char>(bytes[0]);
  talus::CsvWriter table;
  try {
    table.resume(path, {"a", "b"}, keep);
  } catch (const std::runtime_error&) {
    if (keep <= bytes.size())
      std::abort();
    return;
  }
  table.row(1.5, 2);
  table.close();
  std::ifstream file(path, std::ios::binary);
  const std::string content(std::istreambuf_iterator<char>(file), {});
  if (content != std::string(bytes.substr(0, keep)) + "1.5,2\n")
    std::abort();
}

void read_table(std::string_view bytes) {
  try {
    const talus::CsvTable table = talus::read_csv(fuzz::write("numbers.csv", bytes));
    for (const auto& column : table.columns)
      if (column.size() != table.columns[0].size())
        std::abort();
  } catch (const std::runtime_error& error) {
    if (std::string_view(error.what()).find("cannot read") != 0)
      std::abort();
  }
}

void read_summary(std::string_view bytes) {
  fuzz::write("summary.json", bytes);
  in_words([] { // of a run with other inputs, or one that failed
    try {
      const support::Checkpoints checkpoints(fuzz::folder(), {.resume = true}, {{"case", "B15"}});
      static_cast<void>(checkpoints.finished());
    } catch (const std::runtime_error& error) {
      throw std::invalid_argument(error.what());
    }
  });
}

void read_mesh(std::string_view bytes) {
  talus::TriangleMesh mesh;
  try {
    mesh = talus::read_stl(fuzz::write("mesh.stl", bytes));
  } catch (const std::runtime_error& error) {
    if (std::string_view(error.what()).find("cannot read") != 0)
      std::abort();
    return;
  }
  double extent = 0;
  for (const auto& triangle : mesh)
    for (const auto& corner : triangle) {
      if (!corner.allFinite())
        std::abort();
      extent = std::max(extent, (corner - mesh[0][0]).cwiseAbs().maxCoeff());
    }
  in_words([&] {
    const talus::shapes::SampledMesh solid(mesh, extent / 2);
    static_cast<void>(solid.distance(mesh[0][0]));
  });
}

void read_map(std::string_view bytes) {
  talus::Raster map;
  try {
    map = talus::read_ascii_grid(fuzz::write("map.asc", bytes));
  } catch (const std::runtime_error& error) {
    if (std::string_view(error.what()).find("cannot read") != 0)
      std::abort();
    return;
  }
  in_words([&] { // a corner may be too far away to be a number
    talus::write_ascii_grid(fuzz::folder() / "again.asc", map, -12345.678);
    const talus::Raster again = talus::read_ascii_grid(fuzz::folder() / "again.asc");
    if (again.x != map.x || again.y != map.y || again.values.size() != map.values.size())
      std::abort();
  });
  in_words([&] {
    const talus::BilinearMap ground(map, talus::Vec<2>(map.x, map.y));
    static_cast<void>(ground(0.5, 1e300));
  });
}

void read_polygon(std::string_view bytes) {
  try {
    const talus::Polygon area = talus::read_polygon(fuzz::write("polygon.csv", bytes));
    static_cast<void>(area.distance(area.bounds()[0][0], 1));
  } catch (const std::runtime_error& error) {
    if (std::string_view(error.what()).find("cannot read") != 0)
      std::abort();
  }
}

} // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  if (const char* seeds = std::getenv("TALUS_FUZZ_SEEDS")) {
    const auto save = [&](const std::string& name, const std::string& bytes) {
      std::ofstream(fuzz::fs::path(seeds) / name, std::ios::binary) << bytes;
    };
    for (const char* name : {"B15.toml", "materials.toml"}) {
      std::ifstream file(support::examples_folder() / "cases" / name, std::ios::binary);
      save(name, 't' + std::string(std::istreambuf_iterator<char>(file), {}));
    }
    save("table", "c\x04"
                  "a,b\n1,2\n");
    save("numbers", "na,\"b, c\"\r\n1,-2.5e-3\nnan,\"inf\"\n");
    save("summary", R"(s{"inputs": {"case": "B15"}, "status": "completed"})");
    save("map", "gncols 2\nnrows 2\nxllcorner 5e5\nyllcenter 5e6\ncellsize 5\nNODATA_value -9\n1 "
                "2\n-9 4\n");
    save("polygon", "px,y\n0,0\n1 0\n# b\n1 , 1\n\n");
    std::string tetrahedron = "msolid t\n";
    for (const char* facet :
         {"0 0 0|0 1 0|1 0 0", "0 0 0|1 0 0|0 0 1", "0 0 0|0 0 1|0 1 0", "1 0 0|0 1 0|0 0 1"}) {
      tetrahedron += std::string("vertex ") + facet + "\n";
      for (std::size_t at; (at = tetrahedron.find('|')) != std::string::npos;)
        tetrahedron.replace(at, 1, "\nvertex ");
    }
    save("tetrahedron", tetrahedron);
    save("ascii", "msolid a\nfacet\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1e-3 0\nendsolid\n");
    std::string binary(1 + 84 + 50, '\0');
    binary[0] = 'm';
    binary[81] = 1; // one triangle
    save("binary", binary);
    std::exit(0);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1)
    return 0;
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  if (data[0] == 'c')
    resume_table(bytes);
  else if (data[0] == 'n')
    read_table(bytes);
  else if (data[0] == 's')
    read_summary(bytes);
  else if (data[0] == 'm')
    read_mesh(bytes);
  else if (data[0] == 'g')
    read_map(bytes);
  else if (data[0] == 'p')
    read_polygon(bytes);
  else
    read_case(bytes);
  return 0;
}
