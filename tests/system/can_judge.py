# SPDX-License-Identifier: MIT
"""can_judge.py - reads what a recorder wrote down of a CANopen bus, and judges it from the standard's rules and the configuration file alone.

Times are microseconds of the monotonic clock, positions counts. Nothing here knows the driver or the simulated drives."""
import configparser
import struct

SYNC, EMERGENCY, TPDO, RPDO, HEARTBEAT = 0x080, 0x080, 0x180, 0x200, 0x700
FIRST_DRIVE_STATE = 0x6F
ENABLED, FAULT = 0x27, 0x08
ENABLE_OPERATION = 0x0F


class Record:
    """Frames as (time_us, id, bytes), and the same taken apart."""

    def __init__(self, path, nodes):
        self.nodes = list(nodes)
        rows = [line.split(" ") for line in path.read_text(encoding="ascii").splitlines()]
        self.frames = [(int(when), int(what, 16), bytes.fromhex(data)) for when, what, data in rows if what[0] != "x"]

    def of(self, cob_id):
        return [(when, data) for when, what, data in self.frames if what == cob_id]

    def syncs(self):
        return [when for when, _ in self.of(SYNC)]

    def commands(self, node):
        """(time_us, controlword, target)"""
        return [(when, *struct.unpack("<Hi", data)) for when, data in self.of(RPDO + node)]

    def statuses(self, node):
        """(time_us, statusword, actual)"""
        return [(when, *struct.unpack("<Hi", data[:6])) for when, data in self.of(TPDO + node)]

    def lags(self, node):
        """(time_us, target, the position heard last) of each command."""
        answers, actual = self.statuses(node), None
        for when, _, target in self.commands(node):
            while answers and answers[0][0] < when:
                actual = answers.pop(0)[2]
            if actual is not None:
                yield when, target, actual

    def boots(self, node):
        return [when for when, data in self.of(HEARTBEAT + node) if data == b"\0"]

    def beats(self, node):
        return [when for when, data in self.of(HEARTBEAT + node) if data != b"\0"]

    def first_status(self, node, state, since_us=0):
        return next(when for when, word, _ in self.statuses(node) if when >= since_us and word & FIRST_DRIVE_STATE == state)

    def stops(self, since_us, but=()):
        """When each drive is told to end, for the first time after since_us: {node: time_us}; a controlword that does not enable."""
        found = {}
        for node in self.nodes:
            if node not in but:
                found[node] = next((when for when, word, _ in self.commands(node) if when > since_us and word & ENABLE_OPERATION != ENABLE_OPERATION), None)
        return found

    def enabled_span(self, node, until_us):
        """Targets that count: from the first with torque to until_us."""
        begin_us = self.first_status(node, ENABLED)
        return [(when, target) for when, word, target in self.commands(node) if begin_us <= when < until_us and word & ENABLE_OPERATION == ENABLE_OPERATION]


def check_order(record, since_us, until_us, period_us, slack_us=50):
    """In every period: SYNC, then one command for each drive, in order, in the same cycle as SYNC; nothing twice. The number of periods."""
    syncs = [when for when in record.syncs() if since_us <= when < until_us]
    gaps = [after - before for before, after in zip(syncs, syncs[1:])]
    assert gaps and max(abs(gap - period_us) for gap in gaps) <= slack_us, f"SYNC periods of {min(gaps)} to {max(gaps)} us"
    sent = [(when, what) for when, what, _ in record.frames if syncs[0] <= when < syncs[-1] and (what == SYNC or what - RPDO in record.nodes)]
    period = [SYNC, *(RPDO + node for node in record.nodes)]
    for index in range(0, len(sent), len(period)):
        part = sent[index:index + len(period)]
        assert [what for _, what in part] == period, f"at {part[0][0]} us: {[f'{what:x}' for _, what in part]}"
        assert part[-1][0] - part[0][0] < period_us / 2, f"the set of {part[0][0]} us took {part[-1][0] - part[0][0]} us"
    return len(gaps)


def check_start(record):
    """No step at enabling: while a drive has no torque yet, and with the first targets after it, the target stands on actual."""
    for node in record.nodes:
        begin_us = record.first_status(node, ENABLED)
        actual = [position for when, _, position in record.statuses(node) if when <= begin_us][-1]
        targets = [target for when, word, target in record.commands(node) if word & ENABLE_OPERATION == ENABLE_OPERATION and when <= begin_us]
        first = record.enabled_span(node, float("inf"))[0][1]
        assert all(abs(target - actual) <= 1 for target in [*targets, first]), f"node {node} stands at {actual}, is told {targets[:1]}, {first}"


def limits_of(config, node, cylinders):
    """Speed, acceleration, jerk of one axis as the file says them."""
    parser = configparser.ConfigParser(inline_comment_prefixes=";", strict=False)
    parser.read(config, encoding="utf-8")
    section = dict(parser["cylinders" if node <= cylinders else "angle"])
    return [next(float(value) for key, value in section.items() if key.startswith(start)) for start in ("speed_", "accel_", "jerk_")]


def check_limits(values, limits, period_us, counts_per_unit, what):
    """First to third differences per bus period, within the limits and what rounding to counts may add. The share of each limit that was used."""
    shares = []
    for order, limit in enumerate(limits, 1):
        values = [after - before for before, after in zip(values, values[1:])]
        most = limit * (period_us / 1e6) ** order * counts_per_unit + 2 ** (order - 1)
        worst = max(map(abs, values))
        assert worst <= most, f"{what}: difference {order} is {worst}, allowed {most:.2f}"
        shares.append(worst / most)
    return shares
