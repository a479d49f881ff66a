# SPDX-License-Identifier: MIT
"""bench_ruckig.py - runs Ruckig on a list of held targets: JSON in, JSON out. Started by bench_rivals.py in the environment that has Ruckig."""
import json
import sys

from ruckig import InputParameter, OutputParameter, Result, Ruckig


def main():
    job = json.load(sys.stdin)
    targets = job["targets"]
    otg, given, out = Ruckig(1, job["cycle_s"]), InputParameter(1), OutputParameter(1)
    given.current_position = [targets[0]]
    given.max_velocity, given.max_acceleration, given.max_jerk = ([limit] for limit in job["limits"])
    positions = []
    for target in targets:
        given.target_position = [target]
        if otg.update(given, out) not in (Result.Working, Result.Finished):
            sys.exit(f"Ruckig gave up in cycle {len(positions)}")
        positions.append(out.new_position[0])
        out.pass_to_input(given)
    json.dump(positions, sys.stdout)


main()
