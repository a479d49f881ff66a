#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_spikes.py BIN - single wild samples in a stream, and far jumps that nothing confirms: what heaved makes of it is, byte by byte, what it makes of
the stream without them."""
import math
import random
import signal
import sys

import harness
import tap

T0 = 15000  # up and following by then
PATIENT = {"udp__silence_hold_ms": 0}  # a lone pose stays
RATES_HZ = (15, 30, 60, 100, 200)


def frame(pose, timed=None):
    return f"@A6{'T' if timed else ''}:{','.join(f'{value:.3f}' for value in pose)},{timed or 0}#"


def wave(t):
    return [6 * math.sin(3 * t), 4 * math.cos(3 * t), 2 * math.sin(4 * t), 15 * math.sin(2 * t), 9 * math.cos(t), 20 * math.sin(2.5 * t)]


def stream(rate_hz, samples=300, jitter_ms=0.0, loss=0.0, seed=1):
    """What the network brings of a stream: (arrival in ms, pose)."""
    dice = random.Random(seed)
    lines, at = [], 0.0
    for i in range(samples):
        at = max(at, T0 + 1000 * i / rate_hz + jitter_ms * dice.random())
        if dice.random() >= loss:
            lines.append((at, wave(i / rate_hz)))
    return lines


def with_spikes(lines, seed=2):
    """One axis of single samples far away; the places."""
    dice = random.Random(seed)
    lines, places, at = list(lines), [], 15
    while at < len(lines) - 3:
        pose = list(lines[at][1])
        axis = dice.randrange(6)
        pose[axis] += dice.choice((-1, 1)) * dice.uniform(300, 3000)
        lines[at] = (lines[at][0], pose)
        places.append(at)
        at += dice.randrange(4, 40)
    return lines, places


def play(bench, lines, timed=None, config=None):
    frames = bench.file("frames.txt", "".join(f"{t:.3f} {frame(pose, timed)}\n" for t, pose in lines))
    return bench.play(frames, config=config)


def without(lines, places):
    return [line for i, line in enumerate(lines) if i not in places]


def spikes_are_lost_samples(bench):
    for rate in RATES_HZ:
        for jitter_ms, loss in ((0, 0), (min(5, 300 / rate), 0.02)):
            lines, places = with_spikes(stream(rate, jitter_ms=jitter_ms, loss=loss))
            assert len(places) > 8
            assert play(bench, lines) == play(bench, without(lines, places)), f"{rate} Hz, jitter {jitter_ms} ms"
            bench.check_limits()


def spikes_in_a_timed_stream(bench):
    lines, places = with_spikes(stream(50))
    assert play(bench, lines, 20) == play(bench, without(lines, places), 20)


def a_step_comes_one_sample_later(bench):
    lines = stream(60)
    stepped = [(t, pose if i < 100 else [value + 8 for value in pose]) for i, (t, pose) in enumerate(lines)]
    assert play(bench, stepped) == play(bench, without(stepped, [100]), config=configured(bench, "off.ini", 0))
    bench.check_limits()


def the_last_frame_counts(bench):
    """A sender that stops with zeros, far from where it was."""
    lines = stream(50, 225)
    assert max(map(abs, lines[-1][1])) > 15
    rows = harness.rows_of(play(bench, [*lines, (lines[-1][0] + 20, [0] * 6)]))
    bench.check_limits()
    assert all(float(rows[-1][name]) == 0 for name in ("roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm")), rows[-1]


def lone_frames_are_followed_at_once(bench):
    lines = [(T0 + 1000 * i, [0, 0, 0, 0, 0, (-1) ** i * 60]) for i in range(5)]
    off = configured(bench, "lone.ini", 0)
    assert play(bench, lines) == play(bench, lines, config=off)


def configured(bench, name, factor):
    config = bench.write_config(name, **PATIENT)
    config.write_text(config.read_text().replace("[udp]", f"[udp]\nspike_gate = {factor}"), encoding="utf-8")
    return config


def the_gate_is_configured(bench):
    """At 60 Hz, 10 times 2500 mm/s^2 are 7 mm in a sample, 2 times are 1.4 mm."""
    lines = [(T0 + i * 1000 / 60, [0, 0, 0, 0, 0, 3 if i == 100 else 0]) for i in range(200)]
    heights = [max(float(row["z_mm"]) for row in harness.rows_of(play(bench, lines, config=config)))
               for config in (None, configured(bench, "two.ini", 2), configured(bench, "off.ini", 0))]
    assert heights[0] > 0.1 and heights[1] == 0 and heights[2] > 0.1, heights
    refused = bench.heaved("--config", configured(bench, "wrong.ini", 1001), "--check")
    assert refused.returncode == 78 and "spike_gate" in refused.stderr, refused.stderr


def spikes_are_counted_and_told(bench):
    lines = [(T0 + i * 20, [0, 0, 0, 0, 0, 95.25 if i in (100, 110, 120) else 0]) for i in range(200)]
    frames = bench.file("frames.txt", "".join(f"{t} {frame(pose)}\n" for t, pose in lines))
    told = bench.heaved("--config", bench.config, "--play", frames).stderr
    assert "sample from 127.0.0.1" in told and "not followed, a spike: z 95.3 after 0.0\n" in told, told
    assert "before that 1 more" in told, told


def spikes_live(bench):
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    with bench.sender() as sender:

        def count_after_a_spike():
            sender.stream(0.5, lambda t: frame([0, 0, 0, 0, 0, 5 * math.sin(t)]), 0.02)
            sender.send(frame([0, 0, 0, 0, 0, 95]))
            sender.stream(0.1, lambda t: frame([0, 0, 0, 0, 0, 0]), 0.02)
            return bench.status()["counters"]["spikes"]

        harness.wait_for(count_after_a_spike, "a spike is counted")
    assert "spikes" in bench.ctl("status").stdout
    harness.wait_for(lambda: "a spike: z 95.0" in daemon.log.read_text(), "a spike is logged")


# --- Far jumps that wait for a second frame ---

def confirming(bench, mm=20, deg=5, name="confirm.ini"):
    config = bench.write_config(name, **PATIENT)
    config.write_text(config.read_text().replace("[udp]", f"[udp]\nspike_gate = 0\nconfirm_jump_mm = {mm}\nconfirm_jump_deg = {deg}"), encoding="utf-8")
    return config


def lone_jumps_are_not_followed(bench):
    config = confirming(bench)
    lines, places = with_spikes(stream(50))
    assert play(bench, lines, config=config) == play(bench, without(lines, places), config=config)
    bench.check_limits(config)
    jumps = [(T0, [0, 0, 0, 0, 0, 15]), (T0 + 1000, [0, 6, 0, 0, 0, 0]), (T0 + 3000, [0, 0, 0, 0, 21, 0]), (T0 + 6000, [0, 0, 0, 0, 0, 14])]
    assert play(bench, jumps, config=config) == play(bench, without(jumps, [1, 2]), config=config)


def confirmed_jumps_are_followed(bench):
    """As if the first frame had never been: the second one tells where to, and how quickly."""
    off, config = configured(bench, "off.ini", 0), confirming(bench)
    for timed in (None, 1500):
        first, second = (T0, [0, 0, 0, 0, 0, 60]), (T0 + 300, [0, 0, 0, 0, 0, 58])
        assert play(bench, [first, second], timed, config) == play(bench, [second], timed, off), f"T {timed}"
    for twice_ms, is_followed in ((4, False), (5, True), (1000, True), (1001, False)):
        again = [(T0, [0, 0, 0, 0, 0, 60]), (T0 + twice_ms, [0, 0, 0, 0, 0, 60])]
        highest = max(float(row["z_mm"]) for row in harness.rows_of(play(bench, again, config=config)))
        assert (highest > 1) == is_followed, f"the same frame {twice_ms} ms later: {highest} mm"


def jumps_live(bench):
    """Switched on in the ride; told, counted, and played back to the same bytes."""
    record, trace, off = bench.folder / "record.txt", bench.folder / "live.csv", bench.config.read_text()
    daemon = bench.start("--record", record, "--trace", trace, config=confirming(bench, 0, 0, "platform.ini"))
    said = lambda words: harness.wait_for(lambda: words in daemon.log.read_text(), words)  # noqa: E731
    bench.wait_state("ENGAGED")
    confirming(bench, name="platform.ini")
    daemon.send_signal(signal.SIGHUP)
    said("[udp] confirm_jump_mm: 20 from now on")
    with bench.sender() as sender:
        sender.send(frame([0, 0, 0, 0, 0, 60]))
        harness.wait_for(lambda: bench.status()["counters"]["unconfirmed"] == 1, "the jump is dropped")
        said("not followed, a far jump that no second one confirmed: z 60.0 after 0.0\n")
        assert bench.status()["pose_sent"]["z_mm"] == 0
        sender.stream(0.3, lambda t: frame([0, 0, 0, 0, 0, 60]))
        harness.wait_for(lambda: bench.status()["pose_sent"]["z_mm"] > 59, "a confirmed one is followed")
    assert bench.stop(daemon) == 0 and "confirm" not in off
    live, played = harness.since_zero(trace.read_bytes()), bench.play(record)
    assert played[:len(live)] == live, "the recording plays back otherwise"


CASES = {
    "spikes at all rates, with jitter and losses, are samples that were lost": spikes_are_lost_samples,
    "spikes in a stream of T frames too": spikes_in_a_timed_stream,
    "a real step comes one sample later": a_step_comes_one_sample_later,
    "a step in the last frame of a stream is where it comes to rest": the_last_frame_counts,
    "lone frames are followed at once": lone_frames_are_followed_at_once,
    "the gate is as wide as configured, or off": the_gate_is_configured,
    "spikes are counted, and told once a second": spikes_are_counted_and_told,
    "far jumps that nothing confirms are as frames that never came": lone_jumps_are_not_followed,
    "far jumps are followed by their second frame, with its time": confirmed_jumps_are_followed,
    "far jumps of a live sender: on by a reload, told, counted, replayed": jumps_live,
    "spikes of a live sender show in the status and the log": spikes_live,
}


def main():
    suite = tap.Suite()
    for name, case in CASES.items():
        with suite.case(name), harness.Bench(sys.argv[1], **PATIENT) as bench:
            case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
