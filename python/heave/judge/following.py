# SPDX-License-Identifier: MIT
"""following.py - how a run follows what was asked of it: lag and gain of each axis. Takes NumPy."""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from heave.errors import HeaveError

LAG_MAX_S = 2.0
GOOD_SHARE = 1e-3  # of the energy
LEAST_WAY = 1e-3  # mm or deg, RMS: an axis that was asked for less does not tell


@dataclass
class Following:
    """of one axis."""
    lag_ms: float   # how much later it is
    gain: float     # how much of it is made: 1 is all
    error_rms: float  # what is left of the difference with lag and gain taken out, in its own unit
    share: float    # of what was asked for, by energy, that the run so explained holds; 1 is all

    def __str__(self) -> str:
        return f"lag {self.lag_ms:.1f} ms, gain {self.gain:.3f}, error {self.error_rms:.4f} RMS"


def following(asked_t: Sequence[float], asked: Sequence[float], made_t: Sequence[float], made: Sequence[float], *, lag_max_s: float = LAG_MAX_S) -> Following:
    """asked and made over their own times, in s. Straight lines between what was asked; of all lags from 0 to lag_max_s the one that leaves the least error, with the gain
    that fits it best."""
    try:
        import numpy as np
    except ImportError as missing:
        raise HeaveError("lag and gain need NumPy: apt-get install python3-numpy, or pip install 'heave[arrays]'") from missing
    at, values = np.asarray(made_t, float), np.asarray(made, float)
    asked_at, wanted = np.asarray(asked_t, float), np.asarray(asked, float)
    if len(asked_at) < 2 or len(at) < 2 or np.any(np.diff(asked_at) < 0) or np.any(np.diff(at) <= 0):
        raise HeaveError("two samples or more are needed, in the order of their times")
    inside = (at >= asked_at[0] + lag_max_s) & (at <= asked_at[-1])
    if np.count_nonzero(inside) < 100:
        raise HeaveError(f"what was asked lasts {asked_at[-1] - asked_at[0]:.2f} s: too short to tell lags up to {lag_max_s:g} s")
    at, values = at[inside], values[inside] - np.mean(values[inside])
    step = float(np.median(np.diff(at)))
    if np.std(np.interp(at, asked_at, wanted)) < LEAST_WAY:
        raise HeaveError("too little was asked of this axis to tell how it follows")

    def fit(lag: float) -> tuple[float, float, Any]:
        reference = np.interp(at - lag, asked_at, wanted)
        reference = reference - np.mean(reference)
        energy = float(np.dot(reference, reference))
        gain = float(np.dot(reference, values)) / energy if energy else 0.0
        rest = values - gain * reference
        return float(np.dot(rest, rest)), gain, rest

    lags = np.arange(0, lag_max_s + step, max(step, 1e-3))
    fits = [fit(float(lag)) for lag in lags]
    energy = float(np.dot(values, values))
    errors = np.array([error if gain > 0 else np.inf for error, gain, _ in fits])  # against the motion: half a period of a sine, not a lag
    if not np.isfinite(errors).any():
        raise HeaveError("what was made has nothing of what was asked")
    # A motion that repeats itself fits again a period later: the first lag counts that fits about as well as any.
    is_good = errors <= errors.min() + GOOD_SHARE * energy
    first = int(np.argmax(is_good))
    end = first + int(np.argmin(np.append(is_good[first:], False)))
    best = first + int(np.argmin(errors[first:end]))
    lag = float(lags[best])
    if 0 < best < len(lags) - 1 and np.isfinite(errors[best - 1:best + 2]).all():
        before, here, after = map(float, errors[best - 1:best + 2])
        bend = before - 2 * here + after
        lag += float(lags[1] - lags[0]) * 0.5 * (before - after) / bend if bend > 0 else 0.0
    error, gain, rest = fit(lag)
    return Following(lag * 1000, gain, float(np.sqrt(np.mean(rest**2))), 1 - error / energy if energy else 0.0)
