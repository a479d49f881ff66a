# SPDX-License-Identifier: MIT
"""synthetic_trace.py - a small platform and traces for it, made by arithmetic of their own: the material of test_check_trace.py.

All six cylinders lean the same 50 mm, so that a move along z moves them alike and every length is a closed expression.
"""
import math

NANO = 10**9
LEAN = 50.0
RETRACTED, ZERO_HEIGHT, SETTLED = 500.0, 580.0, 55.0
SPEED = {"c": 300, "angle": 90, "x": 250, "roll": 20}
ACCEL = {"c": 3000, "angle": 180, "x": 2500, "roll": 200}
JERK = {"c": 50000, "angle": 720, "x": 40000, "roll": 6000}
NAMES = ["roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm", "angle_deg", *(f"c{i}_mm" for i in range(1, 7))]
HEADER = "t_ms,state," + ",".join(NAMES) + ",relays,flags\n"

BASE = [(400, -100), (400, 100), (-100, 400), (-300, 350), (-300, -350), (-100, -400)]
OFFSET = [(-30, -40), (-40, 30), (30, 40), (-50, 0), (0, 50), (40, -30)]  # plate joint minus base joint, each of length 50


def ini(kind="hexapod", **changes):
    """The configuration as text; changes replace values, None removes the key."""
    rows = {
        "platform": {"kind": kind, "cycle_us": "1000"},
        "geometry": {**{f"base{i + 1}_mm": f"{x}, {y}, 0" for i, (x, y) in enumerate(BASE)},
                     **{f"plate{i + 1}_mm": f"{x + dx}, {y + dy}, 0" for i, ((x, y), (dx, dy)) in enumerate(zip(BASE, OFFSET))},
                     "retracted_length_mm": f"{RETRACTED}", "stroke_mm": "200", "zero_height_mm": f"{ZERO_HEIGHT} ; a comment"},
        "pose": {"neutral": "0, 0, 0, 0, 0, 0", "settled_extension_mm": f"{SETTLED}"},
        **{axis: {"min_deg": "-20", "max_deg": "20", "speed_deg_s": "20", "accel_deg_s2": "200", "jerk_deg_s3": "6000"}
           for axis in ("roll", "pitch", "yaw")},
        **{axis: {"min_mm": "-90", "max_mm": "90", "speed_mm_s": "250", "accel_mm_s2": "2500", "jerk_mm_s3": "40000"} for axis in "xyz"},
        "angle": {"present": "yes", "min_deg": "-360", "max_deg": "360", "speed_deg_s": "90", "accel_deg_s2": "180", "jerk_deg_s3": "720"},
        "cylinders": {"speed_mm_s": "300", "accel_mm_s2": "3000", "jerk_mm_s3": "50000", "margin_mm": "1"},
        "engage": {"speed_mm_s": "50", "accel_mm_s2": "200"},
        "relays": {"lines": "0, 1, 2, 3, 4, 5, 6, 7", "safe_mask": "0"},
    }
    for name, value in changes.items():
        section, key = name.split("__")
        rows[section][key] = value
    return "".join(f"[{section}]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items() if value is not None) + "\n"
                   for section, keys in rows.items())


def extensions(pose):
    """Of all cylinders, mm, by rotating each joint about x, then y, then z, one plane rotation after the other."""
    result = []
    for (bx, by), (dx, dy) in zip(BASE, OFFSET):
        x, y, z = bx + dx, by + dy, 0.0
        for angle, turn in zip(pose[:3], (turn_x, turn_y, turn_z)):
            x, y, z = turn(x, y, z, math.radians(angle))
        result.append(math.sqrt((x + pose[3] - bx)**2 + (y + pose[4] - by)**2 + (z + pose[5] + ZERO_HEIGHT)**2) - RETRACTED)
    return result


def turn_x(x, y, z, a):
    return x, y * math.cos(a) - z * math.sin(a), y * math.sin(a) + z * math.cos(a)


def turn_y(x, y, z, a):
    return x * math.cos(a) + z * math.sin(a), y, z * math.cos(a) - x * math.sin(a)


def turn_z(x, y, z, a):
    return x * math.cos(a) - y * math.sin(a), x * math.sin(a) + y * math.cos(a), z


def settled_z():
    return math.sqrt((RETRACTED + SETTLED)**2 - LEAN**2) - ZERO_HEIGHT


