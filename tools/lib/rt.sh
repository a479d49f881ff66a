#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# rt.sh - prints the folder of a PREEMPT_RT kernel for system tests in an emulated machine, after fetching it once into the user's cache:
# vmlinux, the modules that CAN on a serial line takes, and their sums. It is Debian's own, from the package that linux-image-rt-amd64
# points to; nothing is installed.
#
# usage: rt.sh [--cached]     --cached: only looks, fetches nothing
# Exit status: 0 and the path; 1 and one line on stderr that says why there is none.
set -u
cache=${XDG_CACHE_HOME:-$HOME/.cache}/heave
fetch_limit_s=600
form=1 # of what is in the folder: another number makes another folder

say() { printf 'rt: %s\n' "$*" >&2; }

is_whole() { (cd "$1" && sha256sum --check --status --strict sums) 2>/dev/null; }

find_cached() {
    local found
    for found in "$cache"/rt-*-"$form"; do
        is_whole "$found" && echo "$found" && return 0
    done
    return 1
}

versioned_package() { apt-cache depends linux-image-rt-amd64 2>/dev/null | sed -n 's/^ *Depends: \(linux-image-[^ ]*-rt-amd64\)$/\1/p' | head -n 1; }

download() {
    local package
    package=$(versioned_package)
    [ -n "$package" ] || { echo "E: apt knows no package linux-image-rt-amd64" && return 1; }
    timeout "$fetch_limit_s" apt-get -q -o Acquire::Retries=2 download "$package"
}

# Where the machine's lists are older than the mirror, they are brought up to date; that takes root.
fetch() { # WORK
    cd "$1" && { download || { [ "$(id -u)" = 0 ] && timeout "$fetch_limit_s" apt-get -q update && download; }; }
}

unpack() { # WORK
    local deb
    deb=$(compgen -G "$1/linux-image-*.deb") && mkdir "$1/root" || return 1
    dpkg-deb --fsys-tarfile "$deb" | tar -C "$1/root" -x --wildcards './boot/vmlinuz-*' '*/net/can/dev/can-dev.ko*' '*/net/can/slcan/slcan.ko*' \
        '*/net/can/can.ko*' '*/net/can/can-raw.ko*'
}

# The kernel without its compression, which an emulated machine takes seconds to undo. Where it is: Documentation/x86/boot.rst.
bare_kernel() { # VMLINUZ VMLINUX
    local sectors offset length
    sectors=$(od -An -tu1 -j 497 -N 1 "$1") && offset=$(od -An -tu4 -j 584 -N 4 "$1") && length=$(od -An -tu4 -j 588 -N 4 "$1") || return 1
    tail -c "+$(((sectors + 1) * 512 + offset + 1))" "$1" | head -c "$((length))" | xz -dc --single-stream >"$2"
}

# All or nothing: what was broken off leaves no folder.
keep() { # WORK
    local vmlinuz new
    vmlinuz=$(compgen -G "$1/root/boot/vmlinuz-*") && new=$1/new && mkdir "$new" || return 1
    bare_kernel "$vmlinuz" "$new/vmlinux" || return 1
    find "$1/root" -name '*.ko' -exec cp {} "$new" \;
    (cd "$new" && sha256sum vmlinux can-dev.ko can.ko can-raw.ko slcan.ko >sums) || return 1
    rm -rf "$cache"/rt-*-"$form" && mv "$new" "$cache/rt-${vmlinuz##*/vmlinuz-}-$form"
}

lacking_tools() {
    local tool
    for tool in apt-get dpkg-deb xz; do command -v "$tool" >/dev/null || printf ' %s' "$tool"; done
}

main() {
    local lacking
    find_cached && return 0
    [ "${1:-}" != --cached ] || { say "no whole PREEMPT_RT kernel in $cache: tools/nightly --only rt fetches one" && return 1; }
    [ "$(uname -m)" = x86_64 ] || { say "only for x86_64 machines" && return 1; }
    lacking=$(lacking_tools)
    [ -z "$lacking" ] || { say "fetching the PREEMPT_RT kernel takes these, which are not here:$lacking" && return 1; }
    mkdir -p "$cache" || return 1
    exec 9>"$cache/.rt.lock" && flock 9 # a second run waits and finds the kernel
    find_cached && return 0
    work=$(mktemp -d "$cache/.rt.XXXXXX") && trap 'rm -rf "$work"' EXIT || return 1
    say "fetching Debian's PREEMPT_RT kernel into $cache, once: 70 MB"
    if ! (fetch "$work" && unpack "$work" && keep "$work") >"$work/log" 2>&1; then
        say "the PREEMPT_RT kernel is not to be had: $(grep -m 1 -E '^E:|rror' "$work/log" || tail -n 1 "$work/log")"
        return 1
    fi
    find_cached
}

main "$@"
