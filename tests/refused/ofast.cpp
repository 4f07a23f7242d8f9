// SPDX-License-Identifier: MIT
// flags: -Ofast
// says: talus: not with -ffast-math
#include <talus/talus.hpp>

int main() {}
