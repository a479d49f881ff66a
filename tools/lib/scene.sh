#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# scene.sh - bundles panel/scene/scene.js with three.js into one file for heave-panel. The libraries come by the lock file beside it (`npm ci`), once, into the user's cache. The same sources give
# the same bytes.
#
# usage: scene.sh OUT [--need]     OUT: the file; there is none afterwards where it cannot be made, and pages show a flat picture then
#                                  --need: that is a failure
# Exit status: 0 and the file, or without --need one line on stderr that says why there is none; 1 otherwise.
set -u
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
recipe=$here/../../panel/scene
cache=${XDG_CACHE_HOME:-$HOME/.cache}/heave

give_up() {
    printf 'heave-panel: no 3D, a flat picture instead: %s\n' "$*" >&2
    rm -f "$out"
    [ "$need" = no ] || exit 1
    exit 0
}

reason() { grep -m 1 -iE 'error|not found' "$1" | cut -c 1-200; }

out=${1:?usage: scene.sh OUT [--need]}
need=no
[ "${2:-}" != --need ] || need=yes
command -v node >/dev/null && command -v npm >/dev/null || give_up "it takes node and npm (Debian: apt-get install npm)"
place=$cache/scene-$(sha256sum <"$recipe/package-lock.json" | cut -c 1-12)
mkdir -p "$place" || give_up "$place cannot be made"
exec 9>"$cache/.scene.lock" && flock 9
if [ ! -f "$place/complete" ]; then
    cp "$recipe/package.json" "$recipe/package-lock.json" "$place/"
    (cd "$place" && npm ci --ignore-scripts --no-audit --no-fund >"$place/log" 2>&1) || give_up "npm ci failed ($(reason "$place/log")); see $place/log"
    : >"$place/complete"
fi
# From the folder of the source, so that nothing in the file tells where it was made.
made=$(mktemp "$out.XXXXXX") || exit 1
trap 'rm -f "$made"' EXIT
if ! (cd "$recipe" && NODE_PATH=$place/node_modules node "$place/node_modules/esbuild/bin/esbuild" scene.js --bundle --format=esm --target=es2020 --minify --legal-comments=inline --charset=utf8 \
    --external:./limits.js --external:./space.js --log-level=warning) >"$made" 2>"$place/log"; then
    give_up "esbuild failed ($(reason "$place/log")); see $place/log"
fi
chmod 644 "$made" && mv "$made" "$out"
