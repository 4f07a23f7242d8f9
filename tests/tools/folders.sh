#!/bin/sh
# SPDX-License-Identifier: MIT
# What is in a folder is never taken for what was asked for, nor written by two programs at once:
# trials, other resolutions, second programs, closed terminals, array jobs started from elsewhere. And
# a run that still moves has no rest time.
#
#     folders.sh PROGRAMS FOLDER
#
# PROGRAMS: the folder with avalanche, collapse and rheology_comparison.
set -eu
programs=$(cd "$1" && pwd)
rm -rf "$2"
mkdir -p "$2"
cd "$2"
folder=$(pwd)
options='--dim 2 --cell 0.02 0.02 0.01 --threads 1 --vtk none --no-plot'
# shellcheck disable=SC2086 # several words
collapse() {
  "$programs/collapse" $options --quiet "$@"
}
# shellcheck disable=SC2086
started() { # started FOLDER [OPTIONS...]: begins a run, whose number is $process, and waits until it has begun
  (exec "$programs/collapse" $options --quiet --out "$@") &
  process=$!
  until [ "$(cat "$1/.lock" 2> /dev/null)" = $process ]; do sleep 0.05; done
  sleep 0.2
}
fail() { echo "$*"; exit 1; }
refused() { # refused WORDS COMMAND...: it ends with status 2 and a message with the words
  words=$1 status=0
  shift
  "$@" > log 2>&1 || status=$?
  [ $status -eq 2 ] || fail "status $status instead of 2: $*: $(cat log)"
  grep -q -e "$words" log || fail "$*: not \"$words\" but: $(cat log)"
}
measured() { sed -n "s/^ *\"$2\": \([^,]*\),*/\1/p" "$1/summary.json" | head -n 1; }

# A finished run is what was asked for only if all inputs are the same.
collapse --end-time 0.05 --out trial
before=$(stat -c %i trial/summary.json)
for number in 5e-2 .05; do # however it is written
  collapse --end-time $number --out trial --resume
done
[ "$(stat -c %i trial/summary.json)" = "$before" ] || fail "a finished run was run again"
refused '--end-time = 0.05, not null' collapse --out trial --resume
refused '--end-time = 0.05, not 0.1' collapse --end-time 0.1 --out trial
refused '--seed = 1.0, not 2.0' collapse --end-time 0.05 --seed 2 --out trial
collapse --end-time 0.05 --seeding jittered --packing-surfaces true --out trial --resume # as without
[ "$(stat -c %i trial/summary.json)" = "$before" ] || fail "a default that is given counts as another input"
refused '--snapshot-interval' collapse --end-time 0.05 --snapshot-interval 0.01 --out trial --resume
[ "$(stat -c %i trial/summary.json)" = "$before" ] || fail "a finished run was replaced unasked"
collapse --end-time 0.1 --out trial --overwrite
[ "$(measured trial rest_time_s)" = null ] || fail "a run that moves has a rest time"
# shellcheck disable=SC2086
"$programs/collapse" $options --end-time 0.1 --out trial |
  grep -q 'it still moves' || fail "it was not said that the run still moves"

# A summary that is no result of a run that ended is none.
sed -i 's/"status": "completed"/"status": "interrupted"/' trial/summary.json
collapse --end-time 0.1 --out trial --resume
grep -q '"status": "completed"' trial/summary.json || fail "an interrupted run was taken for a finished one"
sed -i 's/"status": "completed"/"status": "failed: for this test"/' trial/summary.json
status=0
collapse --end-time 0.1 --out trial --resume 2> log || status=$?
[ $status -eq 1 ] || fail "a failed run was taken for a finished one"

# What fails in its first step ends with status 1 and the reason, and leaves no summary.
status=0
"$programs/collapse" --dim 2 --friction 1e200 --quiet --no-plot --out fails 2> log || status=$?
[ $status -eq 1 ] || fail "a first step that fails: status $status: $(cat log)"
grep -q 'the first step failed: the solver met numbers' log || fail "a first step that fails: $(cat log)"
[ ! -e fails/summary.json ] || fail "a summary of a run without a step"

# The tables show the same fields at the same time.
last() { tail -n 1 "$1" | cut -d , -f 1; }
[ "$(last trial/front.csv)" = "$(last trial/profiles.csv)" ] || fail "front.csv and profiles.csv differ in time"
[ "$(last trial/sections.csv)" = "$(last trial/profiles.csv)" ] || fail "sections.csv and profiles.csv differ in time"

# Steps that are shortened (cfl) do not shorten the run, and an earlier run leaves no frames.
collapse --time-step 0.02 --cfl 0.02 --sample-interval 0.005 --end-time 0.3 --out short
measured short end_time_s | awk '{ exit !($1 > 0.297) }' || fail "ended at $(measured short end_time_s) instead of 0.3 s"
"$programs/collapse" --dim 2 --cell 0.02 0.02 0.01 --quiet --no-plot --end-time 0.1 --vtk all \
  --snapshot-interval 0.02 --out frames
"$programs/collapse" --dim 2 --cell 0.02 0.02 0.01 --quiet --no-plot --end-time 0.1 --vtk last --out frames --overwrite
[ "$(find frames/vtk -type f | wc -l)" -eq 2 ] || fail "frames of an earlier run: $(ls frames/vtk)"
interrupted='--dim 2 --cell 0.02 0.02 0.01 --threads 1 --quiet --no-plot --vtk last --end-time 1 --out interrupted'
# shellcheck disable=SC2086
(exec "$programs/collapse" $interrupted) &
process=$!
until [ -s interrupted/sections.csv ]; do sleep 0.05; done
kill -TERM $process
wait $process && fail "the run ended before it was interrupted"
# shellcheck disable=SC2086
"$programs/collapse" $interrupted --resume
[ "$(find interrupted/vtk -type f | wc -l)" -eq 2 ] || fail "the frame of an interruption: $(ls interrupted/vtk)"

