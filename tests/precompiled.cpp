// SPDX-License-Identifier: MIT
#include "talus/precompiled_definitions.hpp"
