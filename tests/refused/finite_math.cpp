// SPDX-License-Identifier: MIT
// flags: -ffinite-math-only
// says: talus: not with -ffast-math
#include <talus/talus.hpp>

int main() {}
