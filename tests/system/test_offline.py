#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_offline.py BIN - heaved without a socket: its command line, its exit codes, and offline runs."""
import os
import re
import subprocess
import sys
from pathlib import Path

import harness
import tap

TOP = Path(__file__).resolve().parents[2]
HEADER = "t_ms,state,roll_deg,pitch_deg,yaw_deg,x_mm,y_mm,z_mm,angle_deg,c1_mm,c2_mm,c3_mm,c4_mm,c5_mm,c6_mm,relays,flags"
NUMBER = re.compile(r"-?(0|[1-9]\d*)\.\d{9}")

STREAM = "; a stream\n" + "\n".join(f"{2500 + 20 * i} @A6:{i % 7}.5,-{i % 5}.25,0,0,0,{i % 9},F{i % 10}#" for i in range(100))

# arguments after --config FILE (unless they hold it), the exit code, and a piece of the message
USAGE = {
    "no configuration": (["--check"], 64, "--config FILE or --preset NAME is missing"),
    "an unknown option": (["--config", "{ini}", "--frobnicate"], 64, "unknown option: --frobnicate"),
    "an option without its value": (["--config"], 64, "needs a value"),
    "an argument too many": (["--config", "{ini}", "extra"], 64, "unexpected argument: extra"),
    "two modes at once": (["--config", "{ini}", "--check", "--play", "x"], 64, "only one of"),
    "record while playing": (["--config", "{ini}", "--play", "x", "--record", "y"], 64, "for running live"),
    "trace while checking": (["--config", "{ini}", "--check", "--trace", "x"], 64, "--trace is for"),
    "a socket path that is too long": (["--config", "{ini}", "--socket", "/" + "x" * 200], 64, "1 to 107"),
    "an EDS without a check": (["--config", "{ini}", "--eds", "x"], 64, "--eds is for --check"),
    "an EDS for other drives": (["--config", "{ini}", "--check", "--eds", "{empty}"], 78, "allowed for --eds: cia402"),
    "a missing EDS": (["--config", "{can}", "--check", "--eds", "/nonexistent.eds"], 66, "/nonexistent.eds: No such file"),
    "a DCF that is none": (["--config", "{ini}", "--import-dcf", "{wrong}", "--drive", "1"], 65, "wrong.txt:1: "),
    "a missing DCF": (["--import-dcf", "/nonexistent.dcf", "--drive", "all"], 66, "/nonexistent.dcf: No such file"),
    "a DCF of nobody": (["--import-dcf", "{dcf}"], 64, "whose file is it? --drive 1 to 6 or angle, or --drive all"),
    "a DCF of drive 7": (["--import-dcf", "{dcf}", "--drive", "7"], 64, "--drive is 1 to 6, angle or all"),
    "two DCFs of a drive": (["--drive", "1", "--import-dcf", "{dcf}", "{dcf}"], 64, "--drive is for --import-dcf with one file"),
    "seven DCFs": (["--import-dcf"] + ["{dcf}"] * 7, 64, "up to 6 files"),
    "a drive without a DCF": (["--config", "{ini}", "--check", "--drive", "1"], 64, "--drive and --partial are for --import-dcf"),
    "a DCF with something left out": (["--import-dcf", "{dcf}", "--drive", "angle"], 1, "drive.dcf: left out, each with a comment in the list: 0 that keys of [cia402] decide, 0 of the node, 1 that no list may write"),
    "the same, said to be right": (["--import-dcf", "{dcf}", "--drive", "angle", "--partial"], 0, "drive.dcf: left out"),
    "two DCFs": (["--import-dcf", "{dcf}", "--import-dcf", "{dcf}", "--partial"], 0, "drive.dcf: left out"),
    "two DCFs of different devices": (["--import-dcf", "{dcf}", "{other}"], 65, "other.dcf: VendorNumber and ProductNumber are of another device"),
    "a missing configuration": (["--config", "/nonexistent.ini", "--check"], 66, "/nonexistent.ini: No such file"),
    "a folder as configuration": (["--config", "/tmp", "--check"], 66, "/tmp: Is a directory"),
    "missing frames": (["--config", "{ini}", "--play", "/nonexistent.txt"], 66, "/nonexistent.txt: No such file"),
    "a trace that cannot be created": (["--config", "{ini}", "--play", "{empty}", "--trace", "/nonexistent/t.csv"], 73, "/nonexistent/t.csv: No such file"),
    "a trace that is a folder": (["--config", "{ini}", "--play", "{empty}", "--trace", "/tmp"], 73, "/tmp: Is a directory"),
    "a trace on a full disk": (["--config", "{ini}", "--play", "{empty}", "--trace", "/dev/full"], 74, "/dev/full: No space left"),
    "a record that cannot be created": (["--config", "{ini}", "--record", "/nonexistent/r.txt"], 73, "/nonexistent/r.txt: No such file"),
    "a bad configuration": (["--config", "{bad}", "--check"], 78, "bad.ini:"),
    "bad frames": (["--config", "{ini}", "--play", "{wrong}", "--trace", "{trace}"], 65, "wrong.txt:2: "),
    "a preset beside a configuration": (["--config", "{ini}", "--preset", "tripod"], 64, "--config or --preset, not both"),
    "a configuration beside a preset": (["--preset", "tripod", "--config", "{ini}"], 64, "--config or --preset, not both"),
    "a preset with a folder": (["--preset", "../tripod", "--check"], 64, "one of the names that --presets shows"),
    "a preset that is not there": (["--preset", "octopod", "--check"], 66, "octopod.ini: No such file"),
    "a template without a driver": (["--template", "hexapod"], 64, "--template needs a kind and a driver"),
    "a template of an unknown kind": (["--template", "octopod", "sim"], 64, "allowed: hexapod|tripod|tripod-3rps"),
    "a template of an unknown driver": (["--template", "tripod", "steam"], 64, "allowed: sim|cia402|can-raw|modbus-tcp|modbus-rtu"),
    "a template": (["--template", "tripod", "sim"], 0, ""),
    "help": (["--help"], 0, ""),
    "version": (["--version"], 0, ""),
    "check": (["--config", "{ini}", "--check"], 0, ""),
    "dump": (["--config", "{ini}", "--dump-config"], 0, ""),
}


