#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_plot_bench.py - tools/plot and tools/bench: wrong arguments and files are refused, and what they compute is right.

    test_plot_bench.py --heaved PROGRAM --bench-core PROGRAM --bench-peers PROGRAM

Needs neither matplotlib nor Ruckig; what matplotlib draws is looked at where it is installed.
"""
import argparse
import importlib.util
import json
import math
import os
import random
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

HERE = Path(__file__).resolve().parent
TOP = HERE.parents[1]
sys.path[:0] = [str(TOP / "python"), str(TOP / "tools/lib"), str(HERE)]
import bench_analysis as analysis  # noqa: E402  the path above has to be set first
import bench_cortex  # noqa: E402
import bench_cost  # noqa: E402
import bench_latency  # noqa: E402
import bench_peers  # noqa: E402
import bench_senders  # noqa: E402
import bench_signal as signals  # noqa: E402
import latency_run as latency_runs  # noqa: E402
from bench_rivals import two_limits  # noqa: E402
from heave.plot.dots import dots_of  # noqa: E402
from heave.recording import Line  # noqa: E402
from heave.configuration import Configuration  # noqa: E402
from synthetic_trace import Trace, ini  # noqa: E402
from heave.trace import HEADER  # noqa: E402
from heave.plot.window import TraceError, Window, axes_named, thinned  # noqa: E402

FOLDER = Path(tempfile.mkdtemp(prefix="plot_bench."))
NANO = 10**9


def run(tool, *arguments, **environment):
    return subprocess.run([sys.executable, str(TOP / "tools" / tool), *map(str, arguments)], capture_output=True, text=True, check=False, cwd=FOLDER,
                          env={**os.environ, **environment})


def expect_refusal(result, status, *words):
    assert result.returncode == status, f"status {result.returncode}, expected {status}: {result.stderr}"
    assert "Traceback" not in result.stderr, result.stderr
    for word in words:
        assert word in result.stderr, f"{word!r} is not in: {result.stderr}"


def expect_near(value, expected, within, what="value"):
    assert abs(value - expected) <= within, f"{what} is {value}, expected {expected} within {within}"


def has(module):
    return importlib.util.find_spec(module) is not None


def row(t_ms, z_nano=0, state="ENGAGED", flags=""):
    zeros = "0.000000000"
    sign, whole = "-" if z_nano < 0 else "", f"{abs(z_nano):010d}"
    z = f"{sign}{whole[:-9]}.{whole[-9:]}"
    return f"{t_ms:.3f},{state},{','.join([zeros] * 5)},{z},{','.join([zeros] * 7)},0000,{flags}\n"


def window(rows, from_us=None, to_us=None):
    return Window([HEADER + "\n", *rows], from_us, to_us)


def write(name, text):
    path = FOLDER / name
    path.write_text(text, encoding="utf-8")
    return path


# ---- tools/plot ----
def check_plot_arguments(suite):
    trace = write("trace.csv", "".join([HEADER + "\n", *(row(t, t * t) for t in range(50))]))
    nothing = FOLDER / "nothing"
    nothing.mkdir()
    refusals = {
        "no trace": ((), 2, "TRACE"),
        "three traces": ((trace, trace, trace), 2, "at most two"),
        "an axis that does not exist": ((trace, "--axes", "roll,heave"), 2, "'heave'", "roll"),
        "a time that is none": ((trace, "--from", "soon"), 2, "'soon'"),
        "an end before the start": ((trace, "--from", "3", "--to", "2"), 2, "--to"),
        "an unknown kind of picture": ((trace, "-o", "picture.bmp"), 2, ".png"),
        "two configurations for one trace": ((trace, "--config", "a", "--config", "b"), 2, "--config"),
        "a trace that is not there": (("nowhere.csv",), 1, "nowhere.csv"),
        "a file that is no trace": ((write("other.csv", "a,b\n1,2\n"),), 1, "other.csv", "line 1"),
        "a damaged row": ((write("damaged.csv", HEADER + "\n" + row(0) + row(1)[:40] + "\n"),), 1, "damaged.csv", "line 3"),
        "an empty trace": ((write("empty.csv", HEADER + "\n"),), 1, "no row"),
        "a time without rows": ((trace, "--from", "7"), 1, "no row"),
        "a configuration that is none": ((trace, "--config", write("bad.ini", "nonsense\n")), 1, "bad.ini:1"),
        "limits used without a configuration": ((trace, "--what", "limits"), 1, "limits", "--config"),
        "an animation without a configuration": ((trace, "-o", "ride.html"), 1, "animation", "--config"),
        "an animation as a PNG": ((trace, "--what", "animation", "-o", "ride.png"), 2, "ride.png", ".html"),
        "limits used of two traces": ((trace, trace, "--what", "limits"), 2, "of one trace"),
        "a kind of picture that is none": ((trace, "--what", "music"), 2, "'music'", "spectrum"),
        "a folder that is no incident": ((nothing,), 1, "nothing/trace.csv"),
        "frames that are none": ((trace, "--frames", write("bad.frames", "nonsense\n")), 1, "bad.frames"),
    }
    for name, (arguments, status, *words) in refusals.items():
        with suite.case(f"plot refuses {name}"):
            expect_refusal(run("plot", *arguments), status, *words)
    with suite.case("plot: rows of OFF, FAULT and ESTOP do not stretch its axes"):
        scales_by_what_has_limits()
    with suite.case("plot without matplotlib says how to install it"):
        (FOLDER / "without").mkdir()
        (FOLDER / "without/matplotlib.py").write_text("raise ImportError('not here')\n", encoding="ascii")
        result = run("plot", trace, PYTHONPATH=str(FOLDER / "without"))
        expect_refusal(result, 1, "apt-get install python3-matplotlib", "pip install matplotlib")
        assert len(result.stderr.splitlines()) == 1, result.stderr
    with suite.case("plot draws a PNG of two traces with limits, frames and requests"):
        if not has("matplotlib"):
            raise tap.Skip("matplotlib is not installed")
        config = write("platform.ini", ini())
        frames = write("fine.frames", "; a comment\n10 @A6:0,0,0,0,0,99999,0#\n20 !hold\n30 @C6T:1,2,3,4,5,6,500#\n")
        result = run("plot", trace, trace, "--axes", "z,roll,c1", "--config", config, "--frames", frames, "-o", "two.png")
        assert result.returncode == 0, result.stderr
        assert (FOLDER / "two.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
        for what, words in (("limits", ("--config", config)), ("spectrum", ())):
            long = write("long.csv", "".join([HEADER + "\n", *(row(t, 10**9 + t * t * 1000) for t in range(600))]))
            result = run("plot", long, "--what", what, "-o", f"{what}.png", *words)
            assert result.returncode == 0 and (FOLDER / f"{what}.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n", result.stderr
            expect_refusal(run("plot", trace, "--what", "spectrum"), 1, "48 rows", "256")
    with suite.case("plot makes an animation of an incident, from what lies in its folder"):
        incident = FOLDER / "incident-000001-20260101T000000Z"
        incident.mkdir()
        for name, text in (("trace.csv", Path(FOLDER / trace).read_text(encoding="ascii")), ("platform.ini", ini()), ("frames", "10 @A6:0,0,0,0,0,5,0#\n")):
            (incident / name).write_text(text, encoding="utf-8")
        result = run("plot", incident, "-o", "ride.html")
        assert result.returncode == 0 and f"<title>{incident.name}</title>" in (FOLDER / "ride.html").read_text(encoding="utf-8"), result.stderr
        result = run("plot", incident, "--what", "animation")
        assert result.returncode == 0 and (incident / "trace.html").exists(), result.stderr
    with suite.case("plot and bench tell how they are used"):
        for tool, arguments in (("plot", ("--help",)), ("bench", ("--help",)), ("bench", ("motion", "--help")), ("bench", ("cost", "--help"))):
            result = run(tool, *arguments)
            assert result.returncode == 0 and "usage:" in result.stdout, f"{tool} {arguments}: {result.stdout}{result.stderr}"


def check_window(suite):
    with suite.case("rates are exact differences, and a window knows the rows before it"):
        positions = [random.Random(1).randrange(-10**12, 10**12) for _ in range(40)]
        rows = [row(t, z) for t, z in enumerate(positions)]
        for start in (0, 1, 2, 3, 17):
            part = window(rows, start * 1000)
            for order, weights in enumerate(((1,), (1, -1), (1, -2, 1), (1, -3, 3, -1))):
                rates = part.rates("z", order)
                for i, value in enumerate(rates):
                    at = start + i
                    expected = sum(w * positions[at - k] for k, w in enumerate(weights)) * 1000**order / NANO if at >= order else None
                    is_same = value == expected or (value is not None and expected is not None and math.isclose(value, expected, rel_tol=1e-14))
                    assert is_same, f"order {order}, row {at}: {value}, expected {expected}"
    with suite.case("rates are unknown across missing rows, and known again behind them"):
        times = [0, 1, 2, 3, 4, 9, 10, 11, 12, 13]
        part = window([row(t, 7 * t**2) for t in times])
        for order in range(4):
            unknown = [t for t, value in zip(times, part.rates("z", order)) if value is None]
            assert unknown == [t for run_start in (0, 9) for t in range(run_start, run_start + order)], f"order {order}: {unknown}"
    with suite.case("states and flags become bands"):
        texts = [("NEUTRAL", ""), ("ENGAGED", "takeover"), ("ENGAGED", "takeover|clamped"), ("ENGAGED", "clamped"), ("ENGAGED", ""),
                 ("HOLD", "clamped")]
        part = window([row(t, state=state, flags=flags) for t, (state, flags) in enumerate(texts)])
        assert part.state_bands() == [("NEUTRAL", 0, 1000), ("ENGAGED", 1000, 5000), ("HOLD", 5000, 6000)], part.state_bands()
        assert part.flag_bands() == {"takeover": [(1000, 3000)], "clamped": [(2000, 4000), (5000, 6000)]}, part.flag_bands()
    with suite.case("a window ends where it was told to"):
        part = window([row(t) for t in range(20)], 5000, 9000)
        assert part.times_us == [5000, 6000, 7000, 8000, 9000], part.times_us
    with suite.case("traces as the checker's tests make them are read"):
        trace = Trace()
        trace.pose("NEUTRAL", (1, 2, 3, 4, 5, 6))
        trace.repeat(9)
        part = Window(trace.lines())
        assert part.column("z") == [6 * NANO] * 10 and part.is_used("roll") and not part.is_used("angle")
    with suite.case("a header of another program is refused"):
        try:
            Window(["t,z\n"])
        except TraceError as error:
            assert "line 1" in str(error)
        else:
            raise AssertionError("accepted")
    with suite.case("thinning keeps every peak, both ends and every gap"):
        values = [math.sin(i / 500) for i in range(20000)]
        values[7777], values[12345] = 9.0, -9.0
        values[15000:15003] = [None] * 3
        times, kept = thinned(list(range(20000)), values, 1000)
        assert len(times) <= 1000 + 3, len(times)
        assert all(values[t] == value for t, value in zip(times, kept)), "points were moved"
        assert times == sorted(times) and times[0] == 0 and times[-1] == 19999
        assert 9.0 in kept and -9.0 in kept and None in kept
    with suite.case("axes are named one by one and in groups, each once"):
        assert axes_named("z,pose") == ["z", "roll", "pitch", "yaw", "x", "y"]
        assert axes_named("c1_mm, angle_deg") == ["c1", "angle"]


def check_dots(suite):
    platform = Configuration(write("dots.ini", ini()))
    frames = [Line(1000, "@A6:1,2,3,4,5,6,F0#"), Line(2000, "!hold"), Line(3000, "@C6T:1,2,3,4,5,6,500#@A3:1,2,3#\r\n"),
              Line(4000, "@A6:1,2,x,4,5,6,0#"), Line(5000, "@A6T:1,2,3,4,5,6#"), Line(6000, "@A6:1,2#")]
    with suite.case("well-formed frames become dots, others do not"):
        dots = dots_of(frames)
        assert [(dot.t_us, dot.is_timed) for dot in dots] == [(1000, False), (3000, True), (3000, False)], dots
        assert dots[0].values == {"roll": 1, "pitch": 2, "yaw": 3, "x": 4, "y": 5, "z": 6}
        assert dots[1].values["c6"] == 6 and dots[2].values == {"roll": 1, "pitch": 2, "z": 3}
    with suite.case("with a platform, poses tell where the cylinders should be"):
        dots = dots_of(frames, platform)
        for name, extension in zip(("c1", "c2", "c3", "c4", "c5", "c6"), platform.extensions([1, 2, 3, 4, 5, 6])):
            expect_near(dots[0].values[name], extension, 1e-12, name)
        expect_near(dots[2].values["c1"], platform.extensions([1, 2, 0, 0, 0, 3])[0], 1e-12, "A3")


# ---- tools/bench ----
def check_cortex(suite):
    with suite.case("bench cortex: ticks are counted in those of a million instructions, without the loop's own"):
        program = Path(write("emulator", ""))
        said = "runs 64\\ncalibration 25000\\nnothing 16\\ninverse-heave 816\\ninverse-double 8016\\nforward-heave 32\\nforward-double 48\\n"
        emulator = Path(write("qemu-system-arm", f"#!/bin/sh\nprintf '{said}'\n"))
        emulator.chmod(0o755)
        before = os.environ["PATH"]
        os.environ["PATH"] = f"{emulator.parent}:{before}"
        try:
            rows = bench_cortex.count(program)
        finally:
            os.environ["PATH"] = before
        expect_near(rows["inverse"]["heave"], 800 * 40 / 64, 1e-9, "instructions")
        assert "500 instructions; 10.0 x as many in double, 5000; goal 10: met" in bench_cortex.line_of("cortex-m3", "inverse", rows["inverse"])


def latency_run(count, stalls=(), **odd):
    """A run of bench_latency: frames 400 ms apart, the nth one 2000 + n us to the first set-point; odd: columns of the first so many frames."""
    frames = []
    for n in range(count):
        sent = 1e6 + 400_000 * n
        frame = [sent, sent + 30, sent + 2000 + n, sent + 3000 + n, sent + 1500, sent + 5500, 50.0]
        for column, (many, change) in odd.items():
            at = getattr(bench_latency, column)
            frame[at] = frame[at] + change if n < many else frame[at]
        frames.append(frame)
    return {"frames": frames, "stalls": [[1e6 + 400_000 * n + after, 1e6 + 400_000 * n + until] for n, after, until in stalls], "is_urgent": True, "is_realtime": True,
            "heaved_us": {"count": count, "p50_us": 500, "p99_us": 990, "max_us": 1000}}


def latency_of(*runs, kind="can", stolen=0, stops=(), is_uml=False, is_virtual=False):
    return {"is_virtual": is_virtual, **bench_latency.judge(kind, {"runs": [*runs], "stops": [*stops], "is_uml": is_uml}, stolen)}


def check_latency(suite):
    whole, first = "on the bus: to the last of six set-points", "of it from there to the first set-point"
    with suite.case("bench latency: mean and percentiles of each part of the way"):
        result = latency_of(latency_run(1000))
        assert result["us"][whole] == {"mean": 3499.5, "p50": 3499, "p99": 3989, "p99.9": 3998, "max": 3999}, result["us"]
        assert result["us"][first]["p50"] == 999 and result["doubt"] is None and result["left_out"] == 0, result
        assert re.search(r"six set-points +3500 +3499 +3989 +3998 +3999", "\n".join(bench_latency.lines_of("can", result)))
    with suite.case("bench latency: on the bus adds up from its parts, frame by frame"):
        result = latency_of(latency_run(10, BEGUN=(10, -1600)))  # the SYNC went 100 us before the frame: it has not waited
        means = [figures["mean"] for figures in result["us"].values()]
        assert means[1] == 0 and means[0] == sum(means[1:4]), means
    with suite.case("bench latency: frames beside a stall, and those whose sender was held up, are left out and counted"):
        stalls = [(5, -500, 100), (7, 11_000, 13_000), (9, 2000, 2600), (15, -900, -200), (11, 12_500, 20_000), (13, -9000, -1500)]  # the last two are far enough off
        result = latency_of(latency_run(100, stalls, LATE=(2, 1000)), latency_run(100, RETURNED=(3, 600)))
        assert (result["frames"], result["left_out"], result["doubt"]) == (200, 9, None), result
        assert "191 frames, 9 left out" in "\n".join(bench_latency.lines_of("can", result))
    with suite.case("bench latency: a stall counts for the run that it was in alone"):
        assert latency_of(latency_run(20, [(3, 0, 600)]), latency_run(20))["left_out"] == 1
    with suite.case("bench latency: what was left out is in no percentile"):
        result = latency_of(latency_run(1000, [(990, 0, 1000)], LAST=(1, 90_000), LATE=(1, 5000)))
        assert result["us"][whole]["max"] == 3999 and result["left_out"] == 2, result
    with suite.case("bench latency: no percentile of fewer frames than it takes"):
        for count, known in ((99, ["mean", "p50", "max"]), (300, ["mean", "p50", "p99", "max"]), (999, ["mean", "p50", "p99", "max"]), (1000, ["mean", *bench_latency.PER_MILLE])):
            result = latency_of(latency_run(count))
            assert [*result["us"][whole]] == known, (count, result["us"][whole])
        assert re.search(r"six set-points +3049 +3049 +- +- +3098", "\n".join(bench_latency.lines_of("can", latency_of(latency_run(99)))))
    with suite.case("bench latency: where too many frames were left out, or the CPU was stolen, there is no figure"):
        for result in (latency_of(latency_run(100, LATE=(11, 1500))), latency_of(latency_run(100, LATE=(100, 1500))), latency_of(latency_run(100), stolen=0.06)):
            (_, line) = bench_latency.lines_of("can", result)
            assert "spread too wide" in line and "no figure" in line and re.search(r"\b(11|100|6)%", line), line
        assert latency_of(latency_run(100, LATE=(10, 1500)))["doubt"] is None
    with suite.case("bench latency: says what has to be known of the figures"):
        assert not bench_latency.notes_of(latency_of(latency_run(10)))
        for result, word in ((latency_of(latency_run(10), is_uml=True), "upper bounds"), (latency_of(latency_run(10), stops=["bus-lost"]), "bus-lost"),
                             (latency_of({**latency_run(10), "is_realtime": False}), "as root")):
            (note,) = bench_latency.notes_of(result)
            assert word in note, note
        assert not bench_latency.notes_of(latency_of({**latency_run(10), "is_urgent": False}, is_uml=True, is_virtual=True))
    with suite.case("bench latency: a drive that is missing is named"):
        status = {"state": "OFF", "fault": {"name": "none"}, "cylinders": [{"drive": "offline" if number == 3 else "disabled"} for number in range(1, 7)]}
        assert "drive 3 is offline, the others are disabled" in latency_runs.trouble_of("drives", status)
    with suite.case("bench latency: heaved that stops is excused by a machine that stood alone"):
        status = {"state": "FAULT", "fault": {"name": "bus-lost"}, "cylinders": [{"drive": "fault"}] * 6}
        lines = ["frame 1000000 1 2 3 4 5 6", "lost 1400000"]
        assert latency_runs.excuse([*lines, "stall 1405000.0 1420000.0"], status) == "bus-lost"
        for stalls in ([], ["stall 900000.0 999000.0"], ["stall 9900000.0 9901000.0"]):
            try:
                latency_runs.excuse([*lines, *stalls], status)
            except latency_runs.LatencyError as error:
                assert "bus-lost" in str(error) and "did not stand" in str(error), error
            else:
                raise AssertionError(f"excused by {stalls}")
    with suite.case("bench latency: without a kernel that has CAN it says what to do"):
        before = os.environ.get("XDG_CACHE_HOME")
        os.environ["XDG_CACHE_HOME"] = str(FOLDER / "no-cache")
        try:
            bench_latency.run_part("can-design", "heaved", "drives", 1)
        except bench_latency.LatencyError as error:
            assert "tools/heave-lab build" in str(error) and "modprobe vcan" in str(error), error
        else:
            raise AssertionError("measured without a kernel")
        finally:
            if before is None:
                del os.environ["XDG_CACHE_HOME"]
            else:
                os.environ["XDG_CACHE_HOME"] = before


def check_bench_arguments(suite):
    refusals = {
        "an option of no subcommand": (("--speed",), 2, "--speed"),
        "a part that is none": (("--only", "inverse,backward"), 2, "'backward'", "parse-document"),
        "too few rounds": (("peers", "--rounds", "4"), 2, "from 5"),
        "an older result that is not there": (("--compare", "nowhere.json"), 1, "nowhere.json"),
        "an older result that is another file": (("peers", "--compare", write("other.json", '{"rates": []}')), 1, "other.json", "tools/bench peers --json"),
        "an older result that is no JSON": (("peers", "--compare", write("bad.json", "ratio")), 1, "bad.json"),
        "an unknown one": (("speed",), 2, "speed"),
        "a rate that is no number": (("motion", "--rates", "60,fast"), 2, "60,fast"),
        "a rate out of range": (("motion", "--rates", "60,1"), 2, "from 10 to 200"),
        "a record too short": (("motion", "--seconds", "5"), 2, "from 12"),
        "a pattern that is none": (("senders", "--only", "(ride"), 2, "'(ride'"),
        "a ride that there is not": (("senders", "--only", "no such ride", "--no-ruckig", "--program", "/bin/false"), 1, "no such ride", "--list"),
        "heaved that fails in a ride": (("senders", "--only", "limits: six axes, 0.6", "--no-ruckig", "--program", "/bin/false"), 1, "status 1"),
        "no rounds": (("cost", "--rounds", "0"), 2, "from 1"),
        "too few frames": (("latency", "--frames", "9"), 2, "from 10"),
        "a part of the latency that is none": (("latency", "--only", "can,lin"), 2, "'lin'", "modbus-design"),
        "rounds where instructions are counted": (("cortex", "--rounds", "5"), 2, "--rounds"),
        "a program that is not there": (("motion", "--program", "nowhere"), 1, "nowhere"),
        "a program that is another one": (("cost", "--program", "/bin/false"), 1, "false"),
        "heaved that fails": (("motion", "--no-ruckig", "--seconds", "12", "--program", "/bin/false"), 1, "status 1"),
    }
    for name, (arguments, status, *words) in refusals.items():
        with suite.case(f"bench refuses {name}"):
            expect_refusal(run("bench", *arguments), status, *words)


def sines(t):
    return 20 * math.sin(2 * math.pi * 0.31 * t) + 3 * math.sin(2 * math.pi * 1.7 * t + 1)


def check_analysis(suite):
    count = 12000
    for lag_ms in (-12.3, 0, 0.4, 40.0, 40.37, 113.9, 501.5):
        with suite.case(f"a delay of {lag_ms} ms is found to 2 us"):
            lag, shape = analysis.lag_and_shape([sines(k / 1000 - lag_ms / 1000) for k in range(count)], sines)
            expect_near(1000 * lag, lag_ms, 0.002, "lag in ms")
            assert shape < 1e-3, f"shape {shape} mm"
    with suite.case("shape is what remains beside the delay: noise and a foreign sine"):
        chance = random.Random(5).random
        noisy = [sines(k / 1000 - 0.0333) + 0.2 * (chance() - 0.5) for k in range(count)]
        lag, shape = analysis.lag_and_shape(noisy, sines)
        expect_near(1000 * lag, 33.3, 0.2, "lag in ms")
        expect_near(shape, 0.2 / math.sqrt(12), 0.003, "shape")
        shaken = [sines(k / 1000 - 0.0333) + 0.5 * math.sin(2 * math.pi * 60 * k / 1000) for k in range(count)]
        lag, shape = analysis.lag_and_shape(shaken, sines)
        expect_near(1000 * lag, 33.3, 0.2, "lag in ms")
        expect_near(shape, 0.5 / math.sqrt(2), 0.005, "shape")
    with suite.case("rates of a sine are those of calculus"):
        rate = 2 * math.pi * 1.5
        record = [4 * math.sin(rate * k / 1000) for k in range(6000)]
        for order in (1, 2, 3):
            expect_near(max(analysis.rates(record, order)), 4 * rate**order, 4 * rate**order * 1e-4, f"peak of order {order}")
            expect_near(analysis.rms(analysis.rates(record, order)), 4 * rate**order / math.sqrt(2), 4 * rate**order * 1e-3, f"RMS of order {order}")
    with suite.case("the power of a band is that of the sines in it"):
        sine = lambda size, hertz, k: size * math.sin(2 * math.pi * hertz * k / 1000)  # noqa: E731  a shorter name for what follows
        mixed = [sine(1000, 0.9, k) + sine(3, 60.2, k) + sine(5, 45, k) for k in range(20000)]
        expect_near(analysis.band_power(mixed, 56, 64), 3**2 / 2, 0.02, "60 Hz")
        expect_near(analysis.band_power(mixed, 41, 49), 5**2 / 2, 0.05, "45 Hz")
        expect_near(analysis.decibel(analysis.band_power(mixed, 56, 64), 4.5), 0, 0.02, "dB")
    with suite.case("too short a record for a spectrum is refused"):
        try:
            analysis.band_power([0.0] * 100, 56, 64)
        except ValueError:
            pass
        else:
            raise AssertionError("accepted")
    check_optimum(suite)
    check_settling(suite)


def distance_in(time, speed, accel, jerk, pieces=20000):
    """How far from rest to rest in a time with three limits: numerically, each half of a move as steep as the limits allow."""
    low, high = 0.0, time / 2  # of the time spent getting faster; the rest of the half cruises
    for _ in range(60):
        ramp = (low + high) / 2
        peak = ramp * ramp * jerk / 4 if ramp <= 2 * accel / jerk else accel * (ramp - accel / jerk)
        low, high = (ramp, high) if peak < speed else (low, ramp)
    ramp, step, v, x = low, low / pieces, 0.0, 0.0
    for i in range(pieces):
        t = (i + 0.5) * step
        v_next = v + min(jerk * t, accel, jerk * (ramp - t)) * step
        x += (v + v_next) / 2 * step
        v = v_next
    return 2 * (x + v * (time / 2 - ramp))


def check_optimum(suite):
    with suite.case("the time optimum is the known one"):
        expect_near(analysis.time_optimum(100, 400, 3000, 50000), 0.25 + 0.4 / 3 + 0.06, 1e-12, "100 mm, all limits reached")
        expect_near(analysis.time_optimum(10, 400, 3000, 50000), 0.185664, 1e-6, "10 mm, jerk alone")
        expect_near(analysis.time_optimum(-10, 400, 3000, 50000), 0.185664, 1e-6, "the other way")
    with suite.case("in the time optimum the limits allow just that way"):
        for limits in ((400, 3000, 50000), (400, 3000, 5000), (30, 3000, 50000), (400, 300, 50000)):
            for way in (0.01, 1, 10, 21.6, 40, 77, 100, 3000):
                time = analysis.time_optimum(way, *limits)
                expect_near(distance_in(time, *limits) / way, 1, 2e-4, f"way in {time:.4f} s with {limits}, in {way} mm")
    with suite.case("to within 1 um it is earlier by the last piece of full jerk"):
        saved = analysis.time_optimum(10, 400, 3000, 50000) - analysis.time_optimum_within(10, 400, 3000, 50000)
        expect_near(50000 * saved**3 / 6, 0.001, 1e-9, "way left")


def check_settling(suite):
    with suite.case("settling counts from the cycle before the first that could move"):
        record = [0.0] * 10 + [0.5, 0.9, 0.9995, 1.0015, 1.0002, 1.0] + [1.0] * 20
        cycles, beyond = analysis.settling(record, 10, len(record), 1.0)
        assert cycles == 5, cycles  # 14 is the first within 1 um for good; 9 the start
        expect_near(beyond, 0.0015, 1e-12, "overshoot")
    with suite.case("settling downwards, and never"):
        assert analysis.settling([0.0, 0.0, -1.0, -1.0, -1.0], 2, 5, -1.0) == (1, 0.0)
        assert analysis.settling([0.0, 0.0, 0.5, 0.6, 0.7], 2, 5, 1.0)[0] is None


def check_signals(suite):
    signal = signals.Cue(30, 7)
    values = [signal.at(k / 100) for k in range(3001)]
    with suite.case("the signal stays on its axis, uses it, and rests at both ends"):
        assert max(map(abs, values)) <= signals.HALF_RANGE_MM + 1 and max(map(abs, values)) > signals.HALF_RANGE_MM / 2, max(map(abs, values))
        assert values[0] == values[-1] == 0 and abs(values[1]) < 1e-3 and abs(values[-2]) < 1e-3
    with suite.case("the same seed gives the same arrivals, another one others"):
        arrivals, lost = signals.stream(signal, 60, 30, 7)
        assert (arrivals, lost) == signals.stream(signals.Cue(30, 7), 60, 30, 7)
        assert arrivals != signals.stream(signal, 60, 30, 8)[0]
    with suite.case("arrivals: jitter, losses and decimals are as stated"):
        arrivals, lost = signals.stream(signal, 60, 30, 7)
        assert len(arrivals) + lost == 30 * 60 + 1 and 3 <= lost <= 45, lost
        late = [t_us - 1e6 / 60 * math.floor((t_us - signals.NETWORK_US + 1) * 60 / 1e6) for t_us, _ in arrivals]
        low, high = signals.NETWORK_US, signals.NETWORK_US + signals.JITTER_US
        assert min(late) >= low - 1 and max(late) <= high + 1 and max(late) - min(late) > 0.9 * (high - low), (min(late), max(late))
        assert all(len(text.split(".")[1]) == 3 for _, text in arrivals)
    with suite.case("a hold knows the newest value that has arrived, that of the cycle included"):
        assert signals.held([(0, "1"), (1500, "2"), (3000, "3")], 5) == [1, 1, 2, 3, 3]
        assert signals.held([(0, "1,7,4"), (1500, "2,8,5")], 3, axis=1) == [7, 7, 8]
    with suite.case("steps start from rest and go where they should"):
        arrivals, moves = signals.steps((1.0, 100.0))
        assert [(start, end) for _, start, end in moves] == [(0, 1), (-50, 50)]
        assert [text for _, text in arrivals] == ["0.000", "1.000", "-50.000", "50.000"]
    with suite.case("FRAMES are written as heaved reads them"):
        six, _ = signals.stream(signals.six_axes(30, 7), 60, 30, 7)
        alone, _ = signals.stream(signals.Cue(30, 7), 60, 30, 7)
        assert [(t_us, text.split(",")[5]) for t_us, text in six] == alone and all(text.count(",") == 5 for _, text in six)
        assert all(max(abs(float(text.split(",")[k])) for _, text in six) > 0.3 * half for k, half in enumerate(signals.AXES_HALF))
        signals.write_frames(FOLDER / "six.frames", [(0, "1.0,2.0,3.0,4.0,5.0,6.0")], 0)
        assert (FOLDER / "six.frames").read_text(encoding="ascii") == "0.000 @A6:1.0,2.0,3.0,4.0,5.0,6.0,0#\n"
        signals.write_frames(FOLDER / "some.frames", [(0, "0.000"), (16667, "-1.500")], 2_500_000)
        assert (FOLDER / "some.frames").read_text(encoding="ascii") == "2500.000 @A6:0,0,0,0,0,0.000,0#\n2516.667 @A6:0,0,0,0,0,-1.500,0#\n"


def check_rival(suite):
    chance = random.Random(11).random
    targets = []
    while len(targets) < 6000:
        targets += [100 * (chance() - 0.5)] * (1 + int(600 * chance()))
    record = two_limits(targets, 400, 3000, 0.001)
    with suite.case("the limiter of two limits keeps them"):
        assert max(map(abs, analysis.rates(record, 1))) <= 400 * (1 + 1e-9)
        assert max(map(abs, analysis.rates(record, 2))) <= 3000 * (1 + 1e-6)
    with suite.case("... and takes the shortest time that they allow, without overshoot to speak of"):
        for way in (0.5, 10, 100):
            record = two_limits([0.0] * 2 + [way] * 1500, 400, 3000, 0.001)
            cycles, beyond = analysis.settling(record, 2, len(record), way)
            best = 2 * math.sqrt(way / 3000) if way < 400**2 / 3000 else way / 400 + 400 / 3000
            expect_near(cycles, 1000 * best, 3, f"ms for {way} mm")
            assert beyond < 0.002, f"{way} mm: {beyond} mm beyond"
    arrivals = [(100.0 * k, [3.0 * k]) for k in range(20)]
    with suite.case("the held value, and the straight line to it in the usual time"):
        assert bench_senders.held(arrivals, 0, 250)[99:201:50] == [0, 3, 3] and bench_senders.held(arrivals, 0, 250)[-1] == 6
        line = bench_senders.interpolated(arrivals, 0, 2000)
        expect_near(max(abs(value - max(0, 0.03 * (cycle - 100))) for cycle, value in enumerate(line)), 0, 1e-9, "the distance from the line, a period late")
    with suite.case("the low-pass is late by its two poles, and its speed is right"):
        made = bench_senders.low_pass([0.03 * cycle for cycle in range(2000)])
        expect_near(made[-1] - made[-2], 0.03, 1e-9, "the step")
        expect_near(1999 - made[-1] / 0.03, 2000 / (2 * math.pi * bench_senders.POLES_HZ), 1.5, "the lag in ms")


def times_of(own, peer, rounds=101):
    """Rounds of two candidates: their time with its noise in both, as on a machine whose speed drifts."""
    chance = random.Random(3).random
    drift = [1 + 0.5 * chance() for _ in range(rounds)]
    return {"heave": [own * part for part in drift], "sscanf": [peer * part * (1 + 0.02 * chance()) for part in drift]}


def subject_of(times, stolen=0.0, instructions=100):
    row = {"stolen": stolen, "candidates": bench_peers.judge(list(times), {"sscanf": {"off": 3, "of": 70}}, times)}
    for candidate in row["candidates"].values():
        candidate["instructions"] = instructions
    return row


def result_of(times, **options):
    return {"date": "2026-11-01 10:00", "processor": "a processor", "subjects": {"parse-3": subject_of(times, **options)}}


def check_peers(suite):
    with suite.case("bench peers judges by the ratios of rounds: a machine whose speed drifts does not matter"):
        row = subject_of(times_of(100, 810))
        ratio = row["candidates"]["sscanf"]["ratio"]
        expect_near(ratio["median"], 8.1 * 1.01, 0.05, "ratio")
        assert bench_peers.spread(row["candidates"]["heave"]["ns"]) > 0.15, "the times themselves drift"
        lines = bench_peers.subject_lines("parse-3", row)
        assert lines[1].split()[:2] == [f"{ratio['median']:.2f}", "x"] and "goal 8: met" in lines[1] and "3 of 70 values not the nearest" in lines[1], lines
        assert "goal 8: missed" in bench_peers.subject_lines("parse-3", subject_of(times_of(100, 700)))[1]
    with suite.case("bench peers gives no figure where the spread is too wide, and says why"):
        times = times_of(100, 800)
        times["sscanf"] = [value * (1 if i % 2 else 1.3) for i, value in enumerate(times["sscanf"])]
        line = bench_peers.subject_lines("parse-3", subject_of(times))[1]
        assert "spread too wide (quartiles" in line and "goal" not in line and "ns" not in line.split(";")[0].split("instructions")[0], line
        line = bench_peers.subject_lines("parse-3", subject_of(times_of(100, 800), stolen=0.06))[1]
        assert "6% of the CPU stolen" in line and "goal" not in line, line
        assert bench_peers.doubt({"q25": 93.0, "median": 100.0, "q75": 107.0}, 0.05) is None
    with suite.case("bench peers tells the time of platforms and how many fit, or that it cannot"):
        cycles = bench_peers.CYCLES
        drifting = [1 + i / 100 for i in range(20)]  # the machine's speed
        steady = {f"of-{count}": [2000.0 * cycles * (1 + count / 640) * drift for drift in drifting] for count in (1, 2, 64)}
        lines = bench_peers.platform_lines({"stolen": 0, "candidates": bench_peers.judge(list(steady), {}, steady)})
        assert "goal below 5000 ns: met" in lines[1] and lines[3].split()[1:3] == ["1.10", "x"] and lines[-1].split()[:3] == ["398", "to", "434"], lines
        slow = {name: [3 * value for value in values] for name, values in steady.items()}
        assert "goal below 5000 ns: missed" in bench_peers.platform_lines({"stolen": 0, "candidates": bench_peers.judge(list(slow), {}, slow)})[1]
        unsteady = {name: [value * (1 + i % 4 / 5) for i, value in enumerate(values)] for name, values in steady.items()}
        lines = bench_peers.platform_lines({"stolen": 0, "candidates": bench_peers.judge(list(unsteady), {}, unsteady)})
        assert "goal" not in lines[1] and lines[3].split()[1:3] == ["1.10", "x"], lines
        assert "no figure" in bench_peers.platform_lines({"stolen": 0.06, "candidates": bench_peers.judge(list(slow), {}, slow)})[1]
        steady["of-64"] = [value * (1 + i % 2) for i, value in enumerate(steady["of-64"])]
        lines = bench_peers.platform_lines({"stolen": 0, "candidates": bench_peers.judge(list(steady), {}, steady)})
        assert "no figure" in lines[-1] and "fit" not in " ".join(lines), lines
    with suite.case("bench --compare tells changes beyond the spread from others"):
        old = result_of(times_of(100, 800))
        text = "\n".join(bench_peers.comparison(old, result_of(times_of(80, 800))))
        assert "x before" in text and "(+25%, beyond the spread)" in text and "as many instructions" in text, text
        assert "within the spread" in "\n".join(bench_peers.comparison(old, result_of(times_of(100, 801))))
        assert "too wide to compare" in "\n".join(bench_peers.comparison(old, result_of(times_of(80, 800), stolen=0.5)))
        assert "100 instructions before, 90 now (-10.0%)" in "\n".join(bench_peers.comparison(old, result_of(times_of(80, 800), instructions=90)))
        del old["subjects"]["parse-3"]["candidates"]["sscanf"]
        assert "sscanf: not in the older result" in "\n".join(bench_peers.comparison(old, result_of(times_of(80, 800))))
    with suite.case("what was stolen counts against all time"):
        expect_near(bench_peers.stolen_share((10, 1000), (15, 1100)), 0.05, 1e-12, "share")
        assert bench_peers.stolen_share((0, 0), (0, 0)) == 0


def check_peers_program(suite, program, is_instrumented):
    counted = {"PATH": ""} if is_instrumented else {}  # valgrind does not run what a sanitizer has instrumented
    with suite.case("bench peers compares all results before it times them"):
        if not program:
            raise tap.Skip("no --bench-peers")
        subjects = bench_peers.listed(program)
        assert list(subjects) == list(bench_peers.SUBJECTS), subjects
        for name, candidates in subjects.items():
            if name != bench_peers.PLATFORMS:  # takes long to come up
                row = bench_peers.measured(program, name, candidates, 5, False)
                assert all(figures["ns"]["median"] > 0 for figures in row["candidates"].values()), row
        result = run("bench", "--program", program, "--rounds", 5, "--only", "inverse", "--json", **counted)
        figures = json.loads(result.stdout)
        assert list(figures["subjects"]) == ["inverse"] and "double" in figures["subjects"]["inverse"]["candidates"], figures
        compared = run("bench", "--program", program, "--rounds", 5, "--only", "inverse", "--compare", write("figures.json", result.stdout), **counted)
        assert compared.returncode == 0 and "against 20" in compared.stdout, compared.stderr


def check_programs(suite, heaved, bench_core):
    with suite.case("bench motion judges heaved"):
        if not heaved:
            raise tap.Skip("no --heaved")
        result = run("bench", "motion", "--no-ruckig", "--program", heaved, "--seconds", 16, "--rates", 60, "--json")
        assert result.returncode == 0, result.stderr
        figures = json.loads(result.stdout)
        methods = figures["streams"][0]["methods"]
        styles = {method for method in methods if method.startswith("heaved ")}
        assert "heaved smooth" in styles and set(methods) == styles | {"held, no limits", "two limits"}, set(methods)
        smooth, held = methods["heaved smooth"], methods["held, no limits"]
        assert figures["streams"][0]["cycles_judged"] == 10000
        assert held["line_db"] == 0 and smooth["line_db"] < -40, smooth
        assert held["lag_ms"] < smooth["lag_ms"] < 80 and smooth["shape_um"] < held["shape_um"], smooth
        limits = figures["limits"]
        assert smooth["jerk_peak_mm_s3"] <= limits["jerk_mm_s3"] + 4 and smooth["jerk_rms_of_true"] < held["jerk_rms_of_true"] / 100, smooth
        assert [move["to_mm"] - move["from_mm"] for move in figures["steps"]] == [1, 10, 100]
        assert all(move["methods"]["heaved smooth"]["settled_ms"] for move in figures["steps"]), figures["steps"]
        six = figures["six"][0]
        assert set(six["methods"]) == styles | {"two limits"} and six["frames"] == figures["streams"][0]["frames"], six
        # z of six axes moves as z alone does, and no axis lags behind the others
        both, row = six["methods"]["two limits"], six["methods"]["heaved smooth"]
        expect_near(both["lag_ms"], methods["two limits"]["lag_ms"], 1e-6, "the lag of z, of two limits")
        expect_near(row["lag_ms"], smooth["lag_ms"], 0.5, "the lag of z")
        expect_near(row["lag_ms_worst"], row["lag_ms"], 1, "the lag of the worst axis")
        assert row["shape_um"] <= 50 * row["shape_permille_worst"] + 1e-9 < held["shape_um"] and row["jerk_rms_of_true"] <= row["jerk_rms_of_true_worst"] < 10, row
    with suite.case("bench senders judges heaved and the others alike"):
        if not heaved:
            raise tap.Skip("no --heaved")
        result = run("bench", "senders", "--no-ruckig", "--program", heaved, "--only", "^near the limits: six axes, 0.6", "--json")
        assert result.returncode == 0, result.stderr
        (methods,) = json.loads(result.stdout).values()
        assert list(methods) == ["heaved smooth", "heaved balanced", "low-pass", "line, low-pass", "two limits"], methods
        smooth = methods["heaved smooth"]
        assert all(smooth["worst_mm"] < row["worst_mm"] and smooth["jerk_of_true"] < row["jerk_of_true"] for name, row in methods.items() if "heaved" not in name)
        expect_near(methods["low-pass"]["lag_ms"], 53 + 8 + 2, 5, "the lag of the low-pass")
    with suite.case("bench cost knows every subject of its program, and runs it"):
        if not bench_core:
            raise tap.Skip("no --bench-core")
        names = subprocess.run([bench_core], capture_output=True, text=True, check=True).stdout.split()
        assert names == list(bench_cost.SUBJECTS), names
        for name in names:
            row_of_figures = bench_cost.timed(bench_core, name, 20, 2)
            assert row_of_figures["ns_min"] > 0 and len(row_of_figures["single_ns"]) == 3, row_of_figures
    with suite.case("what the driver of CANopen drives costs is the bus period without the bus"):
        period = {"single_ns": {"p50": 5000}, "frames": 16, "instructions": 20000}
        wire = {"single_ns": {"p50": 1000}, "frames": 16, "instructions": 4000}
        line = bench_cost.can_summary(period, wire)
        for part in ("4000 ns", "0.10% of 4 ms", "250 ns, 1000 instructions a frame", "4.00 million frames/s", "carries 4000 frames/s"):
            assert part in line, line
        assert "instructions" not in bench_cost.can_summary({**period, "instructions": None}, {**wire, "instructions": None})
    with suite.case("a percentile is a value that was measured"):
        assert bench_cost.percentile([3, 1, 2], 95) == 3
        assert bench_cost.percentile(list(range(1, 101)), 95) == 95
        assert bench_cost.percentile([7], 5) == 7


def scales_by_what_has_limits():
    """A drive that stands 90 mm away, and a fault that takes the set-points to the drives: jumps of one cycle, to which no limit applies."""
    trace = Trace()
    for i in range(300):
        state = "OFF" if i < 50 else "ENGAGED" if i < 200 else "FAULT" if i < 250 else "ENGAGED"
        trace.pose(state, [0, 0, 0, 0, 0, 40.0 if state != "ENGAGED" else 5 * math.sin(i / 40)])
    window = Window(trace.lines())
    for order in range(4):
        low, high = window.extent(["z"], order)
        values = [value for value, state in zip(window.rates("z", order), window.states) if state == "ENGAGED" and value is not None]
        calm = sorted(map(abs, values))[len(values) * 9 // 10]
        assert low < high and max(abs(low), abs(high)) <= 2 * calm, (order, low, high, calm)
    assert Window(line for line in trace.lines() if "ENGAGED" not in line).extent(["z"], 1) is None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--heaved")
    parser.add_argument("--bench-core")
    parser.add_argument("--bench-peers")
    parser.add_argument("--instrumented", action="store_true", help="the programs have a sanitizer")
    arguments = parser.parse_args()
    suite = tap.Suite()
    for check in (check_plot_arguments, check_window, check_dots, check_bench_arguments, check_cortex, check_latency, check_analysis, check_signals, check_rival,
                  check_peers):
        check(suite)
    check_programs(suite, arguments.heaved, arguments.bench_core)
    check_peers_program(suite, arguments.bench_peers, arguments.instrumented)
    return suite.done()


if __name__ == "__main__":
    try:
        sys.exit(main())
    finally:
        for path in sorted(FOLDER.rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()
        FOLDER.rmdir()
