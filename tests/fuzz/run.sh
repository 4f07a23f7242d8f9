#!/bin/sh
# SPDX-License-Identifier: MIT
# Fuzzes the readers of files with libFuzzer, address and undefined-behaviour sanitizers:
#
#     sh tests/fuzz/run.sh [RUNS]        RUNS: of each fuzzer, 20000 without
#
# The same inputs every time (a fixed seed), so that it fails or passes for good; a larger number, or
# FUZZ_SEED=N, looks further. An input that crashes is left in build/fuzz. Needs clang++.
set -eu

root=$(CDPATH='' cd -- "$(dirname -- "$0")/../.." && pwd)
build=$root/build/fuzz
runs=${1:-20000}
mkdir -p "$build"

build_fuzzer() {
  clang++ -std=c++20 -O1 -g1 -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=all \
    -fsanitize=float-cast-overflow -DTALUS_EXAMPLES_DIR="\"$root/examples\"" -I "$root/include" \
    -I "$root/examples" -isystem "${EIGEN3_INCLUDE_DIR:-/usr/include/eigen3}" "$1" -o "$2"
}

run_fuzzer() { # run_fuzzer NAME
  build_fuzzer "$root/tests/fuzz/fuzz_$1.cpp" "$build/fuzz_$1"
  rm -rf "$build/corpus_$1"
  mkdir "$build/corpus_$1"
  TALUS_FUZZ_SEEDS=$build/corpus_$1 "$build/fuzz_$1"
  "$build/fuzz_$1" -runs="$runs" -seed="${FUZZ_SEED:-1}" -max_len=8192 -timeout=30 -rss_limit_mb=1024 \
    -verbosity=0 -print_funcs=0 -print_final_stats=1 -artifact_prefix="$build/crash_$1_" "$build/corpus_$1" \
    > "$build/$1.log" 2>&1 || { tail -n 60 "$build/$1.log"; echo "FAILED: fuzz_$1"; return 1; }
  grep -E 'number_of_executed_units|peak_rss' "$build/$1.log" | sed "s/^/$1 /"
}

run_fuzzer text &
text=$!
status=0
run_fuzzer state || status=1
wait $text || status=1
exit $status
