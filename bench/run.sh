#!/bin/sh
# SPDX-License-Identifier: MIT
# Builds the benchmarks and runs one of them; leaves JSON, a table and pictures.
#
#     sh bench/run.sh local [--out DIR] [options of Google Benchmark]   local solvers, 3 minutes;
#         CXXFLAGS=-march=native before it, in a new build folder: with AVX-512, batches of 8
#     sh bench/run.sh global [--out DIR]                                global solvers, 4 minutes
#     sh bench/run.sh profile [--out DIR] [NAME...]                     global solvers on 48 problems that it records; half an hour,
#         goes on where it was stopped; names: of some problems alone, as in record_global_problems.cpp
#     sh bench/run.sh step [--out DIR] [--quick]                        the whole step and the transfers, 4 minutes
#     sh bench/run.sh scaling [--out DIR] [--quick] [--finer F]         1, 2, 4, ... threads, phase by phase, 4 minutes
#     sh bench/run.sh ranks [--out DIR] [--quick] [--ranks N...]        1, 2, 4, ... ranks of MPI, phase by phase, 5 minutes
#     sh bench/run.sh accuracy [--out DIR] [NAME...]                    flows with a known answer, half an hour or more; names: of transfers, as in accuracy.cpp
set -eu

root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
build=$root/build/bench
case ${1:-} in
  local | global | profile | step | scaling | ranks | accuracy) name=$1; shift ;;
  -h | --help) sed -n '3,13s/^# \{0,1\}//p' "$0"; exit 0 ;;
  *) echo "which benchmark? sh $0 local | global | profile | step | scaling | ranks | accuracy" >&2; exit 2 ;;
esac
[ "${1:-}" != --help ] || exec sh "$0" --help
out=$root/out/bench_$name
if [ "${1:-}" = --out ]; then
  [ $# -ge 2 ] || { echo "--out needs a folder" >&2; exit 2; }
  out=$2
  shift 2
fi

sh "$root/examples/setup.sh" bench
[ "$name" != ranks ] || sh "$root/examples/setup.sh" ranks
if command -v ninja > /dev/null; then
  export CMAKE_GENERATOR="${CMAKE_GENERATOR:-Ninja}" # only counts for a new build folder
fi
cmake -S "$root" -B "$build" -DCMAKE_BUILD_TYPE=Release -DTALUS_BUILD_BENCH=ON \
  -DTALUS_BUILD_TESTS=OFF -DTALUS_BUILD_EXAMPLES=OFF
case $name in
  local) targets=bench_local_solver ;;
  global) targets='bench_global_solver record_global_problems creep' ;;
  profile) targets='bench_global_solver record_global_problems' ;;
  step) targets='bench_step bench_transfers' ;;
  scaling) targets=bench_step ;;
  ranks) targets=bench_ranks ;;
  accuracy) targets=accuracy ;;
esac
# shellcheck disable=SC2086 # several targets
cmake --build "$build" --parallel "$(getconf _NPROCESSORS_ONLN)" --target $targets

mkdir -p "$out" || { echo "$out cannot be made; --out DIR" >&2; exit 2; }
python=python3 # the first in PATH may lack what the system's has
python3 -c 'import matplotlib' 2> /dev/null || python=/usr/bin/python3
if [ "$name" = local ]; then
  "$build/bench/bench_local_solver" --benchmark_repetitions=5 --benchmark_min_time=0.02 \
    --benchmark_enable_random_interleaving=true --benchmark_out_format=json \
    --benchmark_out="$out/local_solver.json" "$@" > "$out/local_solver.log"
  "$python" "$root/bench/local_solver.py" "$out"
  echo "$out/local_solver.json, .md, .png"
  exit
fi

if [ "$name" = accuracy ]; then
  "$build/bench/accuracy" "$@" > "$out/accuracy.csv"
  cat "$out/accuracy.csv"
  echo "$out/accuracy.csv"
  exit
fi

solve="$build/bench/bench_global_solver"
if [ "$name" = profile ]; then
  "$build/bench/record_global_problems" "$out" "$@"
  for problem in "$out"/*.talus; do
    result=$out/profile_$(basename "$problem" .talus).json
    [ -s "$result" ] && continue
    "$solve" --profile --json --repetitions 2 --problem "$problem" > "$result.part" \
      --solver accelerated accelerated-secular coulomb-secular interior-point sweeps-then-interior-point
    mv "$result.part" "$result"
  done
  "$python" "$root/bench/profile.py" "$out"
  echo "$out/profile.png, profile.md"
  exit
fi

if [ "$name" = step ]; then
  "$python" "$root/bench/step.py" "$build" "$out" "$@"
  echo "$out/step.json, .md, .png"
  exit
fi

if [ "$name" = scaling ]; then
  "$python" "$root/bench/scaling.py" "$build" "$out" "$@"
  echo "$out/scaling.json, .md, .png"
  exit
fi

if [ "$name" = ranks ]; then
  "$python" "$root/bench/ranks.py" "$build" "$out" "$@"
  echo "$out/ranks.json, .md"
  exit
fi

echo "residuals against time"
sweeps="accelerated accelerated-secular plain plain-secular coulomb-secular coulomb-newton"
# shellcheck disable=SC2086 # several words
"$solve" --json --history --solver $sweeps --tol 1e-6 --max-sweeps 3000 --repetitions 2 --cold \
  --problem "$root"/bench/problems/b15_*.talus > "$out/histories.json"
echo "recording problems at h, h/2, h/4"
"$build/bench/record_global_problems" "$out" b15_2d_h1_flow b15_2d_h2_flow b15_2d_h4_flow \
  b15_3d_h1_flow b15_3d_h2_flow
echo "sweeps against resolution"
for start in '' --cold; do
  # shellcheck disable=SC2086 # no word when warm
  "$solve" --json --repetitions 2 --max-sweeps 5000 $start --solver accelerated plain coulomb-secular \
    --problem "$out"/b15_*_h*_flow.talus > "$out/resolution_${start#--}.json"
done
echo "threads"
"$solve" --json --repetitions 5 --threads 1 --solver accelerated \
  --problem "$out/b15_3d_h2_flow.talus" > "$out/threads_1.json"
"$solve" --json --repetitions 5 --threads 2 --solver accelerated \
  --problem "$out/b15_3d_h2_flow.talus" > "$out/threads_2.json"
echo "creep against tolerance"
"$build/bench/creep" tolerance > "$out/creep.csv"
echo "creep against packing"
"$build/bench/creep" packing > "$out/packing.csv"
"$python" "$root/bench/global_solver.py" "$out"
echo "$out/global_solver.md, residuals.png, resolution.png, creep.png, packing.csv"
