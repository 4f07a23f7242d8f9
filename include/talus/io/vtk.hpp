// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/types.hpp"
#include "talus/io/atomic_file.hpp"

#include <bit>
#include <charconv>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>
#include <vector>

/// \file
/// Files for ParaView and other VTK readers: particles (.vtu or .vtp), nodal fields (.vtu or .vti)
/// and time series (.pvd). XML with the numbers appended as raw doubles, so nothing is rounded.
/// meshio reads .vtu alone.
///
/// Two-dimensional data lies in the plane z = 0. A file appears under its name only when complete:
/// it is written as NAME.tmp and renamed. What cannot be written is a std::runtime_error that names
/// the file and the reason.

namespace talus {

/// Numbers with a name, for each particle or node. Made by vtk_field() and vtk_node_field(), or by
/// hand.
struct VtkField {
  std::string name;           ///< as ParaView shows it
  int components = 1;         ///< numbers an item: 1, 3 (vector), 9 (tensor, row by row), …
  std::vector<double> values; ///< #items × components, those of one item side by side
};

namespace detail {

static_assert(std::endian::native == std::endian::little,
              "talus: VTK files are written on little-endian machines only");

/// How a value is laid out in a field: plane vectors become 3-D, tensors 3 × 3 row by row.
template <class Value>
struct VtkLayout;

template <class Number>
requires std::is_arithmetic_v<Number>
struct VtkLayout<Number> {
  static constexpr int components = 1;
  static void append(std::vector<double>& values, Number value) {
    values.push_back(static_cast<double>(value));
  }
};

template <class Real, int Rows, int Cols, int Options> // users' matrices may be stored by rows
requires((Rows == 2 || Rows == 3) &&
         (Cols == 1 || Cols == Rows)) struct VtkLayout<Eigen::Matrix<Real, Rows, Cols, Options>> {
  static constexpr int columns = Cols == 1 ? 1 : 3;
  static constexpr int components = 3 * columns;
  static void append(std::vector<double>& values,
                     const Eigen::Matrix<Real, Rows, Cols, Options>& value) {
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < columns; ++c)
        values.push_back(r < Rows && c < Cols ? static_cast<double>(value(r, c)) : 0.0);
  }
};

inline std::string xml_escaped(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '&')
      escaped += "&amp;";
    else if (c == '<')
      escaped += "&lt;";
    else if (c == '"')
      escaped += "&quot;";
    else
      escaped += c;
  }
  return escaped;
}

/// The fewest digits that read back as the same number.
inline std::string shortest(double value) {
  char digits[32];
  return {digits, std::to_chars(digits, digits + sizeof digits, value).ptr};
}

/// Three coordinates as an XML attribute's value; `flat` stands in for z in 2-D.
template <int Dim>
std::string vtk_triple(const Vec<Dim>& v, double flat) {
  return shortest(v[0]) + " " + shortest(v[1]) + " " + shortest(Dim == 3 ? v[Dim - 1] : flat);
}

/// Throws std::invalid_argument unless the field has its components for `items` items.
inline void check_vtk_field(const VtkField& field, std::size_t items) {
  const std::string name = "VTK field \"" + field.name + "\"";
  if (field.components < 1)
    throw_invalid(name + ": the number of components", field.components, "at least 1");
  const std::size_t expected = items * static_cast<std::size_t>(field.components);
  if (field.values.size() != expected)
    throw_invalid(name + ": the number of values", field.values.size(), std::to_string(expected));
}

/// The number of nodes of a regular grid. Throws std::invalid_argument if it is none.
template <int Dim>
std::size_t vtk_node_count(const Vec<Dim>& origin, const Vec<Dim>& spacing,
                           const Index<Dim>& nodes) {
  static_assert(Dim == 2 || Dim == 3, "talus: the dimension is 2 or 3");
  std::size_t count = 1;
  for (int a = 0; a < Dim; ++a) {
    if (nodes[a] < 1)
      throw_invalid("the number of nodes along axis " + std::to_string(a), nodes[a], "at least 1");
    require_finite("the origin along axis " + std::to_string(a), origin[a]);
    require_positive("the spacing along axis " + std::to_string(a), spacing[a]);
    count *= static_cast<std::size_t>(nodes[a]);
  }
  return count;
}

/// The XML of a VTK file and the arrays that its end is made of.
class VtkDocument {
 public:
  explicit VtkDocument(std::string_view type)
      : type_(type), xml_("<?xml version=\"1.0\"?>\n<VTKFile type=\"" + type_ +
                          "\" version=\"1.0\" byte_order=\"LittleEndian\""
                          " header_type=\"UInt64\">\n") {}

  void add(std::string_view xml) { xml_ += xml; }

