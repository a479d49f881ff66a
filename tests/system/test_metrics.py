#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_metrics.py - the file for Prometheus, as Prometheus' own client library reads it, beside what heavectl says at the same time.

usage: test_metrics.py BIN; runs itself again with the Python of tools/lib/venv.sh, which has prometheus_client"""
import os
import re
import sys
import threading
import time

import harness
import tap

FRAMES = 20
FRAME = "@A7:5,3,2,10,0,5,30,005#"


def with_metrics(bench, path):
    text = bench.write_config("still.ini", udp__silence_hold_ms=0).read_text(encoding="utf-8")  # nothing changes by itself
    assert text.count("[control]\n") == 1
    return bench.file("metrics.ini", text.replace("[control]\n", f"[control]\nmetrics = {path}\n"))


def read(path):
    """{family: {labels: value}} by the peer; None while there is no file."""
    from prometheus_client.parser import text_string_to_metric_families  # noqa: PLC0415  only in the second run
    try:
        text = path.read_text(encoding="ascii")
    except FileNotFoundError:
        return None
    assert text.endswith("\n") and not re.search(r"^[^#\n]+ \S+ \d+$", text, re.MULTILINE), "collectors refuse times"
    families = list(text_string_to_metric_families(text))
    assert len({family.name for family in families}) == len(families), "a family is told twice"
    assert all(family.documentation and family.type in ("gauge", "counter", "summary") for family in families)
    return {sample.name: {} for family in families for sample in family.samples} | {
        name: {tuple(sorted(s.labels.items())): s.value for f in families for s in f.samples if s.name == name}
        for name in {s.name for f in families for s in f.samples}}


def says_what_the_status_says(bench):
    path = bench.folder / "heave.prom"
    daemon = bench.start(config=with_metrics(bench, path))
    bench.wait_state("ENGAGED")
    with bench.sender() as sender:
        for _ in range(FRAMES):
            sender.send(FRAME)
            time.sleep(0.02)
        sender.send("nonsense")
    harness.wait_for(lambda: abs(bench.status()["rotation"]["sent_deg"] - 30) < 1e-6, "the pose is reached")
    harness.wait_for(lambda: bench.status()["counters"]["rejected"]["no_head"] == 1, "the nonsense is counted")
    before = harness.wait_for(lambda: read(path), "it is written")["heave_cycles_total"][()]
    harness.wait_for(lambda: read(path)["heave_cycles_total"][()] > before + 1500, "the file is renewed")
    got, status = read(path), bench.status()
    assert got["heave_state"][(("state", status["state"]),)] == 1 and sum(got["heave_state"].values()) == 1, got["heave_state"]
    assert got["heave_udp_frames_total"][(("result", "accepted"), ("what", "A7"))] == status["counters"]["accepted"]["A7"] == FRAMES
    assert got["heave_udp_frames_total"][(("result", "rejected"), ("what", "no_head"))] == 1
    for name in ("sent", "actual"):
        values = [cylinder[f"{name}_mm"] for cylinder in status["cylinders"]] + [status["rotation"][f"{name}_deg"]]
        told = got[f"heave_axis_{name}"]
        assert [told[(("axis", str(i + 1)), ("unit", "mm" if i < 6 else "deg"))] for i in range(7)] == values, (told, values)
    assert len(got["heave_axis_following_error"]) == 7 and all(abs(e) < 1e-5 for e in got["heave_axis_following_error"].values())
    for name, key in (("speed", "speed_actual"), ("acceleration", "accel_actual")):  # the same axes, at rest
        told = {f"{dict(labels)['axis']}_{dict(labels)['unit'].replace('/', '_')}": value for labels, value in got[f"heave_plate_{name}"].items()}
        assert told.keys() == status[key].keys() and all(abs(value) < 1 for value in told.values()), (told, status[key])
    assert {int(dict(key)["relay"]) for key, on in got["heave_relay_on"].items() if on} == set(status["relays"]["on"]) and len(got["heave_relay_on"]) == 12
    assert got["heave_build_info"] == {(("build", status["build"]), ("configuration", status["configuration"]["hash"]), ("version", status["version"])): 1}
    assert got["heave_last_frame_age_seconds"][()] > 0 and got["heave_fault_code"][()] == 0 and got["heave_drive_enabled"][(("axis", "7"),)] == 1
    for name in ("heave_wake_latency_seconds", "heave_cycle_time_seconds", "heave_frame_latency_seconds"):
        shares = [got[name][(("quantile", q),)] for q in ("0.5", "0.99", "0.999", "0.9999", "1")]
        assert shares == sorted(shares) and 0 < shares[-1] < 60, shares
    assert bench.stop(daemon) == 0 and not path.exists(), "a gateway that has ended has no values"


def is_never_seen_in_part(bench):
    path, seen, is_over = bench.folder / "heave.prom", set(), threading.Event()

    def watch():
        while not is_over.is_set():
            if path.exists():
                seen.add(path.read_bytes())
    daemon = bench.start(config=with_metrics(bench, path))
    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        harness.wait_for(lambda: len(seen) > 2, "three different files")
    finally:
        is_over.set()
        watcher.join()
    assert all(text.startswith(b"# HELP heave_build_info") and b"\nheave_intensity_percent " in text for text in set(seen))
    assert bench.stop(daemon) == 0


def is_readable_by_anybody(bench):
    """node_exporter is in no group of heaved's."""
    path = bench.folder / "heave.prom"
    before = os.umask(0o077)
    try:
        daemon = bench.start(config=with_metrics(bench, path))
    finally:
        os.umask(before)
    harness.wait_for(path.exists, "it is written")
    assert path.stat().st_mode & 0o777 == 0o644, oct(path.stat().st_mode)
    assert bench.stop(daemon) == 0


def goes_on_without_its_directory(bench):
    path = bench.folder / "later" / "heave.prom"
    daemon = bench.start(config=with_metrics(bench, path))
    harness.wait_for(lambda: f"metrics {path}: No such file or directory; tried again every second" in daemon.log.read_text(), "it is said")
    path.parent.mkdir()
    harness.wait_for(path.exists, "it is written as soon as it can be")
    assert bench.stop(daemon) == 0 and daemon.log.read_text().count("metrics ") == 1, daemon.log.read_text()


def a_relative_path_is_refused(bench):
    run = bench.heaved("--config", with_metrics(bench, "heave.prom"), "--check")
    assert run.returncode == 78 and re.search(r"metrics\.ini:\d+: \[control\] metrics: .*is not an absolute path; allowed: none, or an absolute path", run.stderr), run.stderr


CASES = {
    "what it says is what the status says": says_what_the_status_says,
    "it is never seen in part": is_never_seen_in_part,
    "anybody may read it, whatever the umask": is_readable_by_anybody,
    "a directory that is missing is said once, and used once it is there": goes_on_without_its_directory,
    "a relative path is refused": a_relative_path_is_refused,
}


def main():
    tap.needs_package("prometheus_client")
    suite = tap.Suite()
    for name, check in CASES.items():
        with harness.Bench(sys.argv[1]) as bench, suite.case(name):
            check(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
