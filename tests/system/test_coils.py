#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_coils.py BIN - relays on a Modbus board: the daemon's masks as the coils of a pymodbus server, on TCP and on a serial line. With pymodbus, on virtual time."""
import re
import sys

import harness
import tap

sys.path.insert(0, str(harness.TOP / "tests/peers"))
UNIT, COILS, FIRST = 1, 1, 16
SAFE = 0x801
FRAME = "@A6:0,0,0,0,0,5,{:03X}#"
MASKS = (0x0F0, 0x005, 0xA05, 0xFFF, 0x000, 0x0F1)


def config_of(bench, devices, **changes):
    keys = {"host": f"127.0.0.1:{devices.port}"} if devices.kind == "tcp" else {"device": devices.path, "baud_bps": 115200, "parity": "none"}
    keys = {**keys, "unit": UNIT, "timeout_ms": 900, **changes}
    lines = ", ".join(str(FIRST + i) for i in range(12))
    text = bench.config.read_text(encoding="utf-8")
    text, count = re.subn(r"\[relays\][^\[]*", f"[relays]\ndriver = modbus\nlines = {lines}\nsafe_mask = {SAFE:03X}\n\n", text)
    assert count == 1
    return bench.file("coils.ini", text + "\n[relays-modbus]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items()))


def mask_on(devices):
    return sum(bool(devices.get(UNIT, COILS, FIRST + i)) << i for i in range(12))


def reaches(devices, mask):
    harness.wait_for(lambda: mask_on(devices) == mask, f"mask {mask:03X} is on the board")


def masks_reach_the_board(bench, devices, **place):
    devices.set(UNIT, COILS, FIRST - 1, True)  # neighbours are left alone
    devices.set(UNIT, COILS, FIRST + 12, True)
    daemon = bench.start(config=config_of(bench, devices, **place))
    bench.wait_state("ENGAGED")
    reaches(devices, SAFE)  # before the first frame
    with bench.sender() as sender:
        for mask in MASKS:
            sender.send(FRAME.format(mask))
            reaches(devices, mask)
    reaches(devices, SAFE)  # the sender is silent: HOLD
    harness.wait_for(lambda: bench.status()["relays"]["known"] is True, "the board has answered")
    with bench.sender() as sender:
        harness.wait_for(lambda: sender.send(FRAME.format(0x0F0)) or mask_on(devices) == 0x0F0, "it follows again")
    assert bench.stop(daemon) == 0
    reaches(devices, SAFE)
    assert devices.get(UNIT, COILS, FIRST - 1) and devices.get(UNIT, COILS, FIRST + 12), "a neighbour was written"
    assert all((unit, address, len(values) >= 12) == (UNIT, FIRST, True) for unit, address, values in devices.written), "not in one transaction"


def on_tcp(bench):
    from modbus_peer import Devices
    with Devices("tcp", units=[UNIT]) as devices:
        masks_reach_the_board(bench, devices)


def on_a_serial_line(bench):
    from modbus_peer import Devices, FaultyLine
    with Devices("serial", units=[UNIT]) as devices, FaultyLine(devices) as line:
        masks_reach_the_board(bench, devices, device=line.address[0])


def a_board_that_is_not_there(bench):
    """Motion goes on, the status says so, and the board gets its mask when it is back."""
    from modbus_peer import Devices, FaultyLine
    with Devices("tcp", units=[UNIT]) as devices, FaultyLine(devices) as line:
        daemon = bench.start(config=config_of(bench, devices, host=f"127.0.0.1:{line.address[1]}"))
        bench.wait_state("ENGAGED")
        line.unplug()
        harness.wait_for(lambda: bench.status()["relays"]["known"] is False, "its silence is noticed")
        assert bench.status()["bus"]["last_trouble"], "the status does not say why"
        with bench.sender() as sender:
            harness.wait_for(lambda: sender.send(FRAME.format(0x0F0)) or abs(bench.status()["pose_sent"]["z_mm"] - 5) < 0.01,
                           "the platform goes where it is sent, whatever becomes of the board")
        assert bench.status()["relays"]["known"] is False, "the board was not away meanwhile"
        devices.set(UNIT, COILS, FIRST + 3, True)  # what it came back with
        line.plug()
        harness.wait_for(lambda: bench.status()["relays"]["known"] is True, "it is back")
        reaches(devices, SAFE)
        assert bench.stop(daemon) == 0


WRONG = [
    ({"lines": "16, 18"}, {}, r"lines: 18 does not follow 16; allowed: coils in a row"),
    ({"lines": "one"}, {}, r"lines: one is no coil; allowed: numbers from 0 to 65535"),
    ({"lines": "none"}, {}, r"lines: driver modbus switches none"),
    ({}, {"host": "none"}, r"host: missing; allowed: the board's address, or device"),
    ({}, {"device": "/dev/ttyUSB7"}, r"device: the board has a host already; allowed: host or device"),
    ({}, {"host": "10.0.0.1, 10.0.0.2"}, r"host: has 2 addresses; allowed: the one of the board"),
    ({}, {"host": "board"}, r"host: .*is no IPv4 address"),
    ({}, {"host": "none", "device": "/dev/ttyUSB7", "unit": 250}, r"unit: 250; allowed on a serial line: 1 to 247"),
]


def wrong_figures_are_named(bench):
    class Nobody:
        kind, port = "tcp", 5020
    for relays, board, why in WRONG:
        config = config_of(bench, Nobody, **board)
        text = config.read_text(encoding="utf-8")
        for key, value in relays.items():
            text = re.sub(rf"(\[relays\][^\[]*?^{key} = )[^\n]*", rf"\g<1>{value}", text, flags=re.MULTILINE | re.DOTALL)
        run = bench.heaved("--config", bench.file("wrong.ini", text), "--check")
        assert run.returncode == 78 and re.search(rf"wrong\.ini:\d+: \[relays(-modbus)?\] {why}", run.stderr), f"{why}\n{run.stderr}"


CASES = {
    "masks reach the board on TCP, the safe one on silence and at the end": on_tcp,
    "masks reach the board on a serial line": on_a_serial_line,
    "a board that is not there holds nothing up and gets its mask when it is back": a_board_that_is_not_there,
    "wrong figures are named": wrong_figures_are_named,
}


def main():
    only = sys.argv[sys.argv.index("--only") + 1] if "--only" in sys.argv else ""
    tap.needs_package("pymodbus")
    suite = tap.Suite()
    for name, check in CASES.items():
        if only in name:
            with harness.Bench(sys.argv[1]) as bench, suite.case(name):
                check(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