def check_usage(bench, arguments, code, part):
    run = bench.heaved(*[argument.format(ini=bench.config, bad=bench.folder / "bad.ini", empty=bench.folder / "empty.txt",
                                         wrong=bench.folder / "wrong.txt", dcf=bench.folder / "drive.dcf", other=bench.folder / "other.dcf", can=harness.TOP / "config/hexapod-cia402.ini", trace=bench.folder / "never.csv") for argument in arguments])
    assert run.returncode == code, f"exit {run.returncode}: {run.stderr}"
    assert part in run.stderr, run.stderr
    if code not in (0, 1, 65, 78):
        assert re.fullmatch(r"heaved: [^\n]*\n", run.stderr), f"not one line: {run.stderr}"
    assert bool(run.stdout) == (code in (0, 1)), run.stdout
    assert not (bench.folder / "never.csv").exists(), "something was written"


def heavectl_presets(bench):
    return subprocess.run([bench.bin / "heavectl", "presets"], capture_output=True, text=True, timeout=60, check=False)


def check_presets(bench):
    """Those beside the program, without a word about where they are."""
    os.environ.pop("HEAVE_PRESETS", None)
    listed = bench.heaved("--presets")
    assert listed.returncode == 0 and re.search(r"(?m)^tripod +three cylinders of 250 mm stroke", listed.stdout), listed.stdout
    names = [line.split()[0] for line in listed.stdout.splitlines()]
    assert set(names) == {path.stem for path in (TOP / "config").glob("*.ini")}, names
    assert heavectl_presets(bench).stdout == listed.stdout
    for name in names:
        run = bench.heaved("--preset", name, "--check")
        assert run.returncode == 0 and run.stdout.startswith("platform "), run.stderr


def check_no_presets(bench):
    os.environ["HEAVE_PRESETS"] = "/nonexistent"
    for run, code in ((bench.heaved("--presets"), 66), (heavectl_presets(bench), 69)):
        assert run.returncode == code and "/nonexistent: No such file" in run.stderr, run.stderr


def check_rows(trace):
    text = trace.decode()
    assert text.startswith(HEADER + "\n") and text.endswith("\n")
    for index, row in enumerate(harness.rows_of(trace)):
        assert row["t_ms"] == f"{index}.000", row
        assert re.fullmatch(r"[0-9A-F]{4}", row["relays"]), row
        for name in HEADER.split(",")[2:15]:
            assert NUMBER.fullmatch(row[name]) and row[name] != "-0.000000000", row


