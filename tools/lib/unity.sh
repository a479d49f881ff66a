#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# unity.sh - prints the folder that holds unity.c (the test framework), after fetching it into the user's cache if it is nowhere yet.
# Unity is no package of Debian or Ubuntu, but their source package cjson carries it: apt fetches and verifies that with source lists of its
# own, derived from the machine's, so the system stays as it is and no rights are needed. Where that fails: upstream, pinned to a commit.
#
# Order: $UNITY_DIR, ${XDG_CACHE_HOME:-~/.cache}/heave/unity-*, the source package, upstream.
set -u

upstream=https://github.com/ThrowTheSwitch/Unity.git
upstream_version=2.6.1
upstream_commit=cbcd08fa7de711053a3deec6339ee89cad5d2697
cache=${XDG_CACHE_HOME:-$HOME/.cache}/heave

say() { printf 'unity: %s\n' "$*" >&2; }

# Prints those of the machine's package sources that can have the source package, as source entries; stanza format.
deb822_sources() { # FILE...
    awk 'BEGIN { RS = ""; FS = "\n" }
        {
            types = ""; off = 0; out = ""; main = 0
            for (i = 1; i <= NF; i++) {
                line = $i; key = tolower(line); sub(/:.*/, "", key)
                if (line ~ /^#/) continue
                if (key == "types") { types = line; line = "Types: deb-src" }
                if (key == "enabled" && tolower(line) ~ /: *no/) off = 1
                if (key == "components" && line ~ /[ :](main|universe)( |$)/) main = 1
                out = out line "\n"
            }
            if (!off && main && types ~ /[ :]deb( |$)/) print out
        }' "$@"
}

# The same for the one-line format.
one_line_sources() { # FILE...
    sed -nE '/cdrom:/d; s/#.*//; /[[:space:]](main|universe)([[:space:]]|$)/s/^[[:space:]]*deb([[:space:]])/deb-src\1/p' "$@"
}

copy_sources() { # TARGET - apt wants one format per file
    local etc=/etc/apt file
    for file in "$etc"/sources.list.d/*.sources; do
        [ -r "$file" ] && { deb822_sources "$file"; echo; }
    done >"$1/machine.sources"
    for file in "$etc"/sources.list "$etc"/sources.list.d/*.list; do
        [ -r "$file" ] && one_line_sources "$file"
    done >"$1/machine.list"
}

# Moves the three files of Unity to the cache in one step, so that a second run never sees half of them.
keep() { # FOLDER NAME
    local half=$cache/.$2.$$
    mkdir -p "$half" && cp "$1/unity.c" "$1/unity.h" "$1/unity_internals.h" "$half/" || return 1
    # The copy in cjson asks for a settings file outside the folder; ours come from cmake/unity.cmake.
    sed -i '/#include "..\/examples\/unity_config.h"/d' "$half/unity_internals.h"
    mv -T "$half" "$cache/$2" 2>/dev/null || rm -rf "$half"
    [ -f "$cache/$2/unity.c" ]
}

from_source_package() { # WORK
    command -v apt-get >/dev/null || return 1
    mkdir -p "$1/sources" "$1/state/lists/partial" "$1/cache/archives/partial" "$1/get"
    copy_sources "$1/sources"
    local options=(-q -o Dir::Etc::SourceList=/dev/null -o Dir::Etc::SourceParts="$1/sources" -o Dir::State="$1/state"
        -o Dir::State::status=/var/lib/dpkg/status -o Dir::Cache="$1/cache" -o Acquire::Languages=none)
    # A foreign repository without sources makes the update fail; only the package counts.
    (cd "$1/get" && { apt-get "${options[@]}" update; apt-get "${options[@]}" source --download-only --tar-only cjson; }) >"$1/log" 2>&1
    local tarball
    tarball=$(compgen -G "$1/get/cjson_*.orig.tar.*") || return 1
    tar -C "$1/get" -xf "$tarball" --strip-components=1 --wildcards '*/tests/unity/src/unity*.[ch]' || return 1
    tarball=${tarball##*/}
    keep "$1/get/tests/unity/src" "unity-${tarball%.orig.tar.*}"
}

from_upstream() { # WORK
    command -v git >/dev/null || return 1
    (git init -q "$1/git" && cd "$1/git" && git fetch -q --depth 1 "$upstream" "$upstream_commit" && git checkout -q FETCH_HEAD) >>"$1/log" 2>&1 &&
        keep "$1/git/src" "unity-$upstream_version"
}

main() {
    local found
    for found in "${UNITY_DIR:-}" "$cache"/unity-*; do
        [ -f "$found/unity.c" ] && echo "$found" && return 0
    done
    work=$(mktemp -d) && chmod 755 "$work" && mkdir -p "$cache" || return 1
    trap 'rm -rf "$work"' EXIT
    say "fetching Unity into $cache"
    if from_source_package "$work" || from_upstream "$work"; then
        for found in "$cache"/unity-*; do echo "$found" && return 0; done
    fi
    say "not found: neither the source package cjson nor $upstream could be fetched ($(grep -m 1 -E 'Failed to fetch|^E:|^fatal:' "$work/log")); set UNITY_DIR to a folder with unity.c"
    return 1
}

main
