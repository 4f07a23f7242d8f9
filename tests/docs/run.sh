#!/bin/sh
# SPDX-License-Identifier: MIT
# Checks that the documentation shows what its files hold, then compiles and runs these files, each
# one with the README's command and more warnings:
#
#     sh tests/docs/run.sh [PROGRAM...]       PROGRAM: tests/docs/PROGRAM.cpp; all without one
set -eu

root=$(CDPATH='' cd -- "$(dirname -- "$0")/../.." && pwd)
build=$root/build/docs
python3 "$root/tests/docs/check_snippets.py"
mkdir -p "$build"

# A program ends with status 0 and may write files, into a folder of its own.
# shellcheck disable=SC2016 # for the inner shell to expand
compile_and_run='
  name=$(basename "$1" .cpp)
  rm -rf "$2/$name"
  mkdir "$2/$name"
  cd "$2/$name"
  ${CXX:-g++} -std=c++20 -O1 -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wold-style-cast -Werror \
    -I "$3/include" -isystem "${EIGEN3_INCLUDE_DIR:-/usr/include/eigen3}" "$1" -o program &&
    ./program > output 2>&1 || { cat output; echo "FAILED: $name"; exit 1; }
  echo "ok  $name: $(tail -n 1 output)"'
if [ $# -eq 0 ]; then
  set -- "$root"/tests/docs/*.cpp
else
  for name; do
    shift
    set -- "$@" "$root/tests/docs/$name.cpp"
  done
fi
printf '%s\n' "$@" | xargs -P "$(getconf _NPROCESSORS_ONLN)" -I{} sh -c "$compile_and_run" _ {} "$build" "$root"
