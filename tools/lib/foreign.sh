#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# foreign.sh - prints the folder of a root with the libraries that heaved links, for another kind of processor, after fetching them once into
# the user's cache. apt fetches and verifies Debian's or Ubuntu's own packages with a configuration of its own; they are unpacked, not installed: the
# system learns of no other architecture and no rights are needed. The compilers come from ordinary packages, see tools/test.
#
# usage: foreign.sh ARCHITECTURE      as Debian names it: arm64, armhf, s390x
# Exit status: 0 and the path; 1 and one line on stderr that says why there is none.
set -u

arch=${1:?usage: foreign.sh ARCHITECTURE}
packages=(libinih-dev libinih1 libcjson-dev libcjson1 libmnl-dev libmnl0 libmodbus-dev libmodbus5 libgpiod-dev libgpiod2)
cache=${XDG_CACHE_HOME:-$HOME/.cache}/heave
release=$(sed -n 's/^VERSION_CODENAME=//p' /etc/os-release 2>/dev/null)
wanted=$(sha256sum <<<"${packages[*]}" | cut -c 1-8) # a change of the list makes another root
root=$cache/foreign-${release:-unknown}-$arch-$wanted

say() { printf 'foreign: %s\n' "$*" >&2; }

# The machine's package sources without what ties them to its own processor. Ubuntu keeps other processors on a server of their own.
copy_sources() { # TARGET
    local file
    for file in /etc/apt/sources.list /etc/apt/sources.list.d/*.list /etc/apt/sources.list.d/*.sources; do
        [ -r "$file" ] || continue
        sed -E '/^Architectures:/Id; s/\barch=[^] ]+ ?//; s#//[a-z.]*(archive|security)\.ubuntu\.com/ubuntu\b#//ports.ubuntu.com/ubuntu-ports#' "$file" >"$1/${file##*/}"
    done
}

fetch() { # WORK
    mkdir -p "$1/sources" "$1/state/lists/partial" "$1/cache/archives/partial" "$1/get" "$1/root" && : >"$1/status"
    copy_sources "$1/sources"
    local options=(-q -o Dir::Etc::SourceList=/dev/null -o Dir::Etc::SourceParts="$1/sources" -o Dir::State="$1/state" -o Dir::State::status="$1/status"
        -o Dir::Cache="$1/cache" -o Acquire::Languages=none -o Acquire::Retries=2 -o APT::Architecture="$arch" -o APT::Architectures="$arch")
    # A foreign repository without this processor makes the update fail; only the packages count.
    (cd "$1/get" && { apt-get "${options[@]}" update; apt-get "${options[@]}" download "${packages[@]}"; }) >"$1/log" 2>&1 || return 1
    local deb
    for deb in "$1"/get/*.deb; do dpkg-deb -x "$deb" "$1/root" || return 1; done
}

[ -d "$root" ] && echo "$root" && exit 0
command -v apt-get >/dev/null || { say "there is no apt-get here to fetch libraries for $arch with"; exit 1; }
work=$(mktemp -d) && chmod 755 "$work" && mkdir -p "$cache" || exit 1
trap 'rm -rf "$work"' EXIT
say "fetching libraries for $arch into $cache"
fetch "$work" || { say "libraries for $arch cannot be fetched ($(grep -m 1 -E '^E:|Failed to fetch' "$work/log"))"; exit 1; }
mv -T "$work/root" "$root.$$" && { mv -T "$root.$$" "$root" 2>/dev/null || rm -rf "$root.$$"; }
[ -d "$root" ] && echo "$root"
