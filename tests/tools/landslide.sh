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

# Maps that lie elsewhere, or have no data where the slide is. moved FILE DX DY: the map, as if it lay there.
moved() {
  awk -v dx="$2" -v dy="$3" '$1 == "xllcorner" { $2 = sprintf("%.1f", $2 + dx) }
                             $1 == "yllcorner" { $2 = sprintf("%.1f", $2 + dy) } 1' "$1"
}
given() { refused "$1" --terrain "$valley/valley.asc" --release "$valley/valley_release.csv" "$2" "$3"; }
for at in '50000 0' '-50000 0' '-1 0' '0 1'; do
  # shellcheck disable=SC2086 # two numbers
  moved "$valley/valley_friction.asc" $at > "$folder/elsewhere.asc"
  given 'elsewhere.asc: its extent in [xy] is .*; allowed: all of the terrain, ' --friction-map "$folder/elsewhere.asc"
done
given 'in y is 5094001.5 to 5094161.5; allowed: all of the terrain, 5094000.5 to 5094160.5' --friction-map "$folder/elsewhere.asc"
moved "$valley/valley.asc" 5000 0 > "$folder/elsewhere.asc"
given 'elsewhere.asc: its extent in x is 637000.5 to 637600.5; allowed: all of the area in .*valley_release.csv, 632030.5 to 632110.5' \
  --release-surface "$folder/elsewhere.asc"
moved "$valley/valley.asc" 0 76 > "$folder/elsewhere.asc"
given 'elsewhere.asc: its extent in y is 5094076.5 to 5094236.5; allowed: all of the area' --release-surface "$folder/elsewhere.asc"
# holed FILE: no data over 30 m by 30 m in the middle of the slide
holed() { awk 'NR > 6 && NR - 6 > 8 && NR - 6 < 15 { for (k = 13; k < 19; ++k) $k = -9999 } 1' "$1"; }
place='what is at (6320[0-9.]*, 5094[0-9.]*) is no data; allowed: numbers under all that slides'
holed "$valley/valley.asc" > "$folder/holed.asc"
refused "holed.asc: $place" --terrain "$folder/holed.asc" --release "$valley/valley_release.csv"
given "holed.asc: $place" --release-surface "$folder/holed.asc"
awk 'NR > 6 { gsub(/[^ ]+/, "-9999") } 1' "$valley/valley.asc" > "$folder/holed.asc"
given 'valley_release.csv: the height of its top is no data' --release-surface "$folder/holed.asc"
holed "$valley/valley_friction.asc" > "$folder/holed.asc"
given "holed.asc: $place" --friction-map "$folder/holed.asc"

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