  /// `values` and `chosen` must live until write(). chosen: which items are written; null: all.
  template <class Number>
  void add_array(std::string_view name, int components, const std::vector<Number>& values,
                 const std::vector<std::int32_t>* chosen = nullptr) {
    xml_ += "<DataArray type=\"" + std::string(type_name<Number>()) + "\" Name=\"" +
            xml_escaped(name) + '"';
    if (components > 1) // meshio would make a matrix of one column of it
      xml_ += " NumberOfComponents=\"" + std::to_string(components) + '"';
    xml_ += " format=\"appended\" offset=\"" + std::to_string(offset_) + "\"/>\n";
    const std::size_t item = static_cast<std::size_t>(components) * sizeof(Number);
    const std::size_t bytes =
        chosen == nullptr ? values.size() * sizeof(Number) : chosen->size() * item;
    blocks_.push_back({reinterpret_cast<const char*>(values.data()), bytes, item, chosen});
    offset_ += sizeof(std::uint64_t) + bytes;
  }

  /// Throws std::invalid_argument unless each field has its components for `items` items.
  void add_point_data(const std::vector<VtkField>& fields, std::size_t items,
                      const std::vector<std::int32_t>* chosen = nullptr) {
    add("<PointData>\n");
    for (const VtkField& field : fields) {
      check_vtk_field(field, items);
      add_array(field.name, field.components, field.values, chosen);
    }
    add("</PointData>\n");
  }

  void write(const std::filesystem::path& path) const {
    AtomicFile file(path);
    file.write(xml_);
    file.write("</" + type_ + ">\n<AppendedData encoding=\"raw\">\n_");
    for (const Block& block : blocks_) {
      const std::uint64_t bytes = block.bytes;
      file.write(&bytes, sizeof bytes);
      if (block.chosen == nullptr)
        file.write(block.data, block.bytes);
      else
        for (const std::int32_t item : *block.chosen)
          file.write(block.data + static_cast<std::size_t>(item) * block.item, block.item);
    }
    file.write("\n</AppendedData>\n</VTKFile>\n");
    file.commit();
  }

 private:
  struct Block {
    const char* data;
    std::size_t bytes, item; ///< of all that is written; of one item
    const std::vector<std::int32_t>* chosen;
  };

  template <class Number>
  static constexpr std::string_view type_name() {
    if constexpr (std::same_as<Number, double>)
      return "Float64";
    else if constexpr (std::same_as<Number, std::int64_t>)
      return "Int64";
    else if constexpr (std::same_as<Number, std::int32_t>)
      return "Int32";
    else
      return "UInt8";
  }

  std::string type_, xml_;
  std::vector<Block> blocks_;
  std::size_t offset_ = 0;
};

/// An unstructured grid. points: 3 coordinates each, m; fields: one value for each of `items`, of
/// which `chosen` are the points (null: all); cells: the points of each cell, one after the other;
/// corners: points of a cell; shape: VTK's number of it.
template <class Number>
void write_vtk_unstructured(const std::filesystem::path& path, const std::vector<double>& points,
                            const std::vector<VtkField>& fields, std::size_t items,
                            const std::vector<std::int32_t>* chosen,
                            const std::vector<Number>& cells, std::size_t corners,
                            std::uint8_t shape) {
  const std::size_t count = cells.size() / corners;
  std::vector<std::int64_t> ends(count);
  for (std::size_t c = 0; c < count; ++c)
    ends[c] = static_cast<std::int64_t>(corners * (c + 1));
  const std::vector<std::uint8_t> shapes(count, shape);
  VtkDocument file("UnstructuredGrid");
  file.add("<UnstructuredGrid>\n<Piece NumberOfPoints=\"" + std::to_string(points.size() / 3) +
           "\" NumberOfCells=\"" + std::to_string(count) + "\">\n");
  file.add_point_data(fields, items, chosen);
  file.add("<Points>\n");
  file.add_array("position", 3, points);
  file.add("</Points>\n<Cells>\n");
  file.add_array("connectivity", 1, cells);
  file.add_array("offsets", 1, ends);
  file.add_array("types", 1, shapes);
  file.add("</Cells>\n</Piece>\n");
  file.write(path);
}

} // namespace detail

/// What a VTK field can hold: a number, Vec<2>, Vec<3>, Mat<2> or Mat<3>.
template <class Value>
concept VtkValue = requires {
  detail::VtkLayout<Value>::components;
};

/// A field of numbers, Vec<2>, Vec<3>, Mat<2> or Mat<3>, one value a particle or node (#items).
/// Vectors get three components and tensors nine, with zeros in 2-D.
template <VtkValue Value>
VtkField vtk_field(std::string name, const std::vector<Value>& values) {
  using Layout = detail::VtkLayout<Value>;
  VtkField field{std::move(name), Layout::components, {}};
  field.values.reserve(values.size() * Layout::components);
  for (const Value& value : values)
    Layout::append(field.values, value);
  return field;
}

