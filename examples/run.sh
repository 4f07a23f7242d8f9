#!/bin/sh
# SPDX-License-Identifier: MIT
# Builds an example and runs it; the program draws its picture:
#
#     sh examples/run.sh              lists the examples
#     sh examples/run.sh NAME [ARGUMENTS OF THE PROGRAM...]
#     sh examples/run.sh NAME --ranks N [ARGUMENTS...]     on N processes, through MPI
#
# Results go to out/NAME in the project's folder unless --out says otherwise. Installs what is
# missing (see setup.sh). The exit status is that of the program. MPIRUN="mpirun OPTIONS..." gives
# options of one's own to the command that starts ranks; each has one thread unless --threads says
# otherwise.
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

# --ranks is not the program's: take it out.
ranks='' threads='' expected=''
count=$#
while [ "$count" -gt 0 ]; do
  argument=$1 count=$((count - 1))
  shift
  if [ "$expected" = yes ]; then
    ranks=$argument expected=''
    continue
  fi
  case $argument in
    --ranks) expected=yes ;;
    --ranks=*) ranks=${argument#--ranks=} ;;
    --threads | --threads=*) threads=given; set -- "$@" "$argument" ;;
    *) set -- "$@" "$argument" ;;
  esac
done
case $expected$ranks in
  *[!0-9]* | 0*)
    echo "--ranks is \"$ranks\"; allowed: an integer >= 1" >&2
    exit 2 ;;
esac

sh "$here/setup.sh" examples
mpi=OFF
if [ -n "$ranks" ]; then
  sh "$here/setup.sh" ranks
  mpi=ON build=$root/build/mpi
  [ -n "$threads" ] || set -- "$@" --threads 1
fi

# The compiler's best for this very machine, where it knows how; not for jobs, which run on others. The
# name of the processor has everything built anew on another one that shares the folder.
flags=-O3
if [ "$build" != "$root/build/portable" ] &&
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
  -DTALUS_BUILD_TESTS=OFF -DTALUS_BUILD_EXAMPLES=ON -DTALUS_EXAMPLES_MPI=$mpi > "$build/configure.log" 2>&1 || {
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

start=
if [ -n "$ranks" ]; then
  start="${MPIRUN:-mpirun} -n $ranks"
  # Open MPI refuses root, and more ranks than cores, unless told: here both are what was asked for.
  if [ "$(id -u)" = 0 ]; then
    export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
  fi
  export OMPI_MCA_rmaps_base_oversubscribe=1
  if [ "$ranks" -gt "$(getconf _NPROCESSORS_ONLN)" ]; then
    export OMPI_MCA_mpi_yield_when_idle=1
  fi
  if grep -q 'support/sweep.hpp' "$here/$name.cpp"; then
    export TALUS_MPIRUN="$start" # a study: it starts its runs like that
    start=
  fi
fi

status=0
# shellcheck disable=SC2086 # a command with arguments
$start "$build/examples/$name" "$@" || status=$?

# Only what this run left counts: not after --help or an early failure.
if [ -n "$(find "$out/summary.json" -newer "$started" 2> /dev/null)" ]; then
  echo "$out/summary.json"
fi
exit $status
