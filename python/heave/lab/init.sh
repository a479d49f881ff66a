#!/bin/bash
# SPDX-License-Identifier: MIT
# init.sh - first process in the User Mode Linux kernel of heave-lab: mounts what programs expect, runs the job named on the kernel's
# command line, writes its exit status beside it, and switches off. The root file system is the host's, with the rights of who started it.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t devtmpfs dev /dev
mkdir -p /dev/pts /dev/shm
mount -t devpts -o ptmxmode=0666 pts /dev/pts
mount -t tmpfs tmpfs /dev/shm
mount -t tmpfs tmpfs /run
mount -t configfs configfs /sys/kernel/config
mount -t debugfs debugfs /sys/kernel/debug
ln -s /proc/self/fd /dev/fd
# A process that never waits can starve a receiver here: there is one CPU, and no preemption.
echo 16777216 >/proc/sys/net/core/rmem_default
# Linux stops real-time threads for 50 ms in each second that they fill (since 6.12 by a server of its own). This kernel counts in ticks of
# 10 ms, and a thread that wakes with each tick fills it by doing nothing.
echo -1 >/proc/sys/kernel/sched_rt_runtime_us
for runtime in /sys/kernel/debug/sched/fair_server/*/runtime; do [ ! -e "$runtime" ] || echo 0 >"$runtime"; done
# On virtual time, who asks for random numbers first would have this kernel, which has one CPU and no preemption, stand still until there are
# some. In real time they come by themselves, minutes later. And it has booted in no time: its timers get exact with one of the next ticks.
if grep -q '\btime-travel=' /proc/cmdline; then
    head -c 1 /dev/random >/dev/null
    sleep 0.1
fi
# The same addresses in each run.
echo 0 >/proc/sys/kernel/randomize_va_space
job=$(sed -n 's/.*\bjob=\([^ ]*\).*/\1/p' /proc/cmdline)
# The host sees what is written when it is written back.
if grep -q '\bheave_live\b' /proc/cmdline; then
    : >"$job/output"
    while sleep 1; do sync "$job/output"; done &
fi
bash "$job/run.sh" >"$job/output" 2>&1 </dev/null
echo $? >"$job/status"
poweroff -f
