# SPDX-License-Identifier: MIT
"""trace.py - the format of what heaved --trace writes."""
import re

from heave.configuration import POSE_AXES, UNIT

NANO = 10**9  # numbers are printed with nine decimals, and are integers of 1e-9 here
STATES = {"OFF", "HOMING", "SETTLED", "RISING", "NEUTRAL", "ENGAGED", "HOLD", "SETTLING", "SERVICE", "FAULT", "ESTOP"}
FLAGS = {"clamped", "speed", "accel", "stretched", "takeover", "cylinders", "off-path", "no-pose", "late", "fault", "estop", "silent", "loose"}

POSE_COLUMNS = [f"{axis}_{UNIT[axis]}" for axis in POSE_AXES]
ANGLE = len(POSE_AXES)
FIRST_CYLINDER = ANGLE + 1
CYLINDER_COLUMNS = 6
COLUMNS = POSE_COLUMNS + ["angle_deg"] + [f"c{i + 1}_mm" for i in range(CYLINDER_COLUMNS)]
BEFORE_ZERO = "before-zero\n"  # nothing is led yet: drives are off, or move by themselves
HEADER = ",".join(["t_ms", "state", *COLUMNS, "relays", "flags"])
ROW = re.compile(rf"(\d+)(?:\.(\d{{1,3}}))?,([A-Z]+),((?:-?\d+\.\d{{9}},){{{len(COLUMNS)}}})([0-9A-Fa-f]{{4}}),([a-z|-]*)\n")
