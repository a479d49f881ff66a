# SPDX-License-Identifier: MIT
"""bench_modbus.py - the subcommand modbus of tools/bench: what Modbus lines carry, from tests/bench/bench_modbus.c."""
import json
import subprocess

from bench_cost import percentile

# kind in bench_modbus: what it is
KINDS = {
    "tcp": "6 drives, a TCP connection each, loopback; set-points and status",
    "serial": "6 drives on one line at 115,200 bit/s; set-points and status",
    "serial-write": "6 drives on one line at 115,200 bit/s; set-points only",
}


class ModbusError(Exception):
    """The program could not be run."""


def measure(program, kind, seconds):
    result = subprocess.run([str(program), kind, str(seconds)], capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise ModbusError(f"{program.name} ended with status {result.returncode}: {result.stderr.strip()[-300:]}")
    head, *ages = result.stdout.split("\n")
    transactions, failures, least, most = (int(word) for word in head.split())
    ages = [int(age) for age in ages if age]
    if not ages:
        raise ModbusError(f"{kind}: no set-point was confirmed")
    return {"seconds": seconds, "transactions_per_s": transactions / seconds, "failures": failures,
            "setpoints_per_s_per_drive": {"least": least / seconds, "most": most / seconds},
            "age_ms": {name: percentile(ages, share) / 1000 for name, share in (("p50", 50), ("p99", 99), ("max", 100))}}


def run(program, seconds, is_json, say):
    figures = {}
    for kind, what in KINDS.items():
        say(f"{what}: {seconds} s")
        figures[kind] = measure(program, kind, seconds)
    if is_json:
        print(json.dumps(figures, indent=2))
        return
    print("                                                                  transactions  set-points/s     age when confirmed, ms   failed")
    print("                                                                         per s  of each drive       p50     p99     max")
    for kind, what in KINDS.items():
        row = figures[kind]
        rate, age = row["setpoints_per_s_per_drive"], row["age_ms"]
        print(f"{what:66}{row['transactions_per_s']:10.0f}  {rate['least']:6.1f} - {rate['most']:6.1f}  {age['p50']:7.2f} {age['p99']:7.2f} {age['max']:7.2f}"
              f"  {row['failures']:5}")
