#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# nginx.sh - prints the path of an nginx for tests: the one that is installed, else Debian's, unpacked into the user's cache once. Nothing is installed, as an installed
# one would serve on port 80 from then on. apt checks what it fetches by the signed lists of its sources.
#
# usage: nginx.sh [--cached]     --cached: only looks, fetches nothing
# Exit status: 0 and the path; 1 and one line on stderr that says why there is none.
set -u
cache=${XDG_CACHE_HOME:-$HOME/.cache}/heave
folder=$cache/nginx

say() { printf 'nginx: %s\n' "$*" >&2; }

# Debian 12 has it in nginx, Ubuntu 22.04 in nginx-core.
fetch() { # WORK
    local package
    for package in nginx nginx-core; do
        [ -x "$1/root/usr/sbin/nginx" ] || { (cd "$1" && apt-get -q download "$package") && dpkg -x "$1/${package}"_*.deb "$1/root"; }
    done
    [ -x "$1/root/usr/sbin/nginx" ] && "$1/root/usr/sbin/nginx" -v && mv -T "$1/root" "$folder"
}

main() {
    local work log
    command -v nginx && return 0
    if [ ! -x "$folder/usr/sbin/nginx" ]; then
        [ "${1:-}" != --cached ] || { say "none is installed, and there is no $folder yet: tools/test makes it" && return 1; }
        mkdir -p "$cache" && work=$(mktemp -d "$cache/.nginx.XXXXXX") || return 1
        log=$(fetch "$work" 2>&1 </dev/null)
        rm -rf "$work"
        [ -d "$folder" ] || { say "it could not be fetched: $(tail -n 1 <<<"$log")" && return 1; }
    fi
    echo "$folder/usr/sbin/nginx"
}

main "$@"
