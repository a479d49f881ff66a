#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# gpiod2.sh - prints the folder that holds the sources of libgpiod 2 (include/, lib/) for tests on systems whose own libgpiod is 1.x, after
# fetching them into the user's cache once. Its Python bindings on PyPI carry them whole; pip only unpacks them, nothing is installed.
#
# usage: gpiod2.sh [--cached]     --cached: only looks, fetches nothing
# Exit status: 0 and the path; 1 and one line on stderr that says why there is none.
set -u
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cache=${XDG_CACHE_HOME:-$HOME/.cache}/heave
version=2.2.1
sha256=802dad3a89016339a231c462c6da2d56c820f5fb11519728ff86cdff0a16da96
folder=$cache/libgpiod-$version

say() { printf 'gpiod2: %s\n' "$*" >&2; }

fetch() { # WORK
    local python
    python=$("$here/venv.sh" --cached) || return 1
    "$python" -m pip -q --disable-pip-version-check download --no-deps --no-binary :all: --dest "$1" "gpiod==$version" &&
        echo "$sha256  $1/gpiod-$version.tar.gz" | sha256sum --check --quiet - && tar -C "$1" -xf "$1/gpiod-$version.tar.gz" &&
        mv -T "$1/gpiod-$version" "$folder"
}

main() {
    local work log
    [ ! -d "$folder" ] || { echo "$folder" && return 0; }
    [ "${1:-}" != --cached ] || { say "no $folder yet: tools/test makes it" && return 1; }
    mkdir -p "$cache" && work=$(mktemp -d "$cache/.gpiod2.XXXXXX") || return 1
    log=$(fetch "$work" 2>&1 </dev/null)
    rm -rf "$work"
    [ -d "$folder" ] || { say "the sources of libgpiod 2 could not be fetched: $(tail -n 1 <<<"$log")" && return 1; }
    echo "$folder"
}

main "$@"