def smooth(share):
    """0 to 1 with three derivatives that vanish at both ends."""
    share = min(1.0, max(0.0, share))
    return share**4 * (35 - 84 * share + 70 * share**2 - 20 * share**3)


def there_and_back(limits_of, order, factor):
    """Positions in 1e-9 u, out and back to rest, whose difference of that order peaks at factor times its limit and no other does."""
    speed, accel, jerk = (table[limits_of] * NANO // 1000**k for k, table in ((1, SPEED), (2, ACCEL), (3, JERK)))
    if order == 3:
        j, n, m = int(factor * jerk), 3, 3
    elif order == 2:
        n = int(factor * accel / (0.9 * jerk)) + 1
        j, m = int(factor * accel / n), n
    else:
        n = int(0.5 * accel / (0.5 * jerk))
        m = int(factor * speed / (0.5 * jerk * n)) + 1
        j = int(factor * speed / (n * m))
    push = [j] * n + [0] * (m - n) + [-j] * n
    third = push + [-v for v in push] + [0] * 10
    third += [-v for v in third]
    positions, p, v, a = [], 0, 0, 0
    for step in third:
        a += step
        v += a
        p += v
        positions.append(p)
    return positions


class Trace:
    """Rows that can be changed before they are printed."""

    def __init__(self):
        self.rows = []  # [t_us, state, [13 integers], relays, flags]

    def pose(self, state, pose, angle=0.0, relays=0, flags=""):
        self.add(state, [round(v * NANO) for v in (*pose, angle, *extensions(pose))], relays, flags)

    def add(self, state, numbers, relays=0, flags=""):
        self.rows.append([len(self.rows) * 1000, state, list(numbers), relays, flags])

    def repeat(self, count, **changes):
        for _ in range(count):
            _, state, numbers, relays, flags = self.rows[-1]
            self.add(changes.get("state", state), numbers, changes.get("relays", relays), changes.get("flags", flags))

    def column(self, name):
        return NAMES.index(name)

    def index(self, state, which=0):
        """Of the which-th row in a state; negative: from the end."""
        return [i for i, row in enumerate(self.rows) if row[1] == state][which]

    def lines(self):
        yield HEADER
        for t_us, state, numbers, relays, flags in self.rows:
            values = ",".join(f"{'-' if v < 0 else ''}{abs(v) // NANO}.{abs(v) % NANO:09d}" for v in numbers)
            yield f"{t_us // 1000}.{t_us % 1000:03d},{state},{values},{relays:04X},{flags}\n"


def rise(trace, state, start_z, end_z, cycles=1800):
    for i in range(1, cycles + 1):
        trace.pose(state, (0, 0, 0, 0, 0, start_z + (end_z - start_z) * smooth(i / cycles)), flags="cylinders")


def whole_day():
    """Every state: settled, up, moving on all axes, held, down, an e-stop with set-points that follow, homing, settled again."""
    trace = Trace()
    low = settled_z()
    trace.pose("SETTLED", (0, 0, 0, 0, 0, low))
    trace.repeat(50)
    rise(trace, "RISING", low, 0.0)
    trace.repeat(20, state="NEUTRAL", flags="")
    for i in range(3000):
        at = smooth(i / 1000) * smooth((3000 - i) / 1000)
        wave = [amplitude * at * math.sin(i * rate / 1000) for amplitude, rate in zip((3, 3, 4, 20, 15, 25), (4, 5, 3, 6, 5, 4))]
        trace.pose("ENGAGED", wave, angle=5 * at, relays=0xF0 if i > 500 else 0)
    for i in range(400):  # a hold that comes to rest somewhere else
        trace.pose("HOLD", (0, 0, 0, 0, 0, 10 * smooth(i / 300)))
    rise(trace, "SETTLING", 10.0, low)
    trace.repeat(20, state="SETTLED", flags="")
    trace.repeat(30, state="ESTOP")
    for i in range(100):  # drives that run down: no limits
        trace.pose("ESTOP", (0, 0, 0, 10 * math.exp(-i / 20), 0, low - i * 0.03))
    trace.repeat(20, state="OFF", flags="no-pose")
    for i in range(500):
        trace.pose("HOMING", (0, 0, 0, 0, 0, low * min(1, i / 300)))
    trace.repeat(20, state="SETTLED")
    return trace
