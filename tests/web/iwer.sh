#!/usr/bin/env bash
# An emulated headset for the tests of pages: iwer (MIT), for the tests alone.
#
#   tests/web/iwer.sh [DEST]     DEST: where it is kept; fetched once, found again afterwards
#
# Prints the path of its script.  Where it cannot be had: one sentence on stderr, exit code 3.
set -euo pipefail
dest=${1:-${XDG_CACHE_HOME:-$HOME/.cache}/shapeshift/iwer}
script=$dest/node_modules/iwer/build/iwer.min.js

cannot() {
    echo "no emulated headset for the tests: $1" >&2
    exit 3
}

if [ ! -f "$script" ]; then
    command -v npm >/dev/null || cannot "npm is not installed."
    npm install --prefix "$dest" --silent --no-fund --no-audit --ignore-scripts iwer@2.5.0 >/dev/null 2>&1 ||
        cannot "npm could not fetch iwer."
fi
[ -f "$script" ] || cannot "iwer has no $script."
echo "$script"
