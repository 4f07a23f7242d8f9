// SPDX-License-Identifier: MIT
// flags: -std=c++17
// says: talus: C\+\+20 is needed
#include <talus/talus.hpp>

int main() {}
