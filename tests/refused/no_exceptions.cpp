// SPDX-License-Identifier: MIT
// flags: -fno-exceptions
// says: talus: exceptions are needed
#include <talus/talus.hpp>

int main() {}
