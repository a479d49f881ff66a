# SPDX-License-Identifier: MIT
"""rooms.py - the folders of src/ and hal/, and which of them each may use. tests/check/check_rooms.py holds the sources and src/DESIGN.md to it."""
from pathlib import PurePath

# The portable core: firmware. Without it, the programs.
CORE = {
    "fixed": set(),
    "protocol": {"fixed"},
    "kinematics": {"fixed"},
    "stream": {"fixed", "kinematics"},
    "motion": {"fixed", "kinematics", "stream"},
    "drives": {"fixed"},
    "canopen": {"fixed", "drives"},
    "gateway": {"fixed", "protocol", "kinematics", "stream", "motion", "drives", "canopen"},
}
PROGRAMS = {
    "common": set(),
    "config": {"common"},
    "platform": {"common", "config"},
    "record": {"common", "config", "platform"},
    "inspect": {"common", "config", "platform"},
    "service": {"common", "config", "platform", "record"},
    "daemon": {"common", "config", "platform", "record", "inspect", "service", "heavectl", "twin", "panel"},
    "twin": {"common", "config", "platform"},
    "setup": {"common"},
    "identify": {"common"},
    "heavectl": {"common", "setup", "identify"},
    "panel": {"common", "service", "identify"},
}
# The backends use the contracts in include/ and nothing else.
BACKENDS = ("sim", "linux", "template")
# The rooms that name a backend: only the daemon chooses one for a platform.
NAMES_BACKEND = {
    "daemon": {"sim", "linux"},
    "record": {"sim"},  # plays on simulated drives
    "inspect": {"linux"},  # opens a bus to look at it
    "twin": {"linux"},  # opens a bus to be on it
}


def is_program(path):
    """Whether a path below the top of the project belongs to the programs, not to the core."""
    parts = PurePath(path).parts
    return len(parts) > 1 and parts[0] == "src" and parts[1] in PROGRAMS


def is_core(path):
    """The same of the core's sources."""
    parts = PurePath(path).parts
    return len(parts) > 1 and parts[0] == "src" and parts[1] not in PROGRAMS
