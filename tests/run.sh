#!/bin/sh
# SPDX-License-Identifier: MIT
# Builds and runs all tests, from any folder. Installs what is missing (see examples/setup.sh).
#
#     sh tests/run.sh [OPTIONS OF CTEST...]     -R NAME: those that are called so; -LE ranks: without MPI
set -eu
case ${1:-} in -h | --help) sed -n '3,5s/^# \{0,1\}//p' "$0"; exit 0 ;; esac

root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
build=$root/build/tests
jobs=$(getconf _NPROCESSORS_ONLN)

sh "$root/examples/setup.sh" tests

if command -v ninja > /dev/null; then
  export CMAKE_GENERATOR="${CMAKE_GENERATOR:-Ninja}" # only counts for a new build folder
fi
# Optimised, but without NDEBUG: Eigen checks sizes and indices.
cmake -S "$root" -B "$build" -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_FLAGS_RELEASE=-O2 -DCMAKE_UNITY_BUILD=ON \
  -DTALUS_BUILD_TESTS=ON -DTALUS_BUILD_EXAMPLES=OFF \
  -DTALUS_WARNINGS_AS_ERRORS=ON
cmake --build "$build" --parallel "$jobs"

status=0
(cd "$build" && ctest --output-on-failure --no-tests=error --parallel "$jobs" "$@") || status=$?

# How much was checked, program by program.
awk '/^[0-9]+\/[0-9]+ Testing: / { kind = $3; sub(/:.*/, "", kind) }
     /^\[doctest\] test cases:/ { cases[kind] += $4 }
     /^\[doctest\] assertions:/ { assertions[kind] += $3 }
     END { for (kind in cases) print kind ": " cases[kind] " cases, " assertions[kind] " assertions" }' \
  "$build/Testing/Temporary/LastTest.log"
exit $status
