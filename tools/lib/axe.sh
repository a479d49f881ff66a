#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# axe.sh - prints the path of axe.min.js (axe-core) after putting it into the user's cache once, by the lock file in tests/browser.
#
# usage: axe.sh [--cached]     --cached: only looks, installs nothing
# Exit status: 0 and the path; 1 and one line on stderr that says why there is none.
set -u
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
recipe=$here/../../tests/browser
cache=${XDG_CACHE_HOME:-$HOME/.cache}/heave

say() { printf 'axe: %s\n' "$*" >&2; }

main() {
    local place
    place=$cache/axe-$(sha256sum <"$recipe/package-lock.json" | cut -c 1-12)
    [ ! -f "$place/complete" ] || { echo "$place/node_modules/axe-core/axe.min.js" && return 0; }
    [ "${1:-}" != --cached ] || { say "no $place yet: tools/test makes it" && return 1; }
    command -v npm >/dev/null || { say "npm is not there" && return 1; }
    mkdir -p "$place" || return 1
    exec 9>"$cache/.axe.lock" && flock 9
    cp "$recipe/package.json" "$recipe/package-lock.json" "$place/" || return 1
    if (cd "$place" && npm ci --ignore-scripts --no-audit --no-fund >"$place/log" 2>&1) && [ -f "$place/node_modules/axe-core/axe.min.js" ]; then
        : >"$place/complete"
        echo "$place/node_modules/axe-core/axe.min.js"
        return 0
    fi
    say "axe-core could not be installed: $(grep -m 1 -i error "$place/log")"
    return 1
}

main "$@"
