// SPDX-License-Identifier: MIT
// flags: -ffast-math
// says: talus: not with -ffast-math
#include <talus/talus.hpp>

int main() {}
