#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# venv.sh - prints the path of a Python that has the packages of requirements.txt, after putting them into the user's cache once. The system's
# own Python stays as it is.
#
# usage: venv.sh [--cached]     --cached: only looks, installs nothing
# Exit status: 0 and the path; 1 and one line on stderr that says why there is none.
set -u
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cache=${XDG_CACHE_HOME:-$HOME/.cache}/heave

say() { printf 'venv: %s\n' "$*" >&2; }

# The name says what is in it, so that a change of either makes another one.
recipe_hash() { { cat "$here/requirements.txt" && python3 --version && python3 -c 'import sys; print(sys.prefix)'; } | sha256sum | cut -c 1-12; }

main() {
    local venv
    venv=$cache/python-$(recipe_hash)
    [ ! -f "$venv/complete" ] || { echo "$venv/bin/python3" && return 0; }
    [ "${1:-}" != --cached ] || { say "no $venv yet: tools/test makes it" && return 1; }
    mkdir -p "$cache" || return 1
    exec 9>"$cache/.python.lock" && flock 9
    [ ! -f "$venv/complete" ] || { echo "$venv/bin/python3" && return 0; }
    log=$(mktemp) || return 1
    trap 'rm -f "$log"' EXIT
    if python3 -m venv --clear "$venv" >"$log" 2>&1 && "$venv/bin/pip" -q --disable-pip-version-check install --require-hashes --only-binary :all: -r "$here/requirements.txt" >>"$log" 2>&1; then
        : >"$venv/complete"
        echo "$venv/bin/python3"
        return 0
    fi
    rm -rf "$venv"
    say "the Python packages for the CAN and Modbus tests could not be installed: $(grep -m 1 -iE 'error' "$log" || tail -n 1 "$log")"
    return 1
}

main "$@"
