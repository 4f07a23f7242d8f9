#!/bin/sh
# SPDX-License-Identifier: MIT
# Kills a run again and again, at moments that differ, and goes on until it is finished: the results
# must be those of a run that was left alone.
#
#     kill_and_resume.sh PROGRAM FOLDER
set -eu
program=$1 folder=$2
rm -rf "$folder"
mkdir -p "$folder"
options="--dim 2 --end-time 0.8 --vtk all --quiet --no-plot --threads 1"
# shellcheck disable=SC2086 # several words
"$program" $options --out "$folder/whole"

kills=0
signal=KILL
while :; do
  status=0
  # shellcheck disable=SC2086
  "$program" $options --checkpoint-interval 0.05 --resume --out "$folder/killed" 2> "$folder/log" &
  process=$!
  sleep "0.$((15 + kills * 7 % 20))"
  kill -$signal $process 2> /dev/null || :
  wait $process || status=$?
  [ $status -eq 0 ] && break
  case $status in
    137 | 130) ;; # killed; interrupted
    *) cat "$folder/log"; echo "the run failed with status $status"; exit 1 ;;
  esac
  kills=$((kills + 1))
  if [ $signal = KILL ]; then signal=TERM; else signal=KILL; fi
  [ $kills -lt 200 ] || { echo "not finished after $kills kills: every one lost all progress"; exit 1; }
done
[ $kills -gt 0 ] || { echo "the run was never killed: too fast"; exit 1; }

for file in front.csv profiles.csv sections.csv particles.pvd grid.pvd vtk; do
  diff -r -q "$folder/whole/$file" "$folder/killed/$file"
done
checksum() { grep -o '"state_checksum": "[0-9a-f]*"' "$1/summary.json"; }
[ "$(checksum "$folder/whole")" = "$(checksum "$folder/killed")" ]
if [ -e "$folder/killed/checkpoint.talus" ]; then
  echo "the checkpoint of the finished run is still there"
  exit 1
fi
echo "killed $kills times; the same results"
