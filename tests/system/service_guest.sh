#!/bin/bash
# SPDX-License-Identifier: MIT
# service_guest.sh - runs in the emulated machine of test_service_vm.py: the installed package under systemd, as an integrator and an operator
# meet it. Reports in TAP on the second serial line, then switches the machine off. No time is judged: the machine is slow.
report=/dev/ttyS1
number=0
unit=heave@demo

say() { printf '%s\n' "$*" >$report; }

# check NAME FUNCTION: each line of the function has to succeed; so none has an && or a !, which would be passed over
check() {
    local log
    say "# $(cut -d ' ' -f 1 /proc/uptime) s: $2"
    log=$(set -e; exec 2>&1; set -x; "$2")
    if [ $? = 0 ]; then
        say "ok $((++number)) - $1"
    else
        say "not ok $((++number)) - $1"
        { printf '%s\n' "$log" | tail -n 12; journalctl -u "$unit" -n 15 --no-pager -o cat; } | sed 's/^/# /' >$report
    fi
}

fails() { if "$@"; then return 1; fi; }

property() { systemctl show -p "$1" --value "${2:-$unit}"; }

# until COMMAND...: tries until it succeeds
until_true() {
    local tries
    for ((tries = 0; tries < 100; tries++)); do
        "$@" >/dev/null 2>&1 && return 0
        sleep 0.2
    done
    echo "never: $*"
    return 1
}

state() { runuser -u keeper -- heavectl --json status | sed 's/.*"state":"\([A-Z]*\)".*/\1/'; }
is_state() { [ "$(state)" = "$1" ]; }
restarts() { property NRestarts; }
is_restarted() { [ "$(restarts)" = "$1" ] && [ "$(property ActiveState)" = active ]; }
log_has() { journalctl -u "$unit" --no-pager -o cat | grep -q -- "$1"; }

starts() {
    systemctl enable --now $unit # returns when heaved says that it is ready
    [ "$(property ActiveState)/$(property SubState)/$(property Type)" = active/running/notify ]
    [ "$(systemctl is-enabled $unit)" = enabled ]
    until_true is_state ENGAGED
    [ "$(property StatusText)" = ENGAGED ]
}

has_no_privilege() {
    local pid status
    pid=$(property MainPID)
    status=/proc/$pid/status
    [ "$(stat -c %u /proc/$pid)" -ge 61184 ] # systemd.io/UIDS-GIDS: dynamic users
    fails grep -q '^heaved:' /etc/passwd
    [ "$(stat -c %G /proc/$pid)" = heave ]
    grep -q '^CapEff:[[:space:]]*0*$' $status
    grep -q '^CapBnd:[[:space:]]*0*$' $status
    grep -q '^NoNewPrivs:[[:space:]]*1$' $status
}

# In its sandbox it cannot ask the system.
knows_the_start_of_the_machine() {
    tr '\0' '\n' </proc/"$(property MainPID)"/environ | grep -qx "HEAVE_BOOT_ID=$(tr -d - </proc/sys/kernel/random/boot_id)"
}

is_real_time() {
    local pid
    pid=$(property MainPID)
    chrt -a -p "$pid" | grep -q SCHED_FIFO
    [ "$(sed -n 's/^VmLck:[^0-9]*\([0-9]*\) kB/\1/p' /proc/$pid/status)" -gt 1000 ]
    heavectl --json status | grep -q '"realtime":true'
}

may_be_used_by_its_group() {
    runuser -u keeper -- heavectl status | grep -q ENGAGED
    local code=0 said
    said=$(runuser -u nobody -- heavectl status 2>&1) || code=$?
    [ $code = 69 ]
    [[ $said == *"no permission"* ]]
    runuser -u nobody -- grep -q '^heave_' /run/heave/demo/heave.prom # node_exporter is a stranger, too
}

follows_frames() {
    for _ in 1 2 3; do printf '@A6T:5,6,0,5.5,3.0,20,500#' >/dev/udp/127.0.0.1/9800; done
    until_true sh -c 'heavectl --json status | grep -q "\"accepted_timed\":[1-9]"'
}

keeps_incidents() {
    local folder
    folder=$(runuser -u keeper -- heavectl dump)
    test -s "${folder#dump: }/trace.csv"
    [ "$(ls /var/lib/heave/demo | wc -l)" -ge 1 ]
}

metric() { sed -n "s/^$1 //p" /run/heave/demo/heave.prom; }
has_advanced() { [ "$(metric heave_cycles_total)" -gt "$1" ]; }

writes_metrics() {
    local cycles
    until_true test -s /run/heave/demo/heave.prom
    [ "$(stat -c %u /run/heave/demo/heave.prom)" = "$(stat -c %u "/proc/$(property MainPID)")" ]
    cycles=$(metric heave_cycles_total)
    until_true has_advanced "$cycles"
    [ "$(find /run/heave/demo -name '*.part' -mmin +1 | wc -l)" = 0 ]
}

