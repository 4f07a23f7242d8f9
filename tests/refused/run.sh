#!/bin/sh
# SPDX-License-Identifier: MIT
# Programs that must not compile, and what the compiler must say of them, in few lines:
#
#     sh tests/refused/run.sh COMPILER...
#
# The regular expression after "// says:" in each program must match a line of the message, which may
# have 25 lines at most. "// flags:" gives further flags; the words must then be in the first error,
# whatever follows it. A program that includes the same and is right must compile: else any
# mistake elsewhere would pass for a refusal.
set -eu

[ $# -gt 0 ] || { sed -n '3,6s/^# \{0,1\}//p' "$0" >&2; exit 2; }
here=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)
message=$(mktemp)
trap 'rm -f "$message"' EXIT
status=0
complain() { echo "FAILED  $*"; cat "$message"; status=1; }

for compiler; do
  compile() {
    # shellcheck disable=SC2046 # several flags
    "$compiler" -std=c++20 $(sed -n 's,^// flags: ,,p' "$1") -fsyntax-only -I "$here/../../include" \
      -isystem "${EIGEN3_INCLUDE_DIR:-/usr/include/eigen3}" "$1" > "$message" 2>&1
  }
  compile "$here/../docs/first.cpp" || complain "$compiler: what is right does not compile"
  for program in "$here"/*.cpp; do
    name=$(basename "$program" .cpp)
    words=$(sed -n 's,^// says: ,,p' "$program")
    if compile "$program"; then
      complain "$compiler $name: compiles"
    elif grep -q '^// flags: ' "$program"; then
      if grep -m 1 ' error: ' "$message" | grep -Eq "$words"; then
        echo "ok  $compiler $name: the first error"
      else
        complain "$compiler $name: not in the first error: $words"
      fi
    elif ! grep -Eq "$words" "$message"; then
      complain "$compiler $name: not in the message: $words"
    elif [ "$(wc -l < "$message")" -gt 25 ]; then
      complain "$compiler $name: the message has more than 25 lines"
    else
      echo "ok  $compiler $name: $(wc -l < "$message") lines"
    fi
  done
done
exit $status