def states_of(trace):
    states = []
    for row in harness.rows_of(trace):
        if not states or states[-1] != row["state"]:
            states.append(row["state"])
    return states


def run_cases(suite, bench):
    bench.file("bad.ini", bench.config.read_text().replace("stroke_mm = 200", "stroke_mm = nope"))
    bench.file("empty.txt", "")
    for name, product in (("drive.dcf", 1), ("other.dcf", 2)):
        bench.file(name, f"[DeviceInfo]\nVendorNumber=251\nProductNumber={product}\n[6040]\nDataType=6\nAccessType=rw\nParameterValue=15\n")
    bench.file("wrong.txt", "0 @A6:1,2,3,4,5,6,F0#\nx\n1 !fly\n")
    frames = bench.file("stream.txt", STREAM)
    for name, (arguments, code, part) in USAGE.items():
        with suite.case(f"command line, {name}: exit {code}"):
            check_usage(bench, arguments, code, part)
    with suite.case("presets are listed with what they are, by both programs, and each is valid"):
        check_presets(bench)
    with suite.case("without the folder of presets: its path, and why"):
        check_no_presets(bench)
    with suite.case("--dump-config loads to the same configuration"):
        once = bench.heaved("--config", bench.config, "--dump-config").stdout
        assert bench.heaved("--config", bench.file("dumped.ini", once), "--dump-config").stdout == once
    with suite.case("every bad line is reported and nothing runs"):
        run = bench.heaved("--config", bench.config, "--play", bench.folder / "wrong.txt")
        assert [line.split(": ")[0].rsplit(":", 1)[1] for line in run.stderr.splitlines()] == ["2", "3"], run.stderr
        assert all("; " in line for line in run.stderr.splitlines()), "says what is allowed"

    with suite.case("a trace has its header and a well-formed row per cycle"):
        check_rows(bench.play(frames))
    with suite.case("the same run gives the same bytes, to a file and to standard output"):
        first = bench.play(frames)
        assert bench.play(frames) == first
        run = bench.heaved("--config", bench.config, "--play", frames, "--trace", "-")
        assert run.stdout.encode() == first
    with suite.case("frames from standard input give the same bytes"):
        run = bench.heaved("--config", bench.config, "--play", "-", "--trace", "-", input=STREAM)
        assert run.stdout.encode() == bench.play(frames)
    with suite.case("without --trace there is a summary on standard error and nothing else"):
        run = bench.heaved("--config", bench.config, "--play", frames)
        assert run.returncode == 0 and run.stdout == "" and "100 frames accepted" in run.stderr, run.stderr
    with suite.case("engage = auto: it rises and engages by itself, and starts settled"):
        trace = bench.play(frames)
        assert states_of(trace)[:4] == ["SETTLED", "RISING", "NEUTRAL", "ENGAGED"], states_of(trace)
        assert harness.rows_of(trace)[0]["c1_mm"] == "5.000000000"
    with suite.case("rejected frames are counted by reason, with their time and reason"):
        run = bench.heaved("--config", bench.config, "--play", bench.file("rejects.txt", "10 @A6:1#\n20.5 hello\n"))
        assert "2 rejected" in run.stderr and "at 10.000 ms: " in run.stderr, run.stderr
    run_platforms(suite, bench)
    run_manual(suite, bench)


def sent_z(text, wanted_mm):
    """What a sender has to say for a height, on a platform with an offset."""
    offset = re.search(r"(?ms)^\[z\][^\[]*?^offset_mm *= *(-?[\d.]+)", text)
    return wanted_mm - (float(offset[1]) if offset else 0)


def run_platforms(suite, bench):
    for source in sorted((harness.TOP / "config").glob("*.ini")):
        with suite.case(f"{source.name} rises, follows frames and fills the columns it has"):
            text = re.sub(r"(?m)^engage = manual", "engage = auto", source.read_text(encoding="utf-8"))
            # every platform has these axes, and is up by then; a sender that falls silent would be held
            lines = "".join(f"{20000 + 100 * i} @A3:2,-1.5,{sent_z(text, 5):.3f},0#\n" for i in range(50))
            rows = harness.rows_of(bench.play(bench.file("a3.txt", lines), config=bench.file("ready.ini", text)))
            axes = [float(rows[-1][name]) for name in ("roll_deg", "pitch_deg", "z_mm")]
            assert rows[-1]["state"] in ("ENGAGED", "HOLD") and all(abs(a - b) < 1e-6 for a, b in zip(axes, (2, -1.5, 5))), rows[-1]
            moved = [any(row[f"c{i}_mm"] != "0.000000000" for row in rows) for i in range(1, 7)]
            assert moved == [True] * 3 + ["kind = hexapod" in text] * 3, moved