/// A nodal field for write_vtk_image. `nodes` is the number of nodes along each axis; value(index)
/// is called once for each node, Index<Dim>{i, j(, k)} from 0 up, and gives a number, Vec or Mat.
template <int Dim, class Function>
VtkField vtk_node_field(std::string name, const Index<Dim>& nodes, const Function& value) {
  using Value = std::decay_t<decltype(value(nodes))>;
  using Layout = detail::VtkLayout<Value>;
  VtkField field{std::move(name), Layout::components, {}};
  Index<Dim> index;
  const int layers = Dim == 3 ? nodes[Dim - 1] : 1;
  for (int k = 0; k < layers; ++k)
    for (int j = 0; j < nodes[1]; ++j)
      for (int i = 0; i < nodes[0]; ++i) {
        index[Dim - 1] = k; // overwritten by j in 2-D
        index[1] = j;
        index[0] = i;
        Layout::append(field.values, value(index));
      }
  return field;
}

/// Writes particles as points: an unstructured grid if the path ends with .vtu, poly data (.vtp)
/// else. positions: #p × d, m; fields: #p values each. Throws std::invalid_argument for a field of
/// another size, std::runtime_error if the file cannot be written.
template <int Dim>
void write_vtk_particles(const std::filesystem::path& path, const std::vector<Vec<Dim>>& positions,
                         const std::vector<VtkField>& fields) {
  const std::size_t count = positions.size();
  const std::vector<double> points = vtk_field("", positions).values;
  std::vector<std::int64_t> first(count), last(count); // each point is a cell of its own
  for (std::size_t p = 0; p < count; ++p) {
    first[p] = static_cast<std::int64_t>(p);
    last[p] = static_cast<std::int64_t>(p + 1);
  }
  if (path.extension() == ".vtu") {
    constexpr std::uint8_t vertex = 1;
    detail::write_vtk_unstructured(path, points, fields, count, nullptr, first, 1, vertex);
    return;
  }
  const std::string number = std::to_string(count);
  detail::VtkDocument file("PolyData");
  file.add("<PolyData>\n<Piece NumberOfPoints=\"" + number + "\" NumberOfVerts=\"" + number +
           "\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n");
  file.add_point_data(fields, count);
  file.add("<Points>\n");
  file.add_array("position", 3, points);
  file.add("</Points>\n<Verts>\n");
  file.add_array("connectivity", 1, first);
  file.add_array("offsets", 1, last);
  file.add("</Verts>\n</Piece>\n");
  file.write(path);
}

/// Writes nodal fields of a regular grid (.vti). origin: position of node 0, m; spacing: distance
/// of nodes along each axis, m, > 0; nodes: their number along each axis, ≥ 1; fields: #nodes
/// values each, the *first* axis fastest (not the order of talus::Grid): vtk_node_field makes them
/// so. Throws std::invalid_argument for a wrong number or size, std::runtime_error if the file
/// cannot be written.
template <int Dim>
void write_vtk_image(const std::filesystem::path& path, const Vec<Dim>& origin,
                     const Vec<Dim>& spacing, const Index<Dim>& nodes,
                     const std::vector<VtkField>& fields) {
  const std::size_t count = detail::vtk_node_count<Dim>(origin, spacing, nodes);
  std::string extent;
  for (int a = 0; a < 3; ++a)
    extent += (a > 0 ? " 0 " : "0 ") + std::to_string(a < Dim ? nodes[a] - 1 : 0);
  detail::VtkDocument file("ImageData");
  file.add("<ImageData WholeExtent=\"" + extent + "\" Origin=\"" +
           detail::vtk_triple<Dim>(origin, 0) + "\" Spacing=\"" +
           detail::vtk_triple<Dim>(spacing, 1) + "\">\n<Piece Extent=\"" + extent + "\">\n");
  file.add_point_data(fields, count);
  file.add("</Piece>\n");
  file.write(path);
}

