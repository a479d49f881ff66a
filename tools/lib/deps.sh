# SPDX-License-Identifier: MIT
# shellcheck shell=bash
# deps.sh - installs what a tool needs and the machine lacks (Debian, Ubuntu). Sourced by the tools; owns the names deps_*.
# Nothing is touched, and no network used, when everything is there already.
#
#   deps_need PACKAGE CHECK   the tool cannot go on without it
#   deps_want PACKAGE CHECK   the tool says what it leaves out without it
#   deps_build                what every build of the project needs
#   deps_install              one apt-get run for all that is missing; returns 1 and says one line when that fails
#
# CHECK is how to see that it is there: cmd:NAME, pc:NAME (pkg-config) or file:PATTERN.

deps_tool=${0##*/}
deps_required=()
deps_optional=()

deps_need() { deps_required+=("$1=$2"); }
deps_want() { deps_optional+=("$1=$2"); }

deps_build() {
    deps_need cmake cmd:cmake
    deps_need ninja-build cmd:ninja
    deps_need gcc cmd:gcc
    deps_need libc6-dev file:/usr/include/stdio.h
    deps_need gettext cmd:msgfmt
    deps_need pkg-config cmd:pkg-config
    deps_need libinih-dev pc:inih
    deps_need libcjson-dev pc:libcjson
    deps_need libmnl-dev pc:libmnl
    deps_need libmodbus-dev pc:libmodbus
    deps_need libgpiod-dev pc:libgpiod
    deps_need python3 cmd:python3
}

deps_present() { # CHECK
    local name=${1#*:}
    case $1 in
        cmd:*) command -v "$name" >/dev/null ;;
        pc:*) command -v pkg-config >/dev/null && pkg-config --exists "$name" ;;
        file:*) compgen -G "$name" >/dev/null ;;
    esac
}

deps_missing() { # ENTRY... - prints the packages of those that are not there
    local entry
    for entry; do deps_present "${entry#*=}" || echo "${entry%%=*}"; done
}

# Optional packages count only where the machine's sources have them.
deps_available() { # PACKAGE...
    local package
    for package; do apt-cache show "$package" >/dev/null 2>&1 && echo "$package"; done
}

deps_say() { printf '%s: %s\n' "$deps_tool" "$*" >&2; }

# Runs apt-get as root; what it prints goes to the log. sudo may ask for the password only where someone can answer and it is worth it.
deps_apt() {
    local as_root=()
    if [ "$(id -u)" != 0 ]; then
        as_root=(sudo)
        [ -t 0 ] && [ -n "$deps_lacking" ] || as_root+=(-n)
    fi
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=120 "$@" </dev/null >>"$deps_log" 2>&1
}

# The line that says most: a failed download before what followed from it.
# shellcheck disable=SC2016 # the dollar is sed's
deps_reason() { sed -nE '/^(E:|sudo:)/h; /Failed to fetch/{p; q}; ${x; p}'; }

deps_apt_install() {
    # shellcheck disable=SC2046,SC2086 # lists of package names, split on purpose
    set -- $deps_lacking $(deps_available $deps_extra)
    [ $# = 0 ] || deps_apt install -y --no-install-recommends "$@"
}

deps_install() {
    local reason
    deps_lacking=$(deps_missing "${deps_required[@]}" | tr '\n' ' ')
    deps_extra=$(deps_missing ${deps_optional[@]+"${deps_optional[@]}"} | tr '\n' ' ')
    [ -n "$deps_lacking$deps_extra" ] || return 0

    if ! command -v apt-get >/dev/null; then
        reason="there is no apt-get here to install them with"
    elif [ "$(id -u)" != 0 ] && ! command -v sudo >/dev/null; then
        reason="installing them takes root or sudo"
    else
        [ -z "$deps_lacking" ] || deps_say "installing $deps_lacking${deps_extra:+and, if there is one, $deps_extra}"
        deps_log=$(mktemp)
        # The lists may be absent (fresh containers) or stale: update them only if the first attempt fails.
        # What is only wanted keeps nothing that is needed from being installed.
        deps_apt_install || { deps_apt update; deps_apt_install; } || { deps_extra=''; deps_apt_install; }
        reason="apt-get could not install them ($(deps_reason <"$deps_log"))"
        rm -f "$deps_log"
        deps_lacking=$(deps_missing "${deps_required[@]}" | tr '\n' ' ')
    fi
    [ -n "$deps_lacking" ] || return 0
    deps_say "missing: $deps_lacking- $reason; as root: apt-get install $deps_lacking"
    return 1
}