def run_manual(suite, bench):
    manual = bench.write_config("manual.ini", platform__engage="manual")
    with suite.case("engage = manual: without a request it stays settled"):
        assert states_of(bench.play(bench.folder / "stream.txt", config=manual)) == ["SETTLED"]
    with suite.case("engage = auto with auto_frames: it waits for a stream, and once only"):
        patient = bench.file("patient.ini", bench.config.read_text().replace("engage = auto", "auto_frames = 10\nengage = auto", 1))
        assert states_of(bench.play(bench.file("few.txt", "".join(f"{200 * i} @A6:1,0,0,0,0,0,0#\n" for i in range(50))), config=patient)) == ["SETTLED"]
        rows = harness.rows_of(bench.play(bench.file("many.txt", "".join(f"{100 + 20 * i} @A6:1,0,0,0,0,0,0#\n" for i in range(300))), config=patient))
        assert next(row["t_ms"] for row in rows if row["state"] == "RISING") == "281.000" and rows[-1]["state"] in ("ENGAGED", "HOLD")
    with suite.case("requests do what heavectl would"):
        text = "0.5 !engage\n4000 !hold\n5000 !resume\n6000 !park\n20000 !shutdown\n"
        states = states_of(bench.play(bench.file("requests.txt", text), config=manual))
        assert states == ["SETTLED", "RISING", "NEUTRAL", "ENGAGED", "HOLD", "ENGAGED", "SETTLING", "SETTLED", "OFF"], states
    with suite.case("an e-stop latches until it is released and reset"):
        text = "1 !engage\n500 !estop on\n600 !reset\n4000 !estop off\n4100 !reset\n"
        trace = bench.play(bench.file("estop.txt", text), config=manual)
        assert states_of(trace) == ["SETTLED", "RISING", "ESTOP", "OFF"], states_of(trace)
        rows = harness.rows_of(trace)
        assert rows[499]["state"] == "RISING" and rows[500]["state"] == "ESTOP" and "estop" in rows[500]["flags"].split("|")
        assert rows[4099]["state"] == "ESTOP" and rows[4101]["state"] == "OFF"
    with suite.case("a request that is refused is named, with its line and the state"):
        run = bench.heaved("--config", manual, "--play", bench.file("refused.txt", "1 !resume\n2 !park\n3 !intensity 100\n"))
        assert "1 requests refused" in run.stderr and "line 1: resume is refused in SETTLED" in run.stderr, run.stderr
    with suite.case("!late is counted in the flags of its row alone"):
        rows = harness.rows_of(bench.play(bench.file("late.txt", "5 !late 3\n"), config=manual))
        assert [row["t_ms"] for row in rows if "late" in row["flags"].split("|")] == ["5.000"]
    with suite.case("!from says who sends: one at a time is followed, and bad addresses are refused"):
        lines = "".join(f"{4000 + 20 * i} !from 192.168.7.{5 + i % 2}\n{4000 + 20 * i} @A6:{10 - 20 * (i % 2)},0,0,0,0,0,0#\n" for i in range(100))
        rows = harness.rows_of(bench.play(bench.file("two.txt", "1 !engage\n" + lines), config=manual))
        assert min(float(row["roll_deg"]) for row in rows) >= 0 and rows[-1]["roll_deg"] == "10.000000000", rows[-1]
        run = bench.heaved("--config", manual, "--play", bench.file("from.txt", "1 !from somebody\n2 !from 1.2.3.4 x\n3 !from ::1\n"))
        assert [line.split(": ")[0][-1] for line in run.stderr.splitlines()] == ["1", "2"], run.stderr
    with suite.case("the run goes on until the motion rests"):
        rows = harness.rows_of(bench.play(bench.file("one.txt", "1 !engage\n4000 @A6:10,0,0,0,0,0,0#\n"), config=manual))
        assert rows[-1]["roll_deg"] == "10.000000000" and float(rows[-1]["t_ms"]) > 4200, rows[-1]


def main():
    suite = tap.Suite()
    with harness.Bench(sys.argv[1]) as bench:
        run_cases(suite, bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