/// Writes nodal fields of a part of a regular grid (.vtu): of the cells with a node for which
/// shown(Index<Dim>) is true, as quadrilaterals or hexahedra. What has material is often a small
/// part of the box. Everything else as write_vtk_image: the fields have values for all nodes.
/// first: added to the indices of nodes where their positions are computed, for a part of a grid.
template <int Dim, class Shown>
void write_vtk_cells(const std::filesystem::path& path, const Vec<Dim>& origin,
                     const Vec<Dim>& spacing, const Index<Dim>& nodes,
                     const std::vector<VtkField>& fields, const Shown& shown,
                     const Index<Dim>& first = {}) {
  const std::size_t count = detail::vtk_node_count<Dim>(origin, spacing, nodes);
  constexpr std::size_t most = std::numeric_limits<std::int32_t>::max();
  if (count > most)
    throw_invalid("the number of nodes", count, "at most " + std::to_string(most));
  // VTK goes around the lower face of a cell, then around the upper one.
  constexpr std::size_t corners = ipow(2, Dim);
  constexpr int around[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  constexpr std::uint8_t shape = Dim == 2 ? 9 : 12;
  const auto number = [&](const Index<Dim>& node) { // the first axis fastest
    std::int32_t n = 0;
    for (int a = Dim - 1; a >= 0; --a)
      n = n * nodes[a] + node[a];
    return n;
  };
  Array<std::int32_t> place(count, -1); // of a node among those that are written
  std::vector<std::int32_t> written;
  std::vector<double> points;
  std::vector<std::int32_t> cells;
  Index<Dim> cell;
  const int layers = Dim == 3 ? nodes[Dim - 1] - 1 : 1;
  for (int k = 0; k < layers; ++k)
    for (int j = 0; j < nodes[1] - 1; ++j)
      for (int i = 0; i < nodes[0] - 1; ++i) {
        cell[Dim - 1] = k; // overwritten by j in 2-D
        cell[1] = j;
        cell[0] = i;
        const auto corner = [&](std::size_t c) {
          Index<Dim> node = cell;
          for (int a = 0; a < Dim; ++a)
            node[a] += around[c][a];
          return node;
        };
        bool any = false;
        for (std::size_t c = 0; c < corners && !any; ++c)
          any = shown(corner(c));
        if (!any)
          continue;
        for (std::size_t c = 0; c < corners; ++c) {
          const Index<Dim> node = corner(c);
          const std::int32_t n = number(node);
          if (place[n] < 0) {
            place[n] = static_cast<std::int32_t>(written.size());
            written.push_back(n);
            for (int a = 0; a < 3; ++a)
              points.push_back(a < Dim ? origin[a] + spacing[a] * (first[a] + node[a]) : 0);
          }
          cells.push_back(place[n]);
        }
      }
  detail::write_vtk_unstructured(path, points, fields, count, &written, cells, corners, shape);
}

/// A time series (.pvd): which file shows which time. The list is rewritten with every frame, so it
/// can be opened while the run goes on.
class VtkSeries {
 public:
  VtkSeries() = default;

  /// Writes a list without frames to `path`, replacing what is there.
  explicit VtkSeries(std::filesystem::path path) : path_(std::move(path)) { write(); }

  /// Goes on with the list at `path` after a resume: frames up to `time` (s) stay, later ones, of
  /// what was done after the checkpoint, are taken out; a list that is not there is begun. Throws
  /// std::runtime_error if there is a file that VtkSeries did not write.
  static VtkSeries resume(std::filesystem::path path, double time) {
    require_finite("the time of a resume", time);
    VtkSeries series;
    series.path_ = std::move(path);
    std::ifstream file(series.path_);
    std::string line;
    for (bool first = true; std::getline(file, line); first = false) {
      constexpr std::string_view frame = "<DataSet timestep=\"";
      double at = 0;
      if (first && !line.starts_with("<?xml"))
        throw std::runtime_error("cannot read " + series.path_.string() +
                                 ": it is no list of frames");
      if (!line.starts_with(frame))
        continue;
      const char* const number = line.data() + frame.size();
      const auto read = std::from_chars(number, line.data() + line.size(), at);
      if (read.ec != std::errc() || *read.ptr != '"')
        throw std::runtime_error("cannot read " + series.path_.string() + ": " + line);
      if (at <= time)
        series.frames_ += line + '\n';
    }
    series.write();
    return series;
  }

  /// Adds a file that is already written. time: s, finite; file: its path, as given to the function
  /// that wrote it. Throws std::runtime_error if the list cannot be written.
  void add(double time, const std::filesystem::path& file) {
    require_finite("the time of a frame", time);
    // the list names files relative to itself, so that the folder can be moved
    const auto folder = std::filesystem::absolute(path_).lexically_normal().parent_path();
    const auto target = std::filesystem::absolute(file).lexically_normal();
    frames_ += "<DataSet timestep=\"" + detail::shortest(time) + "\" part=\"0\" file=\"" +
               detail::xml_escaped(target.lexically_proximate(folder).generic_string()) + "\"/>\n";
    write();
  }

  const std::filesystem::path& path() const { return path_; }

 private:
  void write() const {
    AtomicFile file(path_);
    file.write("<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" "
               "byte_order=\"LittleEndian\">\n<Collection>\n");
    file.write(frames_);
    file.write("</Collection>\n</VTKFile>\n");
    file.commit();
  }

  std::filesystem::path path_;
  std::string frames_;
};

} // namespace talus