is_fed() {
    [ "$(property WatchdogUSec)" = 2s ]
    local pid
    pid=$(property MainPID)
    sleep 10
    [ "$(property MainPID)" = "$pid" ]
    [ "$(restarts)" = 0 ]
}

is_ended_when_it_hangs() {
    kill -STOP "$(property MainPID)"
    until_true is_restarted 1
    until_true is_state ENGAGED
    journalctl --no-pager -o cat | grep -q 'Watchdog timeout'
}

is_started_again_when_killed() {
    local pid
    pid=$(property MainPID)
    kill -9 "$pid"
    until_true is_restarted 2
    [ "$(property MainPID)" != "$pid" ]
    until_true is_state ENGAGED
}

reads_its_configuration_again() {
    sed -i 's/^silence_hold_ms *=.*/silence_hold_ms = 60000/' /etc/heave/demo.ini
    systemctl reload $unit
    until_true log_has "silence_hold_ms: 60000 from now on"
}

ctl() { runuser -u keeper -- heavectl "$@"; }

# Same user, same group; port, socket, metrics and incidents of its own.
runs_beside_another() {
    local pid code=0 said
    pid=$(property MainPID)
    sed 's/^port *=.*/port = 9801/; s,/run/heave/demo/,/run/heave/second/,' /etc/heave/demo.ini >/etc/heave/second.ini
    systemctl start heave@second
    [ "$(property MainPID)" = "$pid" ]
    [ "$(stat -c %u "/proc/$pid")" = "$(stat -c %u "/proc/$(property MainPID heave@second)")" ]
    said=$(ctl status 2>&1) || code=$?
    [ $code = 64 ]
    [[ $said == *"demo, second"*"--platform NAME"*"--socket PATH"* ]]
    until_true platform_is second ENGAGED
    ctl --platform demo hold
    until_true platform_is demo HOLD
    platform_is second ENGAGED
    until_true test -s /run/heave/second/heave.prom
    said=$(fails heaved --config /etc/heave/second.ini --doctor)
    [[ $said == *"heaved is running (/run/heave/second/heaved.sock)"* ]]
    ctl --socket /run/heave/second/heaved.sock dump
    [ "$(ls /var/lib/heave/second | wc -l)" -ge 1 ]
    ctl --platform demo resume
}

platform_is() { ctl --platform "$1" --json status | grep -q "\"state\":\"$2\""; }

# It takes nothing from the first; a third with its port does not even start.
ends_beside_another() {
    fails platform_is nobody ENGAGED
    sed 's,/run/heave/demo/,/run/heave/third/,' /etc/heave/demo.ini >/etc/heave/third.ini
    fails systemctl start heave@third
    until_true sh -c 'journalctl -u heave@third --no-pager -o cat | grep -q "9800"'
    systemctl stop heave@third heave@second
    [ "$(property Result heave@second)" = success ]
    fails test -e /run/heave/second
    fails test -e /run/heave/third
    test -S /run/heave/demo/heaved.sock
    test -s /run/heave/demo/heave.prom
    [ "$(stat -c %G:%a /run/heave-can)" = heave-can:1770 ]
    until_true is_state ENGAGED # the only one again: needs no name
}

stays_down_when_misconfigured() {
    sed 's/^stroke_mm.*/stroke_mm = many/' /etc/heave/demo.ini >/etc/heave/broken.ini
    fails systemctl start heave@broken
    [ "$(property ExecMainStatus heave@broken)" = 78 ]
    sleep 4
    [ "$(property NRestarts heave@broken)/$(property ActiveState heave@broken)" = 0/failed ]
    fails systemctl start heave@nobody # no such file
    [ "$(property ExecMainStatus heave@nobody)/$(property NRestarts heave@nobody)" = 66/0 ]
}

goes_on_through_an_upgrade() {
    local pid
    pid=$(property MainPID)
    dpkg --force-confold -i /later.deb
    [ "$(property MainPID)" = "$pid" ]
    heavectl status
}

settles_when_stopped() {
    systemctl stop $unit
    [ "$(property Result)/$(property ExecMainCode)/$(property ExecMainStatus)" = success/1/0 ]
    log_has 'SETTLING -> SETTLED'
    log_has 'SETTLED -> OFF'
    [ ! -e /run/heave/demo ]
}

chip_label() { cat /sys/class/gpio/gpiochip*/label | head -n 1; }

gives_chips_to_its_group() {
    insmod /gpio-amd-fch.ko
    insmod /pcengines-apuv2.ko
    until_true test -e /dev/gpiochip0
    until_true test "$(stat -c %G:%a /dev/gpiochip0)" = heave:660
    fails runuser -u nobody -- test -r /dev/gpiochip0
}

