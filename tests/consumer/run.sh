#!/bin/sh
# SPDX-License-Identifier: MIT
# Builds and runs projects that use talus in every way it is offered:
#
#     sh tests/consumer/run.sh FOLDER          results go into FOLDER, which is emptied
#
# Not the full product of ways, compilers, build types and standards, which would be 48 builds. Seven
# builds have each way at least once, and each pair of compiler, type and standard once or more:
#
#     way                               compiler   type      standard
#     plain -I                          g++        debug     C++20
#     pkg-config, from the .deb         clang++    release   C++23
#     find_package, moved prefix        g++        release   C++23
#     find_package, moved prefix        clang++    debug     C++20
#     find_package, from the .tar.gz    g++        release   C++20
#     add_subdirectory                  clang++    release   C++20
#     FetchContent                      clang++    debug     C++23
#
# Then all that must be refused is: another version, an unknown component, no Eigen. CXX_SECOND
# replaces clang++.
set -eu

[ $# -eq 1 ] || { sed -n '3,5s/^# \{0,1\}//p' "$0" >&2; exit 2; }
here=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)
root=$(dirname -- "$(dirname -- "$here")")
rm -rf "$1"
mkdir -p "$1"
work=$(CDPATH='' cd -- "$1" && pwd)
first=${CXX:-g++}
second=${CXX_SECOND:-clang++}
warnings='-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wold-style-cast -Werror'
eigen=$(pkg-config --cflags eigen3 | sed 's/-I/-isystem /g')

fail() { echo "consumer: $*" >&2; exit 1; }

# ran NAME PROGRAM: it starts and finds what it expects
ran() {
  "$2" > "$work/output" || fail "$1: the program failed"
  echo "ok  $1: $(cat "$work/output")"
}

# with_cmake NAME PROJECT COMPILER TYPE STANDARD [OPTION...]
with_cmake() {
  name=$1 project=$2 compiler=$3 type=$4 standard=$5
  shift 5
  build=$work/$(echo "$name" | tr -c 'a-z0-9\n' _)
  if ! { cmake -S "$here/$project" -B "$build" -DCMAKE_CXX_COMPILER="$compiler" \
    -DCMAKE_BUILD_TYPE="$type" -DCMAKE_CXX_STANDARD="$standard" -DCMAKE_CXX_FLAGS="$warnings" "$@" &&
    cmake --build "$build" --parallel "$(getconf _NPROCESSORS_ONLN)"; } > "$build.log" 2>&1; then
    cat "$build.log" >&2
    fail "$name does not build"
  fi
  ran "$name" "$build/consumer"
}

# refused NAME WORDS OPTION...: find_package must fail, and say why
refused() {
  name=$1 words=$2
  shift 2
  if cmake -S "$here/find_package" -B "$work/refused" "$@" > "$work/refused.log" 2>&1; then
    fail "$name was not refused"
  fi
  tr -s '\n ' ' ' < "$work/refused.log" | grep -q "$words" ||
    { cat "$work/refused.log" >&2; fail "$name: not in the message: $words"; }
  rm -rf "$work/refused"
  echo "ok  refused: $name"
}

# shellcheck disable=SC2086 # lists of words
plain() { # plain NAME COMPILER FLAGS
  $2 $3 $warnings "$here/main.cpp" "$here/other.cpp" -o "$work/plain" || fail "$1 does not build"
  ran "$1" "$work/plain"
}

plain "plain -I, $first, debug, C++20" "$first" "-std=c++20 -O0 -g -I $root/include $eigen"

cmake -S "$root" -B "$work/build" -DTALUS_BUILD_TESTS=OFF -DTALUS_BUILD_EXAMPLES=OFF > "$work/build.log"
cmake --install "$work/build" --prefix "$work/first place" > "$work/install.log"
mkdir "$work/moved"
mv "$work/first place" "$work/moved/a prefix"
moved="-DCMAKE_PREFIX_PATH=$work/moved/a prefix"
if grep -rqF -e "$work" -e "$root" "$work/moved/a prefix/share/cmake" "$work/moved/a prefix/share/pkgconfig"; then
  fail "the installed files name folders of the machine that built them"
fi
with_cmake "find_package, moved, $first, release, c++23" find_package "$first" Release 23 "$moved"
with_cmake "find_package, moved, $second, debug, c++20" find_package "$second" Debug 20 "$moved"

(cd "$work/build" && cpack > "$work/cpack.log") || { cat "$work/cpack.log" >&2; fail "cpack failed"; }
mkdir "$work/tgz"
tar -C "$work/tgz" --strip-components=1 -xzf "$work"/build/talus-*.tar.gz
with_cmake "find_package, tar.gz, $first, release, c++20" find_package "$first" Release 20 \
  -DCMAKE_PREFIX_PATH="$work/tgz"

if command -v dpkg-deb > /dev/null; then
  dpkg-deb -x "$work"/build/libtalus-dev_*_all.deb "$work/deb"
  dpkg-deb -f "$work"/build/libtalus-dev_*_all.deb Depends | grep -q 'libeigen3-dev (>= 3.4)' ||
    fail "the .deb does not depend on Eigen"
  prefix=$work/deb/usr
else
  echo "no dpkg-deb: the .deb is left out"
  prefix=$work/tgz
fi
export PKG_CONFIG_PATH="$prefix/share/pkgconfig"
version=$(sed -n 's/.*TALUS_VERSION "\(.*\)".*/\1/p' "$root/include/talus/version.hpp")
pkg-config --exact-version="$version" talus || fail "pkg-config knows another version"
if pkg-config --atleast-version=99 talus; then fail "pkg-config accepts version 99"; fi
# Eigen's folder by -isystem: its warnings are not ours
plain "pkg-config, .deb, $second, release, C++23" "$second" "-std=c++2b -O2 $(pkg-config --cflags talus |
  sed 's/-I\([^ ]*eigen3\)/-isystem \1/g')"

with_cmake "add_subdirectory, $second, release, c++20" add_subdirectory "$second" Release 20
with_cmake "fetchcontent, $second, debug, c++23" add_subdirectory "$second" Debug 23 -DCONSUMER_FETCH=ON

refused "version 0.0" 'requested version "0.0"' "$moved" -DCONSUMER_VERSION=0.0
refused "version 0.2" 'requested version "0.2"' "$moved" -DCONSUMER_VERSION=0.2
refused "version 1" 'requested version "1' "$moved" -DCONSUMER_VERSION=1.0
refused "a component that is none" 'none that is called MPI' "$moved" \
  -DCONSUMER_COMPONENTS=MPI
refused "a machine without Eigen" 'Eigen3' "$moved" -DCMAKE_DISABLE_FIND_PACKAGE_Eigen3=ON
echo "consumer: all passed"
