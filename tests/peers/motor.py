# SPDX-License-Identifier: MIT
"""motor.py - what moves behind a simulated drive: the demand, and the axis that lags behind it. Counts and microseconds."""
import math


class Motor:
    """The demand goes straight from where it was to the target within the interpolation period; the axis is a first-order lag behind it."""

    def __init__(self, position, lag_us):
        self.actual = float(position)
        self.lag_us = lag_us
        self.now_us = 0
        self.hold()

    def hold(self, position=None):
        """Stands still here, or there."""
        self.demand = self.goal = self.actual if position is None else float(position)
        self.speed = 0.0       # counts/us of the demand
        self.brake = 0.0       # counts/us^2, while it stops
        self.is_frozen = False

    def aim(self, target, period_us):
        """The next set-point of a cyclic mode."""
        self.goal, self.brake = float(target), 0.0
        self.speed = (self.goal - self.demand) / max(1, period_us)

    def travel(self, target, counts_per_s):
        """A move at constant speed."""
        self.goal, self.brake = float(target), 0.0
        self.speed = math.copysign(counts_per_s / 1e6, self.goal - self.demand)

    def stop(self, counts_per_s2):
        """A ramp down from the present speed."""
        self.brake = max(counts_per_s2, 1) / 1e12
        self.goal = self.demand + math.copysign(self.speed * self.speed / (2 * self.brake), self.speed)

    def is_there(self):
        return self.demand == self.goal

    def advance(self, now_us):
        span_us = now_us - self.now_us
        self.now_us = now_us
        if span_us <= 0 or self.is_frozen:
            return
        self.move_demand(span_us)
        self.actual = self.demand if not self.lag_us else self.demand + (self.actual - self.demand) * math.exp(-span_us / self.lag_us)

    def move_demand(self, span_us):
        if self.is_there():
            self.speed = 0.0
            return
        step = self.speed * span_us
        if self.brake:
            slower = max(0.0, abs(self.speed) - self.brake * span_us)
            step = math.copysign((abs(self.speed) + slower) / 2 * span_us, self.speed)
            self.speed = math.copysign(slower, self.speed)
        if abs(step) >= abs(self.goal - self.demand) or (self.brake and self.speed == 0):
            self.demand = self.goal
        else:
            self.demand += step
