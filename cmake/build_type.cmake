# SPDX-License-Identifier: MIT
# Without a build type CMake asks for no optimisation, and programs with talus are some hundred times slower.
if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES AND NOT "${CMAKE_CXX_FLAGS}" MATCHES "-O"
   AND NOT talus_FIND_QUIETLY)
  message(NOTICE "talus: no build type, so nothing is optimised: -DCMAKE_BUILD_TYPE=Release makes programs "
                 "some hundred times faster")
endif()
