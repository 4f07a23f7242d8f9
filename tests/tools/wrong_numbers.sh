#!/bin/sh
# SPDX-License-Identifier: MIT
# Numbers that are not whole words must be refused, on the command line and in case files: status 2,
# and the text in the message. So must keys of case files that nothing reads.
#
#     wrong_numbers.sh PROGRAM FOLDER        PROGRAM: collapse
set -eu
program=$1 folder=$2
rm -rf "$folder"
mkdir -p "$folder"
cases=$(CDPATH='' cd -- "$(dirname -- "$0")/../../examples/cases" && pwd)
failed=0

refused() { # refused TEXT OPTION...
  text=$1
  shift
  status=0
  "$program" --dim 2 --end-time 1e-4 --quiet --no-plot --out "$folder/run" "$@" > "$folder/said" 2>&1 || status=$?
  if [ "$status" -ne 2 ] || ! grep -qF -e "$text" "$folder/said"; then
    echo "FAILED, status $status: $*"
    cat "$folder/said"
    failed=1
  fi
}

for number in '' ' ' 0,5 0.5m 1.5D+03 0x1p-1 nan inf 1e999 '0.5 '; do
  refused "\"$number\" is given" --friction "$number"
  refused "\"$number\" is given" --cell "$number" 0.02 0.00625
done
for number in '' 010 0x10 1e3 2.0 2k; do
  refused "--threads: " --threads "$number"
done
for number in 0,5 0.5m 1.5D+03 .5 '"0.5"' nan -inf 010 true; do
  sed "s/^inclination_deg = .*/inclination_deg = $number/" "$cases/B15.toml" > "$folder/case.toml"
  line=$(grep -n '^inclination_deg' "$folder/case.toml" | cut -d: -f1)
  refused "line $line: " --case "$folder/case.toml"
done
{ cat "$cases/B15.toml"; echo 'runout_exp = 0.49'; } > "$folder/case.toml" # without its unit
refused 'unknown key runout_exp' --case "$folder/case.toml"
[ "$failed" -eq 0 ] && echo "wrong numbers: all refused"
exit "$failed"
