#!/bin/sh
# SPDX-License-Identifier: MIT
# Kills a sweep twice by SIGKILL at random moments and starts it again, then does the same sweep by
# the array-job script that it writes. The results must be those of a sweep that was left alone, and
# no job that was finished may be run again.
#
#     kill_sweep.sh PROGRAM FOLDER
#
# KILL_SEED=N repeats the moments of the sweep that printed N.
set -eu
program=$1 folder=$2
rm -rf "$folder"
mkdir -p "$folder"
sweep() { # sweep FOLDER [OPTIONS...]: ends this shell
  out=$folder/$1
  shift
  exec "$program" --end-time 0.15 --threads 2 --quiet --no-plot --out "$out" "$@"
}
fail() { echo "$*"; exit 1; }

# The finished jobs of a sweep: which, and when their summaries were written.
finished() {
  find "$folder/$1/runs" -name summary.json -exec grep -q '"status": "completed"' {} \; \
    -printf '%p %i %T@\n' 2> /dev/null | sort
}
not_run_again() { # not_run_again FOLDER: those of the file `finished` are as they were
  if finished "$1" | comm -23 "$folder/finished" - | grep .; then
    fail "these were run again"
  fi
}
same_results() {
  (cd "$folder/whole" && find . -name '*.csv') | while read -r file; do
    cmp "$folder/whole/$file" "$folder/$1/$file"
  done
  for summary in "$folder"/whole/runs/*/summary.json; do
    [ "$(checksum "$summary")" = "$(checksum "$folder/$1/${summary#"$folder"/whole/}")" ] ||
      fail "$1: not the results of $summary"
  done
}
checksum() { grep -o '"state_checksum": "[0-9a-f]*"' "$1"; }

(sweep whole)
jobs=$(finished whole | wc -l)
[ "$jobs" -gt 2 ] || fail "only $jobs jobs"

seed=${KILL_SEED:-$(date +%s)}
for kill in 1 2; do
  sweep killed &
  process=$!
  # the second time when something is finished, so that there is all: finished, begun, not begun
  until [ $kill -eq 1 ] || [ -n "$(finished killed)" ]; do sleep 0.02; done
  sleep "$(awk -v seed="$((seed + kill))" 'BEGIN { srand(seed); print 0.1 + 0.5 * rand() }')"
  kill -KILL $process || fail "the sweep was through before it was killed"
  wait $process || :
done
for log in "$folder"/killed/runs/*/log.txt; do
  flock "$log" true # until its run has ended
  run=${log%/log.txt}
  [ ! -e "$run/front.csv" ] || [ -e "$run/summary.json" ] || [ -e "$run/checkpoint.talus" ] ||
    fail "$run lost all it had done"
done
finished killed > "$folder/finished"
done=$(wc -l < "$folder/finished")
[ "$done" -lt "$jobs" ] || fail "all jobs were finished before the sweep was killed"
(sweep killed)
not_run_again killed
same_results killed

(sweep array --write-jobs "$folder/jobs.sh") > "$folder/jobs.log"
grep -q -x "#SBATCH --array=1-$jobs" "$folder/jobs.sh" || fail "the script has not $jobs jobs"
seq "$jobs" | xargs -P 2 -n 1 sh "$folder/jobs.sh"
if sh "$folder/jobs.sh" $((jobs + 1)) 2> "$folder/jobs.log"; then
  fail "the script ran a job that is none"
fi
finished array > "$folder/finished"
[ "$(wc -l < "$folder/finished")" -eq "$jobs" ] || fail "the script's jobs did not finish"
(sweep array)
not_run_again array
same_results array
echo "$jobs jobs, killed twice (seed $seed) when $done were finished, and as an array: the same results"
