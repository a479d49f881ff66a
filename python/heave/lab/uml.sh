#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# uml.sh - prints the path of a User Mode Linux kernel with SocketCAN (vcan, slcan) and simulated GPIO after building
# it once into the user's cache. It is an ordinary program of 7 MB that boots in half a second, for any user, on machines whose own kernel
# has no CAN; and it can run on virtual time, where sleeps are exact whatever else the machine does.
# Debian's own user-mode-linux package panics on CPUs with AMX, hence from the sources: a package linux-source, fetched by apt without
# installing it. Since Linux 6.16 a system call in such a kernel takes half the time, so the first choice is that of Debian's backports.
#
# usage: uml.sh [--cached]     --cached: only looks, builds nothing
# Exit status: 0 and the path; 1 and one line on stderr that says why there is none.
set -u
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cache=${XDG_CACHE_HOME:-$HOME/.cache}/heave
build_limit_s=3600
lists_limit_s=120
boot_limit_s=60

say() { printf 'heave-lab: %s\n' "$*" >&2; }

# The name says what the kernel is made from, so that a change of either makes another one.
recipe_hash() { { cat "$here/uml.config" && declare -f configure; } | sha256sum | cut -c 1-12; }

find_cached() {
    local found
    for found in "$cache"/uml-*-"$(recipe_hash)"; do
        [ -x "$found" ] && echo "$found" && return 0
    done
    return 1
}

# The newest linux-source of these lists: unpacked here only, so that it needs no rights.
fetch_newest() { # WORK APT-OPTION...
    local package deb
    package=$(apt-cache "${@:2}" pkgnames linux-source- | grep -xE 'linux-source-[0-9.]+' | sort -V | tail -n 1)
    [ -n "$package" ] || { echo "E: apt knows no package linux-source" >&2 && return 1; }
    (cd "$1" && apt-get -q "${@:2}" download "$package") || return 1
    deb=$(compgen -G "$1/linux-source-*.deb") || return 1
    dpkg-deb -x "$deb" "$1/deb" && rm "$deb"
}

# Where the machine has lists of Debian, their mirror.
mirror() {
    apt-get indextargets --format '$(REPO_URI)' 'Identifier: Packages' 'Origin: Debian' 'Label: Debian' 2>/dev/null | grep -m 1 '^http' ||
        echo http://deb.debian.org/debian
}

# Its lists are in the folder of work, so that those of the machine stay as they are. apt checks the signature.
fetch_backport() { # WORK
    local keys=/usr/share/keyrings/debian-archive-keyring.gpg apt=$1/apt
    local options=(-o "Dir::State=$apt" -o Dir::State::status=/dev/null -o "Dir::Cache=$apt" -o "Dir::Etc::SourceList=$apt/list" -o Dir::Etc::SourceParts=-
        -o Acquire::Languages=none -o Acquire::Retries=2)
    [ -e "$keys" ] && mkdir -p "$apt/lists/partial" && echo "deb [signed-by=$keys arch=amd64] $(mirror) stable-backports main" >"$apt/list" &&
        timeout "$lists_limit_s" apt-get -q "${options[@]}" update && fetch_newest "$1" "${options[@]}"
}

# Sources of devices that no UML has stay packed: they are half of the tree. Their Kconfig and Makefile are read.
unpack() { # WORK
    local tarball
    tarball=$(find "$1/deb/usr/src" -name 'linux-source-*.tar.*' -type f | head -n 1)
    mkdir "$1/linux" && tar -C "$1/linux" -xf "$tarball" --strip-components=1 --exclude='*/drivers/gpu/*.[ch]' --exclude='*/sound/*.[ch]' \
        --exclude='*/drivers/net/ethernet/*.[ch]' --exclude='*/drivers/net/wireless/*.[ch]' --exclude='*/drivers/media/*.[ch]' \
        --exclude='*/Documentation/*.rst' --exclude='*.dts' --exclude='*.dtsi' --exclude='*/tools/testing/*' && rm -r "$1/deb"
}

