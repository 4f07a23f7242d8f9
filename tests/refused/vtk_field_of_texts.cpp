// SPDX-License-Identifier: MIT
// A field of texts, which VTK files of numbers cannot hold.
// says: VtkValue

#include <talus/talus.hpp>

#include <string>
#include <vector>

talus::VtkField field(const std::vector<std::string>& names) {
  return talus::vtk_field("names", names);
}
