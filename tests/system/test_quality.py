#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_quality.py BIN [SEED [RECORDS]] - a stream as its sender meant it: nothing is left of its rate, and at 60 Hz lag, shape and jerk keep their figures.

One axis of 100 mm, motion cues, 5 ms of jitter, 1 % lost, three decimals, [udp] stream = smooth; what heaved --play makes of it.
"""
import sys
import tempfile
from pathlib import Path

import harness
import tap

sys.path.insert(0, str(harness.TOP / "tools/lib"))
import bench_analysis as analysis  # noqa: E402  the path above has to be set first
import bench_motion  # noqa: E402
import bench_signal as signals  # noqa: E402

SECONDS = 20
JUDGED = slice(4000, 18000)  # cycles: in motion, and the rate is known
BAND_HZ = 4.0                # on either side of the sender's rate
LINE_DB = -40                # against a zero-order hold of the same frames
LAG_PERIODS, SHAPE_UM, JERK = 2.5, 50, 1.3  # jerk: RMS against the signal's own, where no two frames in a row are lost
JERK_TWO_LOST = 1.4                         # the second of two guesses is as far off as the motion's own jerk makes it
RATES_HZ = (20, 30, 50, 60, 100)
FIRST_SEED, RECORDS = 1, 4


class Record:
    """A stream, and what became of it."""

    def __init__(self, heaved, rate_hz, seed):
        self.signal = signals.Cue(SECONDS, seed)
        self.arrivals, _ = signals.stream(self.signal, rate_hz, SECONDS, seed)
        with tempfile.TemporaryDirectory(prefix="heave-") as folder:
            bench = bench_motion.Bench(heaved, folder, False, lambda *_: None)
            self.whole, flags = bench.play(f"{rate_hz}hz", "smooth", self.arrivals)
        assert not any(flags[JUDGED]), f"seed {seed}: held back by {set(flags[JUDGED])}: not the stream is judged"
        self.rate_hz, self.cycles = rate_hz, self.whole[JUDGED]

    def line_db(self):
        """Acceleration about the sender's rate, against that of the held frames."""
        band = self.rate_hz - BAND_HZ, self.rate_hz + BAND_HZ
        held = signals.held(self.arrivals, len(self.whole))[JUDGED]
        powers = [analysis.band_power(analysis.rates(record, 2), *band) for record in (self.cycles, held)]
        return analysis.decibel(*powers)

    def lag_and_shape(self):
        """Periods, the network's delay in it; um."""
        first = JUDGED.start - analysis.LAG_MAX
        record = self.whole[first:JUDGED.stop - analysis.LAG_MIN]
        lag_s, shape_mm = analysis.lag_and_shape(record, lambda t: self.signal.at(t + first * analysis.CYCLE_S))
        return lag_s * self.rate_hz, 1000 * shape_mm

    def jerk(self):
        truth = [self.signal.at(k * analysis.CYCLE_S) for k in range(JUDGED.start, JUDGED.stop)]
        return analysis.rms(analysis.rates(self.cycles, 3)) / analysis.rms(analysis.rates(truth, 3))

    def has_two_lost(self):
        """Two frames in a row are missing: an interval of three periods, less the jitter."""
        times = [t_us for t_us, _ in self.arrivals]
        return any(b - a > 3e6 / self.rate_hz - signals.JITTER_US for a, b in zip(times, times[1:]))


def check_line(heaved, rate_hz, seed):
    line_db = Record(heaved, rate_hz, seed).line_db()
    print(f"# {rate_hz} Hz, seed {seed}: {line_db:.1f} dB")
    assert line_db <= LINE_DB, f"{line_db:.1f} dB"


def check_figures(heaved, seed):
    record = Record(heaved, 60, seed)
    (lag, shape_um), jerk, two_lost = record.lag_and_shape(), record.jerk(), record.has_two_lost()
    text = f"seed {seed}: lag {lag:.2f} periods, shape {shape_um:.1f} um, jerk {jerk:.2f} times the signal's{', two lost in a row' if two_lost else ''}"
    print(f"# {text}")
    assert lag <= LAG_PERIODS and shape_um <= SHAPE_UM and jerk <= (JERK_TWO_LOST if two_lost else JERK), text


def main():
    heaved = Path(sys.argv[1]) / "heaved"
    first = int(sys.argv[2]) if len(sys.argv) > 2 else FIRST_SEED
    count = int(sys.argv[3]) if len(sys.argv) > 3 else RECORDS
    suite = tap.Suite()
    for rate_hz in RATES_HZ:
        with suite.case(f"{rate_hz} Hz, smooth: what is left of the sender's rate is {-LINE_DB} dB below held frames"):
            check_line(heaved, rate_hz, first)
    for seed in range(first, first + count):
        with suite.case(f"60 Hz, smooth, signal {seed}: at most {LAG_PERIODS} periods late, {SHAPE_UM} um off, {JERK} times its jerk"):
            check_figures(heaved, seed)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
