#!/bin/sh
# SPDX-License-Identifier: MIT
# Builds an example and runs it; the program draws its picture:
#
#     sh examples/run.sh              lists the examples
#     sh examples/run.sh NAME [ARGUMENTS OF THE PROGRAM...]
#
# Results go to out/NAME in the project's folder unless --out says otherwise. Installs what is
# missing (see setup.sh). The exit status is that of the program.
set -eu

here=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)
root=$(dirname -- "$here")
build=$root/build/release
for argument; do
  case $argument in --write-jobs | --write-jobs=*) build=$root/build/portable ;; esac
done

list() {
  echo "examples (sh examples/run.sh NAME [ARGUMENTS...], NAME --help for the arguments):"
  for source in "$here"/*.cpp; do
    [ -f "$source" ] || { echo "  (none)"; return; }
    # the first sentence of the comment that it begins with
    about=$(awk '!/^\/\// { exit }
                 !/SPDX|\\file/ { sub(/^\/+ */, ""); text = text (text ? " " : "") $0 }
                 END { sub(/[.:]( .*)?$/, "", text); print text }' "$source")
    printf '  %-16s %s\n' "$(basename "$source" .cpp)" "$about"
  done
}

if [ $# -eq 0 ]; then
  list
  exit 0
fi
name=$1
shift
case $name in
  -h | --help) list; exit 0 ;;
  */* | '') known=no ;;
  *) if [ -f "$here/$name.cpp" ]; then known=yes; else known=no; fi ;;
esac
if [ $known = no ]; then
  echo "no example is called \"$name\"" >&2
  list >&2
  exit 2
fi

sh "$here/setup.sh" examples

# The compiler's best for this very machine, where it knows how; not for jobs, which run on others. The
# name of the processor has everything built anew on another one that shares the folder.
flags=-O3
if [ "$build" = "$root/build/release" ] &&
  echo 'int main() {}' | ${CXX:-c++} -march=native -x c++ -c -o /dev/null - 2> /dev/null; then
  processor=$(grep -m 1 -E '^(flags|Features)' /proc/cpuinfo 2> /dev/null | cksum | cut -d ' ' -f 1)
  flags="-O3 -march=native -DTALUS_PROCESSOR=$processor"
fi
if command -v ninja > /dev/null; then
  export CMAKE_GENERATOR="${CMAKE_GENERATOR:-Ninja}" # only counts for a new build folder
fi
mkdir -p "$build"
started=$build/started-$name # what is newer is of this run
: > "$started"
cmake -S "$root" -B "$build" -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_FLAGS="$flags ${CXXFLAGS:-}" \
  -DTALUS_BUILD_TESTS=OFF -DTALUS_BUILD_EXAMPLES=ON > "$build/configure.log" 2>&1 || {
  cat "$build/configure.log" >&2
  exit 1
}
cmake --build "$build" --target "$name" --parallel "$(getconf _NPROCESSORS_ONLN)" >&2

out='' previous=''
for argument; do
  case $argument in
    --out=*) out=${argument#--out=} ;;
    *) [ "$previous" = --out ] && out=$argument ;;
  esac
  previous=$argument
done
if [ -z "$out" ]; then
  out=$root/out/$name
  [ "$(pwd)" = "$root" ] && out=out/$name
  set -- --out "$out" "$@"
fi

status=0
"$build/examples/$name" "$@" || status=$?

# Only what this run left counts: not after --help or an early failure.
if [ -n "$(find "$out/summary.json" -newer "$started" 2> /dev/null)" ]; then
  echo "$out/summary.json"
fi
exit $status