configure() {
    # CPUs with AMX have a floating-point state of 11 KiB; older kernels reserve 2696 bytes and panic. It also lives on the kernel's stack,
    # hence KERNEL_STACK_ORDER.
    sed -i 's/DEFINE_LONGS(HOST_FP_SIZE, 2696)/DEFINE_LONGS(HOST_FP_SIZE, 12288)/' arch/x86/um/user-offsets.c
    # All interrupts are UML's own, so that simulated GPIO lines would have none for their edges. A few more: tests use them up.
    sed -i 's/define NR_IRQS\t\t\tUM_LAST_SIGNAL_IRQ$/define NR_IRQS (UM_LAST_SIGNAL_IRQ + 8)/' arch/um/include/asm/irq.h
    make ARCH=um KCONFIG_ALLCONFIG="$here/uml.config" allnoconfig
}

# What was asked for and is not there would fail much later and far from here. (gpio-sim came with Linux 5.17; tests of it skip without.)
check_config() {
    local wanted missing=''
    for wanted in UML_TIME_TRAVEL_SUPPORT SECCOMP HOSTFS CAN_RAW CAN_VCAN CAN_SLCAN NET_SCH_TBF; do
        grep -q "^CONFIG_$wanted=y" .config || missing+=" $wanted"
    done
    [ -z "$missing" ] || { echo "E: this kernel source does not give$missing" >&2 && return 1; }
}

make_kernel() { # WORK
    cd "$1/linux" && configure && check_config && timeout --foreground "$build_limit_s" make ARCH=um -j"$(nproc)" linux && strip -s -o "$1/kernel" linux &&
        make -s ARCH=um kernelversion >"$1/version"
}

# A kernel that stops before its first program would have every test fail.
boots() { # WORK
    mkdir "$1/job" && echo true >"$1/job/run.sh" && TMPDIR=$1 timeout --foreground "$boot_limit_s" "$1/kernel" mem=128M rootfstype=hostfs rootflags=/ rw \
        init="$here/init.sh" job="$1/job" uml_dir="$1/job/" con=null con0=null,fd:1 quiet && [ "$(cat "$1/job/status")" = 0 ]
}

# The newest source that gives a kernel. The log is that of the last try.
build() { # WORK
    local fetch
    for fetch in fetch_backport fetch_newest; do
        rm -rf "$1"/*
        if ("$fetch" "$1" && unpack "$1" && (make_kernel "$1") && boots "$1") >"$1/log" 2>&1 </dev/null; then
            mv "$1/kernel" "$cache/uml-$(cat "$1/version")-$(recipe_hash)"
            return
        fi
    done
    return 1
}

lacking_tools() {
    local tool
    for tool in apt-get dpkg-deb gcc make flex bison bc xz; do command -v "$tool" >/dev/null || printf ' %s' "$tool"; done
}

main() {
    local lacking
    find_cached && return 0
    [ "${1:-}" != --cached ] || { say "no kernel in $cache yet: heave-lab build makes one, in some minutes" && return 1; }
    [ "$(uname -m)" = x86_64 ] || { say "User Mode Linux needs an x86_64 machine" && return 1; }
    lacking=$(lacking_tools)
    [ -z "$lacking" ] || { say "building the kernel takes these, which are not here:$lacking" && return 1; }
    mkdir -p "$cache" || return 1
    exec 9>"$cache/.uml.lock" && flock 9 # a second run waits and finds the kernel
    find_cached && return 0
    rm -rf "$cache"/.uml.?????? # of one that was killed
    work=$(mktemp -d "$cache/.uml.XXXXXX") && trap 'rm -rf "$work"' EXIT || return 1
    say "building a kernel with CAN into $cache, once: some minutes, 1 GB of disk while it lasts"
    if ! build "$work"; then
        say "the kernel could not be built: $(grep -m 1 -E '^E:|error:|Error [0-9]' "$work/log" || tail -n 1 "$work/log")"
        return 1
    fi
    find_cached
}

main "$@"
