// SPDX-License-Identifier: MIT
#pragma once

#define TALUS_VERSION_MAJOR 0
#define TALUS_VERSION_MINOR 1
#define TALUS_VERSION_PATCH 0
#define TALUS_VERSION "0.1.0"
