#!/bin/sh
# SPDX-License-Identifier: MIT
# Builds the benchmarks, runs that of the local solvers, draws its table and its picture.
#
#     sh bench/run.sh [--out DIR] [options of Google Benchmark, such as --benchmark_filter=secular]
set -eu

root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
build=$root/build/bench
out=$root/out/bench
if [ "${1:-}" = --out ]; then
  [ $# -ge 2 ] || { echo "--out needs a folder" >&2; exit 2; }
  out=$2
  shift 2
fi
case ${1:-} in -h | --help) sed -n '3,6s/^# \{0,1\}//p' "$0"; exit 0 ;; esac

sh "$root/examples/setup.sh" bench
if command -v ninja > /dev/null; then
  export CMAKE_GENERATOR="${CMAKE_GENERATOR:-Ninja}" # only counts for a new build folder
fi
cmake -S "$root" -B "$build" -DCMAKE_BUILD_TYPE=Release -DTALUS_BUILD_BENCH=ON \
  -DTALUS_BUILD_TESTS=OFF -DTALUS_BUILD_EXAMPLES=OFF
cmake --build "$build"

mkdir -p "$out" || { echo "$out cannot be made; --out DIR" >&2; exit 2; }
"$build/bench/bench_local_solver" --benchmark_repetitions=5 --benchmark_min_time=0.02 \
  --benchmark_enable_random_interleaving=true --benchmark_out_format=json \
  --benchmark_out="$out/local_solver.json" "$@" > "$out/local_solver.log"
python=python3 # the first in PATH may lack what the system's has
python3 -c 'import matplotlib' 2> /dev/null || python=/usr/bin/python3
"$python" "$root/bench/local_solver.py" "$out"
echo "$out/local_solver.json, .md, .png"
