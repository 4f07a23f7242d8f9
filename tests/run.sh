#!/bin/sh
# SPDX-License-Identifier: MIT
# Builds and runs all tests, from any folder. Installs what is missing (see examples/setup.sh).
set -eu

root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
build=$root/build/tests
jobs=$(getconf _NPROCESSORS_ONLN)

sh "$root/examples/setup.sh" tests

if command -v ninja > /dev/null; then
  export CMAKE_GENERATOR="${CMAKE_GENERATOR:-Ninja}" # only counts for a new build folder
fi
# Optimised, but without NDEBUG: Eigen checks sizes and indices.
cmake -S "$root" -B "$build" -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_FLAGS_RELEASE=-O2 \
  -DTALUS_BUILD_TESTS=ON -DTALUS_BUILD_EXAMPLES=OFF \
  -DTALUS_WARNINGS_AS_ERRORS=ON
cmake --build "$build" --parallel "$jobs"

status=0
(cd "$build" && ctest --output-on-failure --no-tests=error --parallel "$jobs") || status=$?

# What ctest counts as one test are many cases: their numbers, program by program.
awk '/^[0-9]+\/[0-9]+ Testing: / { name = $3 }
     /^\[doctest\] (test cases|assertions):/ { sub(/^\[doctest\]/, name ":"); print }' \
  "$build/Testing/Temporary/LastTest.log"
exit $status