has_incident() { compgen -G "/var/lib/heave/gpio/incident-*/trace.csv"; }

# Nothing is behind the lines: all are low, which is a closed e-stop.
uses_lines() {
    sed "/^\[relays\]/,/^driver/ s/^driver.*/driver = gpio\nchip = $(chip_label)/; s/^lines *=.*/lines = 0, 1, 2/; s,/run/heave/demo/,/run/heave/gpio/," /etc/heave/demo.ini >/etc/heave/gpio.ini
    printf '[inputs]\ndriver = gpio\nchip = %s\nestop = 4\nactive_low = yes\n[black-box]\nseconds = 10\n' "$(chip_label)" >>/etc/heave/gpio.ini
    systemctl start $unit
    [ "$(stat -c %u "/proc/$(property MainPID)")" -ge 61184 ]
    until_true is_state ENGAGED
    mountpoint -q /sys/kernel/debug || mount -t debugfs none /sys/kernel/debug
    [ "$(grep -c '|heaved relays' /sys/kernel/debug/gpio)" = 3 ]
    [ "$(grep -c '|heaved inputs' /sys/kernel/debug/gpio)" = 1 ]
    heavectl --json status | grep -q '"realtime":true'
}

keeps_the_incident_of_a_fault() {
    local device
    device=$(dirname "$(readlink -f /sys/bus/gpio/devices/gpiochip0)")
    basename "$device" >"$device/driver/unbind"
    until_true is_state ESTOP
    until_true has_incident
    [ "$(stat -c %u /var/lib/heave/gpio/incident-*/trace.csv)" = "$(stat -c %u "/proc/$(property MainPID)")" ]
    grep -q ESTOP /var/lib/heave/gpio/incident-*/trace.csv
    systemctl stop $unit
    [ "$(property Result)" = success ]
}

settles_when_removed() {
    systemctl start $unit
    until_true is_state ENGAGED
    dpkg -r heave
    [ "$(property ActiveState)" != active ]
    [ "$(journalctl -u $unit --no-pager -o cat | grep -c 'SETTLED -> OFF')" = 2 ]
    dpkg --purge heave
    [ ! -e /etc/heave/demo.ini ]
    [ ! -e /var/lib/private/heave ]
    [ ! -L /etc/systemd/system/multi-user.target.wants/$unit.service ]
}

dpkg -i /heave.deb >/tmp/install 2>&1 || { say "Bail out! $(tail -n 1 /tmp/install)"; systemctl poweroff -ff; }
sed -i 's/^cycle_us *=.*/cycle_us = 10000/' /etc/heave/demo.ini # leaves something to others here
sed -i 's/^silence_hold_ms *=.*/silence_hold_ms = 0/' /etc/heave/demo.ini # nobody sends all the time
sed -i '/^\[control\]/a metrics = /run/heave/demo/heave.prom' /etc/heave/demo.ini
useradd -G heave keeper
ip link set lo up
check "systemctl enable --now returns when the platform is ready, and shows its state" starts
check "runs as a user of its own making, without a capability" has_no_privilege
check "knows which start of the machine it is" knows_the_start_of_the_machine
check "has real-time priority and locked memory all the same" is_real_time
check "members of group heave may use heavectl, others are told that they may not; anybody reads the metrics" may_be_used_by_its_group
check "follows frames from the network" follows_frames
check "writes incidents" keeps_incidents
check "writes metrics, again and again, as its own user" writes_metrics
check "feeds the watchdog" is_fed
check "is ended by the watchdog when it hangs, and started again" is_ended_when_it_hangs
check "is started again after kill -9" is_started_again_when_killed
check "systemctl reload reads the configuration again" reads_its_configuration_again
check "a second platform runs beside the first; heavectl asks which" runs_beside_another
check "and takes nothing from the first when it ends; one with a port in use does not start" ends_beside_another
check "an upgrade of the package does not touch it" goes_on_through_an_upgrade
check "systemctl stop settles the platform; exit 0" settles_when_stopped
check "wrong or missing configuration: exit 78 or 66, and no restart" stays_down_when_misconfigured
if [ -e /pcengines-apuv2.ko ]; then
    check "GPIO chips are the group's, by the rule of udev, and nobody else's" gives_chips_to_its_group
    unit=heave@gpio
    check "uses lines of a chip as the user of its own making" uses_lines
    check "the chip goes: an e-stop, and its incident is in the state directory" keeps_the_incident_of_a_fault
    systemctl stop $unit
    unit=heave@demo
else
    say "ok $((++number)) - GPIO # SKIP the modules are not to be had"
fi
check "removing the package settles it first; purging takes what is the package's" settles_when_removed
say "1..$number"
sync
systemctl poweroff -ff
