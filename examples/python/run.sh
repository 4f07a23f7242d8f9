#!/bin/sh
# SPDX-License-Identifier: MIT
# Builds the Python module my_talus and runs a script with it:
#
#     sh examples/python/run.sh                        b00.py: its picture is out/python/B00.png
#     sh examples/python/run.sh SCRIPT [ARGUMENTS...]  a script of your own, in the folder where you are
#     sh examples/python/run.sh --test [FOLDER]        the tests; FOLDER: a run of `collapse` to read, too
#
# Installs what is missing (see ../setup.sh). CXX and CXXFLAGS count.
set -eu

here=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)
root=$(dirname -- "$(dirname -- "$here")")
build=$root/build/python
python=$(sh "$root/examples/setup.sh" python) # prints the Python that has numpy

# The module is built anew when a source is newer, or for another Python, compiler or processor.
ask() { "$python" -c "import sysconfig; print(sysconfig.$1)"; }
module=$build/my_talus$(ask "get_config_var('EXT_SUFFIX')")
compiler=${CXX:-c++}
flags="-std=c++20 -O3 -fvisibility=hidden -shared -fPIC -pthread -isystem $(ask "get_path('include')")"
for prefix in /usr /usr/local /opt/homebrew /opt/local ${CONDA_PREFIX:-}; do
  [ ! -d "$prefix/include/eigen3" ] || flags="$flags -isystem $prefix/include/eigen3"
  [ "$prefix" = /usr ] || [ ! -d "$prefix/include" ] || flags="$flags -isystem $prefix/include"
done
if echo 'int main() {}' | $compiler -march=native -x c++ -c -o /dev/null - 2> /dev/null; then
  flags="$flags -march=native"
fi
[ "$(uname)" != Darwin ] || flags="$flags -undefined dynamic_lookup"
processor=$(grep -m 1 -E '^(flags|Features)' /proc/cpuinfo 2> /dev/null | cksum)
command="$compiler $flags ${CXXFLAGS:-} # $processor"
mkdir -p "$build"
if [ ! -f "$module" ] || [ "$command" != "$(cat "$build/command" 2> /dev/null)" ] ||
  [ -n "$(find "$root/include" "$here" -name '*.[ch]pp' -newer "$module")" ]; then
  echo "building $module, about a minute" >&2
  # shellcheck disable=SC2086 # several words
  $compiler $flags ${CXXFLAGS:-} -I "$root/include" "$here/my_talus.cpp" -o "$module.tmp"
  mv "$module.tmp" "$module"
  printf '%s' "$command" > "$build/command"
fi
export PYTHONPATH="$build:$here${PYTHONPATH:+:$PYTHONPATH}"

case ${1:-} in
  '')
    mkdir -p "$root/out/python"
    cd "$root/out/python"
    "$python" "$here/b00.py"
    echo "$root/out/python/B00.png"
    ;;
  -h | --help) sed -n 's/^# \{0,1\}//p' "$0" | sed 1d ;;
  --test)
    "$python" -W error "$here/test_my_talus.py" ${2:+"$2"}
    "$python" -W error "$here/test_talus_results.py" ${2:+"$2"}
    ;;
  *) exec "$python" "$@" ;;
esac
