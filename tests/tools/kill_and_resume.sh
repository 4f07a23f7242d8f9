#!/bin/sh
# SPDX-License-Identifier: MIT
# Kills a run again and again at random moments, by SIGKILL, SIGTERM and SIGINT, and goes on until it
# is finished, with the command that an interrupted run prints. The results must be those of a run
# that was left alone, and SIGKILL may cost no more than one interval between checkpoints.
#
#     kill_and_resume.sh PROGRAM FOLDER
#
# KILL_SEED=N repeats the moments of the run that printed N.
set -eu
program=$1 folder=$2
interval=0.4 # s between checkpoints
frame=0.005  # s of the simulation between frames: some three steps
rm -rf "$folder"
mkdir -p "$folder"
options="--dim 2 --cell 0.0125 0.02 0.00625 --end-time 0.8 --vtk all --snapshot-interval $frame"
options="$options --quiet --no-plot --threads 1"
# shellcheck disable=SC2086 # several words
"$program" $options --out "$folder/whole"

# What SIGKILL cost: the seconds from the first frame that the checkpoint does not have to the last
# one of the killed process, and the longest time between two of these, which is what a step and a
# write take.
lost() {
  reached=$(grep -a -m 1 '^state ' "$folder/killed/checkpoint.talus" 2> /dev/null | cut -d ' ' -f 2)
  find "$folder/killed/vtk" -name 'particles_*.vtu' -newer "$folder/started" -printf '%f %T@\n' | sort |
    awk -v reached="${reached:--1}" -v frame=$frame '
      substr($1, 11, 4) * frame <= reached { next }
      { if (!first) first = last = $2
        if ($2 - last > longest) longest = $2 - last
        last = $2 }
      END { printf "%.3f %.3f\n", last - first, longest }'
}

# shellcheck disable=SC2086
command="$program $options --checkpoint-interval $interval --resume --out $folder/killed"
kills=0 worst=0
seed=${KILL_SEED:-$(date +%s)}
while :; do
  case $((kills % 4)) in 1) signal=TERM ;; 3) signal=INT ;; *) signal=KILL ;; esac
  status=0
  : > "$folder/started"
  sh -c "exec $command" 2> "$folder/log" &
  process=$!
  sleep "$(awk -v seed="$((seed + kills))" 'BEGIN { srand(seed); print 0.1 + 1.4 * rand() }')"
  kill -$signal $process 2> /dev/null || :
  wait $process || status=$?
  [ $status -eq 0 ] && break
  case $status in
    137) # killed
      cost=$(lost)
      echo "$cost" | awk -v interval=$interval '{ exit !($1 <= interval + $2) }' || {
        echo "SIGKILL cost $cost s (work; longest step and write), checkpoints are $interval s apart"
        exit 1
      }
      worst=$(echo "$worst $cost" | awk '{ print ($1 > $2 ? $1 : $2) }') ;;
    130) # interrupted: it finished its step, and said how to go on
      command=$(sed -n 's/^to go on: //p' "$folder/log")
      [ -n "$command" ] || { echo "it did not say how to go on"; exit 1; } ;;
    *) cat "$folder/log"; echo "the run failed with status $status"; exit 1 ;;
  esac
  kills=$((kills + 1))
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
echo "killed $kills times (seed $seed); the same results; SIGKILL cost at most $worst s," \
  "with checkpoints $interval s apart"
