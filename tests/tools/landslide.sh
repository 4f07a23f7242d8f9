#!/bin/sh
# SPDX-License-Identifier: MIT
# What `landslide` is told about the ground and the release counts, or is refused: nothing is passed over.
#
#     landslide.sh PROGRAM FOLDER
set -eu
program=$1 folder=$2
rm -rf "$folder"
mkdir -p "$folder"
fail() { echo "$*"; exit 1; }
slide() { # slide OUT OPTIONS...
  out=$1
  shift
  "$program" --cell 20 --end-time 2 --vtk none --threads 1 --quiet --no-plot --out "$folder/$out" "$@"
}
front() { sed -n 's/^ *"front_m": \([^,]*\),*/\1/p' "$folder/$1/summary.json"; }
refused() { # refused WORDS OPTIONS...
  words=$1 status=0
  shift
  slide refused "$@" > "$folder/said" 2>&1 || status=$?
  [ $status -eq 2 ] || fail "status $status instead of 2: $*: $(cat "$folder/said")"
  grep -q -e "$words" "$folder/said" || fail "$*: not \"$words\" but: $(cat "$folder/said")"
}

slide map
slide smooth --wall-friction 0.05
slide rough --wall-friction 0.9
echo "$(front smooth) $(front map) $(front rough)" | awk '{ exit !($1 > $2 + 1 && $2 > $3 + 1) }' ||
  fail "fronts on smooth ground, on the valley's own and on rough ground: $(front smooth) $(front map) $(front rough) m"

valley=$folder/map
slide files --terrain "$valley/valley.asc" --release "$valley/valley_release.csv" --friction-map "$valley/valley_friction.asc"
[ "$(front files)" = "$(front map)" ] || fail "the valley from its files is another: $(front files) $(front map) m"
refused 'exclude each other' --wall-friction 0.3 --terrain "$valley/valley.asc" --release "$valley/valley_release.csv" \
  --friction-map "$valley/valley_friction.asc"
refused 'exclude each other' --release-surface 1330 --release-depth 20

# A finished run is no answer to another map of the same name.
cp "$valley/valley.asc" "$valley/valley_release.csv" "$valley/valley_friction.asc" "$folder"
edited() {
  slide edited --terrain "$folder/valley.asc" --release "$folder/valley_release.csv" \
    --friction-map "$folder/valley_friction.asc" --resume
}
edited
edited || fail 'a finished run is not taken for the answer'
sed 's/0\.25/0.05/g' "$valley/valley_friction.asc" > "$folder/valley_friction.asc"
status=0
edited 2> "$folder/said" || status=$?
if [ $status -ne 2 ] || ! grep -q friction_content "$folder/said"; then
  fail "status $status: the run of another map of friction is taken for the answer: $(cat "$folder/said")"
fi
echo 'landslide: all that it is told counts'
