#!/bin/sh
# SPDX-License-Identifier: MIT
# Kills one rank of a run by SIGKILL, again and again at random moments, and goes on, on 3 ranks and on
# 2 in turns, until the run is finished. What is there after a kill must be a whole checkpoint that
# is no older than the interval, and the results those of a run on one rank that was left alone.
#
#     kill_ranks.sh PROGRAM FOLDER
#
# PROGRAM: examples/collapse, built for MPI. KILL_SEED=N repeats the moments of the run that printed
# N; MPIRUN="mpirun OPTIONS...": what starts ranks.
set -eu
program=$1 folder=$2
interval=0.1 # s between checkpoints
allowed=2    # s more, for a step, a write and a busy machine
rm -rf "$folder"
mkdir -p "$folder"
if [ "$(id -u)" = 0 ]; then # Open MPI refuses root, and more ranks than cores, unless told
  export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
fi
export OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_mpi_yield_when_idle=1
mpirun=${MPIRUN:-mpirun}
options="--case B00 --dim 2 --end-time 0.6 --vtk none --quiet --no-plot --threads 1"
killed=$folder/killed
# shellcheck disable=SC2086 # several words
$mpirun -n 1 "$program" $options --out "$folder/whole"

# The pieces that the checkpoint needs, or those that are there; names without the generation's.
pieces_listed() { grep -a -c '^piece ' "$killed/checkpoint.talus"; }
pieces_there() {
  generation=$(grep -a -m 1 '^pieces ' "$killed/checkpoint.talus" | cut -d ' ' -f 2)
  find "$killed" -name "checkpoint.talus.$generation-*" ! -name '*.tmp' | wc -l
}

kills=0 worst=0
seed=${KILL_SEED:-$(date +%s)}
while :; do
  ranks=$((3 - kills % 2)) status=0
  : > "$folder/started"
  # shellcheck disable=SC2086
  sh -c "exec $mpirun -n $ranks $program $options --checkpoint-interval $interval --resume --out $killed" \
    > "$folder/log" 2>&1 &
  process=$!
  sleep "$(awk -v seed="$((seed + kills))" 'BEGIN { srand(seed); print 0.5 + 3 * rand() }')"
  victim=$(ps -o pid= --ppid $process | awk -v seed="$((seed + kills))" '
    { ids[NR] = $1 } END { srand(seed + 1); if (NR) print ids[1 + int(NR * rand())] }')
  moment=$(date +%s.%N)
  [ -z "$victim" ] || kill -KILL "$victim" 2> /dev/null || :
  wait $process || status=$?
  [ $status -eq 0 ] && break
  [ $status -eq 137 ] || {
    cat "$folder/log"
    echo "the run failed with status $status"
    exit 1
  }
  if [ -e "$killed/checkpoint.talus" ]; then
    [ "$(pieces_listed)" = "$(pieces_there)" ] || {
      echo "the checkpoint lists $(pieces_listed) pieces, and there are $(pieces_there)"
      exit 1
    }
    if [ -n "$(find "$killed/checkpoint.talus" -newer "$folder/started")" ]; then
      worst=$(stat -c %.Y "$killed/checkpoint.talus" |
        awk -v moment="$moment" -v worst="$worst" '{ age = moment - $1; print (age > worst ? age : worst) }')
      echo "$worst" | awk -v most=$interval -v more=$allowed '{ exit !($1 <= most + more) }' || {
        echo "SIGKILL cost $worst s, checkpoints are $interval s apart"
        exit 1
      }
    fi
  fi
  kills=$((kills + 1))
  [ $kills -lt 200 ] || { echo "not finished after $kills kills: every one lost all progress"; exit 1; }
done
[ $kills -gt 0 ] || { echo "the run was never killed: too fast"; exit 1; }

for file in front.csv profiles.csv sections.csv; do
  diff -q "$folder/whole/$file" "$killed/$file"
done
checksum() { grep -o '"state_checksum": "[0-9a-f]*"' "$1/summary.json"; }
[ "$(checksum "$folder/whole")" = "$(checksum "$killed")" ]
left=$(find "$killed" -name 'checkpoint.talus*')
if [ -n "$left" ]; then
  echo "of the finished run's checkpoints there is still $left"
  exit 1
fi
echo "a rank killed $kills times (seed $seed); the same results; the checkpoint was at most $worst s" \
  "old, with $interval s between them"
