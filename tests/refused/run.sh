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
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
message=$folder/message
status=0
complain() { echo "FAILED  $*"; cat "$message"; status=1; }

for compiler; do
  with() { # with OPTIONS...: the compiler
    "$compiler" -std=c++20 "$@" -I "$here/../../include" -isystem "${EIGEN3_INCLUDE_DIR:-/usr/include/eigen3}"
  }
  # Without flags of its own a program finds what all include compiled before.
  compile() {
    flags=$(sed -n 's,^// flags: ,,p' "$1")
    # shellcheck disable=SC2086 # several flags
    with ${flags:--include "$before"} -fsyntax-only "$1" > "$message" 2>&1
  }
  before=$folder/$(basename "$compiler").hpp
  echo '#include <talus/talus.hpp>' > "$before"
  case $compiler in *clang*) compiled=$before.pch ;; *) compiled=$before.gch ;; esac
  with -x c++-header "$before" -o "$compiled"
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
