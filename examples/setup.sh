#!/bin/sh
# SPDX-License-Identifier: MIT
# Makes sure that what the tests, the examples, the benchmarks or the Python module need is there:
#
#     sh examples/setup.sh tests | examples | bench | ranks | python
#
# Looks for each thing itself (a command, a header), so nothing is installed or updated when all is
# there. What is missing comes from apt-get, as root or through sudo. Where that cannot be, says what
# to install and exits with status 1; without Python, which only draws the pictures, goes on. For the
# module it prints which Python that is.

has() { command -v "$1" > /dev/null 2>&1; }

# has_header PATH: is there an include folder with this header?
has_header() {
  # CMAKE_PREFIX_PATH and CONDA_PREFIX are where CMake would look, too
  for prefix in /usr /usr/local /opt/homebrew /opt/local $CONDA_PREFIX \
    $(echo "$CMAKE_PREFIX_PATH" | tr ':;' '  '); do
    [ -f "$prefix/include/$1" ] && return 0
    [ -f "$prefix/include/eigen3/$1" ] && return 0
  done
  return 1
}

# The first Python that can draw: the one in PATH may lack what the system's has.
find_python() {
  for python in python3 /usr/bin/python3; do
    has "$python" && "$python" -c 'import importlib.util as u
raise SystemExit(not (u.find_spec("numpy") and u.find_spec("matplotlib")))' 2> /dev/null &&
      echo "$python" && return 0
  done
  return 1
}

# need PACKAGE WHAT CHECK...: notes the Debian package and what it is if the check fails.
packages='' things=''
need() {
  package=$1 thing=$2
  shift 2
  "$@" && return
  packages="$packages $package"
  things="$things${things:+, }$thing"
}

has_compiler() {
  # a part of C++20's library that came late
  # shellcheck disable=SC2086 # CXX may be a command with arguments
  echo '#include <charconv>
    char text[9]; auto end = std::to_chars(text, text + 9, 0.5);' |
    ${CXX:-c++} -std=c++20 -fsyntax-only -x c++ - 2> /dev/null
}
has_mpi() { has mpirun && { has mpicxx || has mpic++; }; }
has_make() { has ninja || has make; }
has_python() { find_python > /dev/null; }
has_python_header() {
  python=$(find_python) && [ -f "$("$python" -c 'import sysconfig; print(sysconfig.get_path("include"))')/Python.h" ]
}

check_needed() {
  packages='' things=''
  need g++ 'a C++20 compiler (g++ 12, clang++ 14 or newer)' has_compiler
  if [ "$1" = python ]; then
    need libeigen3-dev 'Eigen 3.4' has_header Eigen/Core
    need pybind11-dev pybind11 has_header pybind11/pybind11.h
    need 'python3 python3-dev python3-numpy python3-matplotlib' 'Python 3 with its headers, numpy and matplotlib' \
      has_python_header
    return
  fi
  need cmake 'CMake 3.22 or newer' has cmake
  need make 'make or ninja' has_make
  need libeigen3-dev 'Eigen 3.4' has_header Eigen/Core
  if [ "$1" = ranks ]; then
    need 'openmpi-bin libopenmpi-dev' 'MPI (mpirun and its headers)' has_mpi
    return
  fi
  if [ "$1" = tests ]; then
    need doctest-dev doctest has_header doctest/doctest.h
  elif [ "$1" = bench ]; then
    need libbenchmark-dev 'Google Benchmark' has_header benchmark/benchmark.h
  else
    need libtomlplusplus-dev 'toml++ 3' has_header toml++/toml.h
  fi
  [ "$1" = tests ] && return
  need libcli11-dev CLI11 has_header CLI/CLI.hpp
  need nlohmann-json3-dev 'nlohmann/json 3' has_header nlohmann/json.hpp
}

# Adds what is only for the pictures.
check_wanted() {
  case $1 in tests | ranks | python) return ;; esac
  need 'python3 python3-numpy python3-matplotlib' 'Python 3 with numpy and matplotlib (for the pictures)' has_python
}

# install PACKAGE...: with apt-get; fails if that is not possible.
install() {
  has apt-get || return 1
  as_root=
  if [ "$(id -u)" != 0 ]; then
    has sudo || return 1
    as_root=sudo
    [ -t 0 ] || as_root='sudo -n' # nobody there to type a password
  fi
  echo "installing: $*" >&2
  $as_root env DEBIAN_FRONTEND=noninteractive apt-get update -q >&2 &&
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "$@" >&2
}

say_what_is_missing() {
  echo "$1: $things" >&2
  ! has apt-get || echo "install with: apt-get update && apt-get install -y$packages   (as root)" >&2
}

case $1 in
  tests | examples | bench | ranks | python) ;;
  *) echo "usage: sh $0 tests | examples | bench | ranks | python" >&2; exit 2 ;;
esac

report() { # what is there, for the module
  [ "$1" != python ] || find_python
}
check_needed "$1"
check_wanted "$1"
if [ -z "$packages" ]; then
  report "$1"
  exit 0
fi
# shellcheck disable=SC2086 # one word a package
install $packages
check_needed "$1"
if [ -n "$packages" ]; then
  check_wanted "$1"
  say_what_is_missing 'missing, please install'
  exit 1
fi
check_wanted "$1"
[ -z "$packages" ] || say_what_is_missing 'going on without pictures, for want of'
report "$1"
