#!/bin/sh
# SPDX-License-Identifier: MIT
# Options that change how Eigen stores, aligns, indexes or checks, for a whole program, must not change
# what talus computes; nor may any of them bring warnings. Half a minute on two cores:
#
#     sh tests/options/run.sh FOLDER
set -eu
folder=$1
here=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)
include=$here/../../include
eigen=${EIGEN3_INCLUDE_DIR:-/usr/include/eigen3}
mkdir -p "$folder"

# What is built: a name, then flags. They are compared with plain, or 3d_plain.
builds='
3d_plain -DIN_3D
3d_row_major -DIN_3D -DEIGEN_DEFAULT_TO_ROW_MAJOR -DEIGEN_INITIALIZE_MATRICES_BY_NAN
plain -DNDEBUG
row_major -DEIGEN_DEFAULT_TO_ROW_MAJOR
unaligned_int_index -DEIGEN_DONT_ALIGN -DEIGEN_DEFAULT_DENSE_INDEX_TYPE=int
scalar_max_align_no_debug -DEIGEN_DONT_VECTORIZE -DEIGEN_MAX_ALIGN_BYTES=0 -DEIGEN_NO_DEBUG
'
# As users of strict warnings include talus: as their own code, with Eigen as the system's.
warnings='-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wold-style-cast -Wuseless-cast -Werror'

export folder here include eigen warnings
# shellcheck disable=SC2016 # expanded by the inner shell
echo "$builds" | grep . | xargs -P "$(getconf _NPROCESSORS_ONLN)" -I{} sh -euc '
  # shellcheck disable=SC2086 # several words
  set -- {}
  name=$1
  shift
  mkdir -p "$folder/$name"
  g++ -std=c++20 $warnings "$@" -I "$include" -isystem "$eigen" "$here/numbers.cpp" -o "$folder/$name/numbers"
  "$folder/$name/numbers" "$folder/$name" > "$folder/$name/said"'
status=0
for said in "$folder"/*/said; do
  case $said in */3d_*) plain=3d_plain ;; *) plain=plain ;; esac
  diff "$folder/$plain/said" "$said" || { echo "FAILED: $said"; status=1; }
done
[ "$status" -eq 0 ] && echo "the same numbers with $(echo "$builds" | grep -c .) sets of options"
exit $status
