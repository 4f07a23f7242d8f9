#!/bin/sh
# SPDX-License-Identifier: MIT
# Makes the API's documentation, build/api/html/index.html; fails if Doxygen warns of anything.
# Installs Doxygen where it is missing (apt-get, as root).
#
#     sh docs/build.sh
set -eu

root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
cd "$root"
if ! command -v doxygen > /dev/null; then
  if [ "$(id -u)" != 0 ] || ! command -v apt-get > /dev/null; then
    echo "missing, please install: doxygen" >&2
    exit 1
  fi
  apt-get update -q >&2
  DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends doxygen >&2
fi
TALUS_VERSION=$(sed -n 's/.*TALUS_VERSION "\(.*\)".*/\1/p' include/talus/version.hpp)
TALUS_DOCS_OUT=$root/build/api
export TALUS_VERSION TALUS_DOCS_OUT
mkdir -p "$TALUS_DOCS_OUT"
doxygen docs/Doxyfile
if [ -s "$TALUS_DOCS_OUT/warnings" ]; then
  cat "$TALUS_DOCS_OUT/warnings"
  echo "Doxygen warns of $(wc -l < "$TALUS_DOCS_OUT/warnings") things" >&2
  exit 1
fi
echo "$TALUS_DOCS_OUT/html/index.html"
