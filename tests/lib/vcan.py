# SPDX-License-Identifier: MIT
"""vcan.py - vcan0 of kernel.py as a wire."""
import subprocess

FRAME_US = 115  # six bytes at 1 Mbit/s, at worst


def slow(frame_us=FRAME_US):
    """Each frame takes its time, and the queue has an end, as on real interfaces."""
    rate = round(16 * 8 * 1e6 / frame_us)
    subprocess.run(f"tc qdisc replace dev vcan0 root tbf rate {rate}bit burst 16 limit {100 * 16}".split(), check=True)


def fast():
    subprocess.run("tc qdisc del dev vcan0 root".split(), check=False, stderr=subprocess.DEVNULL)
