// SPDX-License-Identifier: MIT
// flags: -fno-exceptions
// says: talus tells mistakes by exceptions: compile without -fno-exceptions
#include <talus/talus.hpp>

int main() {
  return 0;
}