# A column that leans on the upstream wall is not at rest before its gate has left it, 0.3 m higher. The gate is smooth: a rough
# one takes grains along, and leaves the highest one later.
collapse --case B00 --inclination -75 --friction 0.5 --wall-friction 0.9 --gate-friction 0 --bed-depth 0 \
  --column-length 0.06 --column-height 0.3 --height 0.4 --length 0.3 --out leans
measured leans rest_time_s | awk '{ exit !($1 > 0.556 && $1 < 0.62) }' ||
  fail "rest time $(measured leans rest_time_s) s; the gate leaves the highest grain after 0.556 s"

# Two programs in one folder: the second is refused at once, and the first one's files are whole.
started both --end-time 3 # some seconds
kill -STOP $process # or it is done before the others have started on a busy machine
refused 'no other program writes to' collapse --case B00 --out both
refused 'no other program writes to' collapse --end-time 3 --out both --resume
refused 'no other program writes to' collapse --end-time 3 --out both --overwrite
refused "process $process" "$programs/rheology_comparison" --end-time 0.02 --out both
kill -CONT $process

# A terminal that is closed, and what batch systems send: the run saves, as with SIGTERM.
for signal in HUP XCPU USR1 USR2 TERM; do
  kill -$signal $process
  status=0
  wait $process || status=$?
  [ $status -eq 130 ] || fail "SIG$signal: status $status instead of 130"
  [ -e both/checkpoint.talus ] || fail "SIG$signal: no checkpoint"
  started both --end-time 3 --resume
done
wait $process
awk -F , 'NR == 1 { n = NF } NR > 1 && ($1 + 0 < t || NF != n) { bad++ } { t = $1 + 0 } END { exit bad > 0 }' both/front.csv ||
  fail "front.csv is torn"
trap '' HUP # as nohup does
started nohup --end-time 1
trap - HUP
kill -HUP $process
wait $process || fail "SIGHUP ended a run that was to ignore it"

# A study takes no trial for the answer, whether the trial is finished or not.
study() { "$programs/rheology_comparison" --quiet --no-plot "$@"; }
study --end-time 0.02 --out study
grep -q '"still_moves": true' study/summary.json || fail "the study does not say that its runs still move"
awk -F , 'NR > 1 && $4 != "nan" { bad++ } END { exit NR < 2 || bad > 0 }' study/rheology_comparison.csv ||
  fail "a run that moves has a rest time in the study's table: $(cat study/rheology_comparison.csv)"
refused '--end-time = 0.02, not null' study --out study
rm study/summary.json
refused '--end-time = 0.02, not 0.03' study --end-time 0.03 --out study
study --end-time 0.03 --out study --overwrite
grep -q '"end-time": 0.03' study/runs/stop/summary.json || fail "--overwrite did not replace the runs"

# What a study is asked for its runs do: a movie each.
study --movie --end-time 0.02 --out movies --write-jobs movies.sh > log
[ "$(grep -c -e ' --movie ' movies.sh)" -eq 4 ] || fail "--movie does not reach the runs: $(cat movies.sh)"

# Tilts go up to --to, and not beyond. No step is so small that their number is none.
"$programs/avalanche" --from 20 --to 21 --step 0.6 --particles-per-edge 1 --quiet --no-plot --vtk none --out up_to
[ "$(tail -n 1 up_to/angles.csv | cut -d , -f 1)" = 20.6 ] || fail "tilts up to 21 degrees: $(cat up_to/angles.csv)"
refused '--step is 1e-09' "$programs/avalanche" --step 1e-9 --out no_tilts

# An avalanche that is interrupted goes on with its tilts.
tilting='--particles-per-edge 1 --from 23 --to 23.5 --quiet --no-plot --threads 1'
# shellcheck disable=SC2086
avalanche() { "$programs/avalanche" $tilting "$@"; }
avalanche --out tilts
# shellcheck disable=SC2086
(exec "$programs/avalanche" $tilting --out tilted) &
process=$!
until [ -s tilted/sections.csv ]; do sleep 0.05; done
sleep 1
kill -TERM $process
wait $process && fail "the avalanche ended before it was interrupted"
avalanche --out tilted --resume
[ "$(wc -l < tilted/angles.csv)" -eq 3 ] || fail "an avalanche of two tilts: $(cat tilted/angles.csv)"
for table in angles motion sections; do
  cmp tilts/$table.csv tilted/$table.csv || fail "$table.csv of an avalanche that was interrupted"
done

# An array job, written with a relative folder and run from elsewhere.
study --end-time 0.02 --out array --write-jobs jobs.sh --threads 3 --job-memory 5G > log
for line in '--time=24:00:00' '--mem=5G' "--output='$folder/array/runs/job_%a.log'" '--cpus-per-task=3' \
  '--signal=B:TERM@60'; do
  grep -q -x -e "#SBATCH $line" jobs.sh || fail "jobs.sh has no $line"
done
[ "$(grep -c -e '--threads 3 ' jobs.sh)" -eq 4 ] || fail "jobs.sh lost --threads 3"
jobs=$folder/jobs.sh
for job in 1 2 3 4; do (cd / && sh "$jobs" $job); done
before=$(stat -c '%i %y' array/runs/*/summary.json)
study --end-time 0.02 --out array
[ "$(stat -c '%i %y' array/runs/*/summary.json)" = "$before" ] || fail "gathering ran the jobs again"
echo "no folder was taken for another"
