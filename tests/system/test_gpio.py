#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_gpio.py BIN masks|lines|inputs|healthy|selftest - the daemon on GPIO lines that the kernel simulates, on virtual time. Runs inside kernel.py.

What the relays do is read from the other side of the lines, as a multimeter at the terminals would: by the tests' own gpio_sim.py where what is on the lines is
the point, and by heave-twin where it is what heaved makes of its switches."""
import json
import signal
import sys
import time

import gpio_sim
import harness
import tap
from twin_bench import WithTwin

RELAYS = 12
FIRST = 2  # line of relay 1
LINES = ", ".join(f"FX{FIRST + n}" for n in range(RELAYS))
SAFE = 0x800
EXIT_UNAVAILABLE = 69
SLOW_US = 10000  # edges of simulated lines come with the kernel's next tick, up to 10 ms later
CYCLE_US = 5000  # what is tested here does not depend on it, and simulating a second takes a fifth
DOCUMENT = [("@A3:5.5,3.0,20,0F#", 0x00F), ("@A4:5.5,3.0,20,45,0F#", 0x00F), ("@A6:5,6,0,5.5,3.0,20,F0#", 0x0F0),
            ("@A7:5,6,0,5.5,3.0,20,-30,F0#", 0x0F0), ("@C6:55,33,25,20,20,50,0100#", 0x100), ("@C7:55,33,25,20,20,50,25.5,0100#", 0x100),
            ("@A6:2.5,3.5,6,10,5,40,2#", 0x002), ("@A7:3.5,1.5,12,8,5,30,20,4#", 0x004), ("@A6:0,0,0,0,0,20,0A#", 0x00A),
            ("@A6:0,0,0,0,0,20,0#", 0x000), ("@A6:0,0,0,0,0,20,FFF#", 0xFFF)]


class GpioBench(harness.Bench):
    """The demonstration platform with its relays on lines of a chip that is called effects."""

    def __init__(self, bin_dir, relays="", **changes):
        super().__init__(bin_dir, **{"platform__cycle_us": CYCLE_US, "relays__lines": LINES, "relays__safe_mask": f"{SAFE:X}", **changes})
        self.edit("[relays]\ndriver = sim\n", f"[relays]\ndriver = gpio\n{relays}")

    def edit(self, old, new):
        text = self.config.read_text(encoding="utf-8")
        assert text.count(old) == 1, f"{old!r} found {text.count(old)} times"
        self.config.write_text(text.replace(old, new), encoding="utf-8")

    def wait_status(self, condition, what):
        """Asks five times a second: each question is a process, and starting one costs far more here than simulating a second."""
        for _ in range(5 * harness.WAIT_S):
            status = self.status()
            if condition(status):
                return status
            time.sleep(0.2)
        raise AssertionError(f"{what}: not within {harness.WAIT_S} s")

    def wait_state(self, *states):
        return self.wait_status(lambda status: status["state"] in states, f"state {' or '.join(states)}")

    def refused(self):
        """What heaved says that does not start."""
        run = self.heaved("--config", self.config)
        assert run.returncode == EXIT_UNAVAILABLE, (run.returncode, run.stderr)
        return run.stderr


def relays(chip):
    return chip.mask(FIRST, RELAYS)


def wait_relays(chip, mask, what):
    harness.wait_for(lambda: relays(chip) == mask, f"{what}: relays {mask:03X}, they are {relays(chip):03X}")


def switch(bench, chip, mask=0x0F0):
    """Engaged, and a sender that has closed some."""
    bench.wait_state("ENGAGED")
    sender = bench.sender()
    sender.send(f"@A6:0,0,0,0,0,20,{mask:X}#")
    wait_relays(chip, mask, "sent")
    return sender


def document(bin_dir):
    with gpio_sim.Chip("effects", 16, "FX") as chip, GpioBench(bin_dir) as bench:
        bench.start()
        wait_relays(chip, SAFE, "before anyone sends")
        bench.wait_state("ENGAGED")
        with bench.sender() as sender:
            for frame, mask in DOCUMENT:
                sender.send(frame)
                wait_relays(chip, mask, frame)
                assert chip.level(0) == chip.level(1) == chip.level(14) == chip.level(15) == 0, "a line of nobody"
        assert bench.status()["relays"]["known"] is True
        assert bench.stop(bench.running[0]) == 0


def fewer(bin_dir):
    with gpio_sim.Chip("effects", 16, "FX") as chip, GpioBench(bin_dir, "chip = effects\nactive_low = yes\n", relays__lines="2, 3, 4, 5",
                                                          relays__safe_mask="8") as bench:
        bench.start()
        bench.wait_state("ENGAGED")
        harness.wait_for(lambda: chip.mask(FIRST, 4) == 0x7, "active low: only relay 4 is closed")
        with bench.sender() as sender:
            sender.send("@A6:0,0,0,0,0,20,F5#")
            harness.wait_for(lambda: chip.mask(FIRST, 4) == 0xA, "relays 1 and 3 are closed")
        assert bench.status()["counters"]["relay_missing"] == 1
        assert "relay_missing 1" in bench.ctl("status").stdout


def every_way_out(bin_dir):
    """A sender that dies, a hold, a park, a fault, SIGTERM: watched while heaved has the lines."""
    with gpio_sim.Chip("effects", 16, "FX") as chip, GpioBench(bin_dir, udp__silence_hold_ms=300) as bench:
        daemon = bench.start()
        switch(bench, chip).link.close()
        wait_relays(chip, SAFE, "the sender has died")
        assert bench.status()["state"] == "HOLD"
        switch_again = [("hold", "resume"), ("park", "engage")]
        for request, back in switch_again:
            assert bench.ctl("resume" if request == "hold" else "engage").returncode == 0
            switch(bench, chip)
            assert bench.ctl(request).returncode == 0
            wait_relays(chip, SAFE, request)
            assert bench.ctl(back).returncode == 0
        switch(bench, chip)
        daemon.send_signal(signal.SIGTERM)
        wait_relays(chip, SAFE, "SIGTERM")
        assert daemon.poll() is None, "it settles first"
        assert daemon.wait(timeout=harness.WAIT_S) == 0


def fault(bin_dir):
    with gpio_sim.Chip("effects", 16, "FX") as chip, GpioBench(bin_dir, sim__lag_ms=300) as bench:
        bench.edit("[cylinders]\n", "[cylinders]\nfollowing_error_mm = 20\n")
        bench.start()
        with switch(bench, chip) as sender:
            harness.wait_for(lambda: "takeover" not in bench.status()["flags"], "the sender is faded in")
            sender.send("@A6:0,0,0,0,0,90,0F#")
            bench.wait_state("FAULT")
        wait_relays(chip, SAFE, "FAULT")


def killed(bin_dir):
    """The kernel takes the lines back: on this chip they fall to what pulls them, on others they stay as they were."""
    with gpio_sim.Chip("effects", 16, "FX") as chip, GpioBench(bin_dir) as bench:
        chip.pull(FIRST + 11, True)
        daemon = bench.start()
        switch(bench, chip)
        assert bench.stop(daemon, signal.SIGKILL) == -signal.SIGKILL
        wait_relays(chip, 0x800, "the lines fall to what pulls them")
        bench.socket.unlink(missing_ok=True)
        bench.start()
        wait_relays(chip, SAFE, "started again")


def taken(bin_dir):
    with gpio_sim.Chip("effects", 16, "FX"), GpioBench(bin_dir) as bench:
        other = GpioBench(bin_dir)
        with other:
            daemon = bench.start()
            said = other.refused()
            assert 'gpio: line FX2 of chip effects is in use by "heaved relays"' in said, said
            assert bench.stop(daemon) == 0
            other.start()


def missing(bin_dir):
    with gpio_sim.Chip("effects", 16, "FX") as chip:
        with GpioBench(bin_dir, relays__lines="FX2, FX3, FOG", relays__safe_mask="0") as bench:
            wrong = "gpio: no chip has a line FOG (gpioinfo lists what there is)"
            check = bench.heaved("--config", bench.config, "--check")
            assert check.returncode == 0 and f"warning: [relays] {wrong}\n" in check.stdout, check.stdout
            assert wrong in bench.refused()
        with GpioBench(bin_dir) as bench:
            assert "12 lines on chip effects" in bench.heaved("--config", bench.config, "--check").stdout
            chip.unplug()
            check = bench.heaved("--config", bench.config, "--check")
            assert check.returncode == 0 and "not looked at: gpio: this machine has no GPIO chip" in check.stdout, check.stdout
            assert "this machine has no GPIO chip" in bench.refused()
            chip.plug()
            bench.start()


def unplugged(bin_dir):
    """The motion goes on; what is not known any more is shown."""
    with gpio_sim.Chip("effects", 16, "FX") as chip, GpioBench(bin_dir) as bench:
        daemon = bench.start()
        with switch(bench, chip) as sender:
            chip.unplug()
            bench.wait_status(lambda status: status["relays"]["known"] is False, "the relays are not known")
            sender.send("@A6:0,0,0,0,0,30,0F#")
            bench.wait_status(lambda status: abs(status["pose_sent"]["z_mm"] - 30) < 0.01, "the motion goes on")
        status = bench.status()
        assert status["state"] == "ENGAGED" and status["late_cycles"] == 0, status
        assert "000F, not known\n" in bench.ctl("status").stdout
        assert bench.stop(daemon) == 0
        assert daemon.log.read_text(encoding="utf-8").count("relays: cannot be switched") == 1


# --- Inputs: contacts to ground on a chip that is called desk. A broken wire and an open contact are the same: nothing pulls down ---

SECOND, ESTOP, KEY, BUTTON, SUPPLY = range(5)
SWITCHES = ["estop2", "estop", "enable", "reset", "power"]  # as heave-twin calls them
INPUTS = "\n[inputs]\ndriver = gpio\nestop = DESK1\nreset = DESK3\n"
MANUAL = {"platform__engage": "manual"}


class Desk(gpio_sim.Chip):
    def __init__(self):
        super().__init__("desk", 5, "DESK")

    def close(self, line):
        self.pull(line, False)

    def open(self, line):
        self.pull(line, True)

    def press(self, line):
        self.close(line)
        time.sleep(0.2)
        self.open(line)


class DeskBench(GpioBench):
    """Started, with an e-stop that is released and was reset: heaved pulls the lines up, so at first every wire is broken."""

    def __init__(self, bin_dir, desk, key="", **changes):
        super().__init__(bin_dir, **{"engage__speed_mm_s": 150, "engage__accel_mm_s2": 1000, **MANUAL, **changes})
        self.desk = desk
        self.config.write_text(self.config.read_text(encoding="utf-8") + INPUTS + key, encoding="utf-8")

    def start(self, *arguments, **options):
        """Ends in OFF."""
        daemon = super().start(*arguments, **options)
        self.wait_state("ESTOP")
        self.desk.close(ESTOP)
        self.wait_status(lambda status: status["estop_active"] is False, "released")
        assert self.status()["state"] == "ESTOP", "latched"
        self.desk.press(BUTTON)
        self.wait_state("OFF")
        return daemon


class TwinDesk(WithTwin, DeskBench):
    """The same with the switches, and relays, of heave-twin, which is its own desk; there as well every wire is broken at first."""

    def __init__(self, bin_dir, key="", **changes):
        super().__init__(bin_dir, self, key, **changes)

    def start_twin(self, *arguments):
        super().start_twin(*arguments)
        for name in self.twin_status()["switches"]:
            self.do(f"{name} open")

    def close(self, line):
        self.do(f"{SWITCHES[line]} closed")

    def open(self, line):
        self.do(f"{SWITCHES[line]} open")

    def press(self, line):
        Desk.press(self, line)


def engage(bench):
    assert bench.ctl("engage").returncode == 0
    bench.wait_state("ENGAGED")


def estop(bin_dir):
    """Latched in the cycle after the next at the latest, relays safe; the button resets once it is released; a recording replays it."""
    with gpio_sim.Chip("effects", 16, "FX") as chip, Desk() as desk, DeskBench(bin_dir, desk, platform__cycle_us=SLOW_US) as bench:
        record, trace = bench.folder / "record.txt", bench.folder / "live.csv"
        daemon = bench.start("--record", record, "--trace", trace)
        engage(bench)
        with switch(bench, chip):
            desk.open(ESTOP)
            time.sleep(2 * SLOW_US / 1e6)
            assert relays(chip) == SAFE, f"two cycles later: {relays(chip):03X}"
        assert bench.status()["state"] == "ESTOP" and bench.status()["estop_active"] is True
        desk.press(BUTTON)
        time.sleep(3)  # a reset waits for two
        assert bench.status()["state"] == "ESTOP", "the e-stop is still pressed"
        desk.close(ESTOP)
        time.sleep(1)
        assert bench.status()["state"] == "ESTOP", "latched"
        desk.press(BUTTON)
        bench.wait_state("OFF")
        assert bench.stop(daemon) == 0
        said = daemon.log.read_text(encoding="utf-8")
        assert "ENGAGED -> ESTOP (estop)" in said and "the reset button was pressed" in said and "reset refused" in said, said
        assert "!estop on" in record.read_text(encoding="utf-8") and "!reset" in record.read_text(encoding="utf-8")
        live = harness.since_zero(trace.read_bytes())
        assert bench.play(record)[:len(live)] == live, "a recording replays switches"


def desk_unplugged(bin_dir):
    """Whoever cannot see the e-stop has to stop."""
    with gpio_sim.Chip("effects", 16, "FX") as chip, Desk() as desk, DeskBench(bin_dir, desk) as bench:
        daemon = bench.start()
        engage(bench)
        with switch(bench, chip):
            desk.unplug()
            bench.wait_state("ESTOP")
            wait_relays(chip, SAFE, "the inputs are gone")
        assert bench.ctl("reset").returncode != 0
        assert bench.stop(daemon) == 0
        assert daemon.log.read_text(encoding="utf-8").count("inputs: cannot be read, which counts as an e-stop") == 1


def key(bin_dir):
    """Off: nobody engages, and who is up parks; never anything that brings drives up."""
    with TwinDesk(bin_dir, "enable = DESK2\n", sim__enable_delay_ms=2000, sim__homed="no") as bench:
        desk = bench
        bench.start_twin()

        def is_refused(*requests):
            for request in requests:
                run = bench.ctl(request)
                assert run.returncode != 0 and "the enable key is off" in run.stderr + run.stdout, (request, run)

        def turn(is_on):
            (desk.close if is_on else desk.open)(KEY)
            time.sleep(0.2)

        bench.start()
        is_refused("engage", "park", "resume")
        turn(True)
        assert bench.status()["state"] == "OFF", "a key moves nobody"
        assert bench.ctl("engage").returncode == 0
        bench.wait_state("HOMING")
        assert bench.ctl("hold").returncode == 0
        turn(False)
        time.sleep(1)
        assert bench.status()["state"] == "HOLD", "the drives stay off"
        is_refused("engage", "park", "resume")
        turn(True)
        engage(bench)
        turn(False)
        bench.wait_state("SETTLED")
        is_refused("engage")
        turn(True)
        assert bench.status()["state"] == "SETTLED"


def channels(bin_dir):
    """The reset at the start of DeskBench is refused no more once both channels are closed."""
    with TwinDesk(bin_dir, "estop2 = DESK0\nestop_discrepancy_ms = 1000\n") as bench:
        desk = bench
        bench.start_twin()
        record, trace = bench.folder / "record.txt", bench.folder / "live.csv"
        daemon = harness.Bench.start(bench, "--record", record, "--trace", trace)
        bench.wait_state("ESTOP")
        desk.close(SECOND)
        bench.wait_status(lambda status: status["fault"]["name"] == "estop-channels", "one wire is broken, the other one closed")
        desk.close(ESTOP)
        time.sleep(1)
        assert bench.status()["estop_active"] is True, "a wire that has been mended proves nothing"
        said = bench.ctl("reset").stderr
        assert "press it and release it" in said, said
        for line in (ESTOP, SECOND):
            desk.open(line)
        for line in (ESTOP, SECOND):
            desk.close(line)
        time.sleep(0.2)
        assert bench.ctl("reset").returncode == 0
        for line in (ESTOP, SECOND):
            bench.wait_state("OFF")
            engage(bench)
            desk.open(line)
            bench.wait_state("ESTOP")
            assert bench.status()["fault"]["name"] == "none", "not for too long yet"
            desk.close(line)
            time.sleep(0.2)
            assert bench.ctl("reset").returncode == 0
        bench.wait_state("OFF")
        engage(bench)
        desk.open(SECOND)
        bench.wait_status(lambda status: status["state"] == "ESTOP" and status["fault"]["name"] == "estop-channels", "too long")
        assert bench.stop(daemon) == 0
        assert "!fault estop-channels" in record.read_text(encoding="utf-8")
        live = harness.since_zero(trace.read_bytes())
        assert bench.play(record)[:len(live)] == live, "a recording replays channels that disagree"


def supply(bin_dir):
    with TwinDesk(bin_dir, "power = DESK4\npower_settle_ms = 4000\n") as bench:
        desk = bench
        bench.start_twin()
        record, trace = bench.folder / "record.txt", bench.folder / "live.csv"
        daemon = bench.start("--record", record, "--trace", trace)
        assert "the supply is failing" in bench.ctl("engage").stderr, "its wire is broken from the start"
        desk.close(SUPPLY)
        bench.wait_status(lambda status: status["power_failing"] is False, "closed")
        engage(bench)
        desk.open(SUPPLY)
        bench.wait_state("SETTLED")
        for request in ("engage", "resume"):
            assert "the supply is failing" in bench.ctl(request).stderr, request
        assert bench.status()["power_failing"] is True
        time.sleep(5)
        assert bench.status()["state"] == "SETTLED", "who is down stays down, and is no fault"
        desk.close(SUPPLY)
        bench.wait_status(lambda status: status["power_failing"] is False, "back")
        assert bench.status()["state"] == "SETTLED", "it moves nobody"
        engage(bench)
        assert bench.ctl("hold").returncode == 0
        desk.open(SUPPLY)
        time.sleep(2)
        assert bench.status()["state"] == "HOLD", "an operator's hold is not ended"
        bench.wait_state("FAULT")
        assert bench.status()["fault"]["name"] == "power-failing"
        assert bench.stop(daemon) == 0
        assert "!fault power-failing" in record.read_text(encoding="utf-8")
        live = harness.since_zero(trace.read_bytes())
        assert bench.play(record)[:len(live)] == live, "a recording replays a supply that fails"


def inputs_missing(bin_dir):
    with gpio_sim.Chip("effects", 16, "FX"), Desk() as desk:
        with DeskBench(bin_dir, desk) as bench, DeskBench(bin_dir, desk) as other:
            check = bench.heaved("--config", bench.config, "--check").stdout
            assert "2 lines on chip desk" in check and "12 lines on chip effects" in check, check
            other.edit("driver = gpio\nlines", "driver = sim\nlines")
            bench.start()
            assert 'gpio: line DESK1 of chip desk is in use by "heaved inputs"' in other.refused()
        with DeskBench(bin_dir, desk) as bench:
            bench.edit("reset = DESK3", "reset = DESC3")
            assert "gpio: no chip has a line DESC3" in bench.refused()
        with DeskBench(bin_dir, desk) as bench:
            bench.edit("estop = DESK1\nreset = DESK3", "chip = effects\nestop = 2")
            assert "warning: [inputs] gpio: line 2 is relay 1 already" in bench.heaved("--config", bench.config, "--check").stdout


# --- The healthy pulse, as the watchdog behind it sees it ---

PULSE = 15
TOGGLE_MS = 20  # two looks of the watchdog below, which the kernel's tick makes ten ms apart
PULSE_KEYS = f"\n[healthy]\ndriver = gpio\nline = FX{PULSE}\ntoggle_ms = {TOGGLE_MS}\n"
SELFTEST = "\n[service]\njog_mm_s = 50\nselftest = daily\n"


def edges(chip, seconds):
    """Edges of the pulse within that time."""
    seen, last, until = 0, chip.level(PULSE), time.monotonic() + seconds
    while time.monotonic() < until:
        time.sleep(0.001)
        level = chip.level(PULSE)
        seen, last = seen + (level != last), level
    return seen


class PulseBench(GpioBench):
    def __init__(self, bin_dir, chip, **changes):
        super().__init__(bin_dir, **{"sim__lag_ms": 300, **changes})
        self.edit("[cylinders]\n", "[cylinders]\nfollowing_error_mm = 20\n")
        self.chip = chip
        self.config.write_text(self.config.read_text(encoding="utf-8") + PULSE_KEYS, encoding="utf-8")

    def edges(self, seconds):
        return edges(self.chip, seconds)

    def wait_pulse(self):
        harness.wait_for(lambda: self.edges(0.2) >= 5, "the pulse runs")

    def is_quiet_and_low(self):
        return self.edges(0.3) == 0 and self.chip.level(PULSE) == 0


def pulse(bin_dir):
    with gpio_sim.Chip("effects", 16, "FX") as chip, PulseBench(bin_dir, chip) as bench:
        daemon = bench.start()
        bench.wait_pulse()
        with switch(bench, chip) as sender:
            bench.wait_pulse()
            assert bench.status()["healthy"] is True
            harness.wait_for(lambda: "takeover" not in bench.status()["flags"], "the sender is faded in")
            sender.send("@A6:0,0,0,0,0,90,0F#")
            bench.wait_state("FAULT")
        assert bench.is_quiet_and_low(), "in FAULT"
        assert bench.status()["healthy"] is False
        assert bench.stop(daemon) == 0
        assert bench.is_quiet_and_low(), "after the end"


def pulse_hangs(bin_dir):
    """Stopped where it is, as a program that hangs; killed, as one that crashes."""
    with gpio_sim.Chip("effects", 16, "FX") as chip, PulseBench(bin_dir, chip) as bench:
        daemon = bench.start()
        bench.wait_pulse()
        daemon.send_signal(signal.SIGSTOP)
        assert bench.edges(0.3) == 0, "a program that is stopped makes no edge"
        daemon.send_signal(signal.SIGCONT)
        bench.wait_pulse()
        assert bench.stop(daemon, signal.SIGKILL) == -signal.SIGKILL
        assert bench.is_quiet_and_low(), "killed"


def pulse_missing(bin_dir):
    with gpio_sim.Chip("effects", 15, "FX") as chip, PulseBench(bin_dir, chip) as bench:
        wrong = "gpio: no chip has a line FX15"
        assert f"warning: [healthy] {wrong}" in bench.heaved("--config", bench.config, "--check").stdout
        assert wrong in bench.refused()


# --- The daily check, by a person at the desk who looks at the lines ---

def daily_check(bin_dir):
    """Every switch and the first relay are tried; the person says what the lines show. One switch whose wire is loose is found."""
    with TwinDesk(bin_dir, "enable = DESK2\npower = DESK4\n" + SELFTEST + PULSE_KEYS) as bench:
        desk = bench
        bench.start_twin()
        bench.start()
        for line in (KEY, SUPPLY):
            desk.close(line)
        bench.wait_status(lambda status: status["power_failing"] is False, "supplied")
        dropped = []

        def press():
            time.sleep(0.3)
            desk.open(ESTOP)
            time.sleep(0.6)
            dropped.append(bench.twin_status()["healthy"]["still_ms"] > 250)

        def turn_off():
            time.sleep(0.3)
            desk.open(KEY)

        def see_relay():
            harness.wait_for(lambda: bench.twin_status()["relays"] == [1], "relay 1 is closed")

        acts = {"Press the e-stop": press, "Release the e-stop": lambda: desk.close(ESTOP), "Did the safety relay drop": lambda: "y\n" if dropped == [True] else "n\n",
                "Turn the enable key off": turn_off, "Turn the enable key on": lambda: desk.close(KEY),
                "the supply fails": lambda: desk.open(SUPPLY), "Let it be well": lambda: desk.close(SUPPLY)}
        code, found, text = checked(bench, acts)
        assert code == 0, text
        for name in ("e-stop", "healthy pulse", "enable key", "power failing", "relay 1", "torque", "upper end", "lower end", "brakes"):
            assert found[name]["result"] == "passed", (name, found[name], text)
        assert bench.status()["selftest"]["due"] is False
        acts.update({"Press the e-stop": lambda: "s\n", "Turn the enable key off": turn_off, "Turn the enable key on": lambda: desk.close(KEY), "the supply fails": lambda: "s\n"})
        code, found, text = checked(bench, {name: act for name, act in acts.items() if name != "Did the safety relay drop"})
        assert code == 1 and found["e-stop"]["result"] == "skipped" and found["power failing"]["result"] == "skipped", text
        assert bench.status()["selftest"]["due"] is True, "the last one counts"


def checked(bench, acts):
    """A self-test by hand: exit code, items by name, what was said."""
    from test_selftest import Person  # has a terminal of its own
    report = bench.folder / "report.json"
    code, text = Person(bench, report, acts).run()
    assert report.exists(), f"exit code {code}: {text}"
    return code, {item["name"]: item for item in json.loads(report.read_text(encoding="utf-8"))["items"]}, text


def main():
    suite = tap.Suite()
    if not gpio_sim.is_there():
        print("1..0 # SKIP this kernel has no gpio-sim")
        return 0
    masks = [("every mask of the vendor's document reaches its lines", document),
             ("fewer relays, active low, by chip and number; masks without a relay are counted", fewer),
             ("safe mask: sender dies, hold, park, SIGTERM", every_way_out), ("safe mask: fault", fault)]
    lines = [("kill -9: the lines fall back", killed), ("a line that another has is named with its owner", taken),
             ("a line that is not there, a chip that is not there", missing), ("the chip goes while running", unplugged)]
    inputs = [("e-stop: relays safe within two cycles, latched, reset button, replay", estop),
              ("the chip of the inputs goes while running: e-stop", desk_unplugged), ("enable key", key),
              ("two channels: either stops, one that stays behind is a fault until both have opened", channels),
              ("supply failing: settles, nothing goes up; a hold stays until the time is over", supply),
              ("an input line that is not there, is in use, or is a relay", inputs_missing)]
    healthy = [("healthy pulse: runs while all is well, low from a fault on and after the end", pulse),
               ("healthy pulse: no edge from a program that hangs or is killed", pulse_hangs),
               ("healthy pulse: a line that is not there", pulse_missing)]
    selftest = [("daily check: each switch, the healthy pulse and a relay, as a person at the desk sees them", daily_check)]
    for name, case in {"masks": masks, "lines": lines, "inputs": inputs, "healthy": healthy, "selftest": selftest}[sys.argv[2]]:
        with suite.case(name):
            case(sys.argv[1])
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
