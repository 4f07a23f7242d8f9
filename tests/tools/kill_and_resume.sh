#!/bin/sh
# SPDX-License-Identifier: MIT
# Kills a run again and again at random moments, by SIGKILL, SIGTERM and SIGINT in turn, and goes on
# until it is finished, with the command that an interrupted run prints: the results must be those of
# a run that was left alone.
#
#     kill_and_resume.sh PROGRAM FOLDER
#
# KILL_SEED=N repeats the moments of the run that printed N.
set -eu
program=$1 folder=$2
rm -rf "$folder"
mkdir -p "$folder"
options="--dim 2 --end-time 0.8 --vtk all --quiet --no-plot --threads 1"
# shellcheck disable=SC2086 # several words
"$program" $options --out "$folder/whole"

# shellcheck disable=SC2086
command="$program $options --checkpoint-interval 0.05 --resume --out $folder/killed"
kills=0
signal=KILL
seed=${KILL_SEED:-$(date +%s)}
while :; do
  status=0
  sh -c "exec $command" 2> "$folder/log" &
  process=$!
  sleep "$(awk -v seed="$((seed + kills))" 'BEGIN { srand(seed); print 0.1 + 0.3 * rand() }')"
  kill -$signal $process 2> /dev/null || :
  wait $process || status=$?
  [ $status -eq 0 ] && break
  case $status in
    137) ;; # killed
    130) # interrupted: it finished its step, and said how to go on
      command=$(sed -n 's/^to go on: //p' "$folder/log")
      [ -n "$command" ] || { echo "it did not say how to go on"; exit 1; } ;;
    *) cat "$folder/log"; echo "the run failed with status $status"; exit 1 ;;
  esac
  kills=$((kills + 1))
  case $signal in KILL) signal=TERM ;; TERM) signal=INT ;; *) signal=KILL ;; esac
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
echo "killed $kills times (seed $seed); the same results"
