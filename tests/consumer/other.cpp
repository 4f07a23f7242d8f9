// SPDX-License-Identifier: MIT
// The second file: what a header defines without `inline` the linker finds twice.

#include <talus/talus.hpp>

double volume_in_3d() {
  talus::GridParams<3> box{.origin = {0, 0, 0}, .size = {0.3, 0.06, 0.15}, .cells = {10, 2, 5}};
  talus::Particles<3> sand;
  talus::fill_box<3>(sand, talus::Grid<3>(box), {0, 0, 0}, {0.15, 0.06, 0.12}, {});
  double volume = 0;
  for (const double v : sand.volume)
    volume += v;
  return volume;
}
