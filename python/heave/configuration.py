# SPDX-License-Identifier: MIT
"""configuration.py - what a heaved configuration says about a platform: exact numbers, and its geometry in double precision.

Written from the convention alone, so that it can contradict the core. Numbers with a fraction are taken as the nearest Q16.16, which is
what a configuration can hold. A key that has no obvious default must stand in the file: `heaved --dump-config` prints one with every key.
"""
from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from heave.errors import HeaveError
from heave.text import read_text

SEPARATOR = re.compile("[=:]")
POSE_AXES = ("roll", "pitch", "yaw", "x", "y", "z")
UNIT = {"roll": "deg", "pitch": "deg", "yaw": "deg", "x": "mm", "y": "mm", "z": "mm", "angle": "deg"}


class ConfigError(HeaveError):
    """The file cannot be read, or does not say what a check needs."""


@dataclass
class Limits:
    """Speed, acceleration and jerk, in u/s, u/s^2 and u/s^3."""
    unit: str
    speed: Fraction
    accel: Fraction
    jerk: Fraction


@dataclass
class Axis(Limits):
    """One pose axis or the rotation motor: asked = sign * scale * sent + offset, then low..high."""
    sign: int
    scale: Fraction
    offset: Fraction
    low: Fraction
    high: Fraction


def read_ini(path: str | os.PathLike[str]) -> dict[str, dict[str, str]]:
    """{section: {key: text}}; full-line comments start with ; or #, others with a blank and ;"""
    sections: dict[str, dict[str, str]] = {}
    section: dict[str, str] | None = None
    for number, line in enumerate(read_text(path, ConfigError).splitlines(), 1):
        text = line.strip()
        if not text or text[0] in ";#":
            continue
        for blank in (" ;", "\t;"):
            text = text.split(blank)[0].rstrip()
        pair = SEPARATOR.split(text, maxsplit=1)
        if text.startswith("[") and text.endswith("]"):
            section = sections.setdefault(text[1:-1].strip(), {})
        elif len(pair) == 2 and section is not None:
            section[pair[0].strip()] = pair[1].strip()
        else:
            raise ConfigError(f"{path}:{number}: stray text {text[:60]!r}; allowed: key = value, [section], ; comment")
    return sections


def q16(text: str) -> Fraction:
    """The number as a configuration holds it: nearest multiple of 2^-16, ties to even."""
    return Fraction(round(Fraction(text.strip()) * 65536), 65536)


class Configuration:
    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = path
        self.ini = read_ini(path)
        try:
            self._read()
        except (ValueError, ZeroDivisionError) as error:
            raise ConfigError(f"{path}: {error}") from error

    def _text(self, section: str, key: str, default: str | None = None) -> str:
        text = self.ini.get(section, {}).get(key, default)
        if text is None:
            raise ConfigError(f"{self.path}: [{section}] {key} is not stated; check what heaved --dump-config prints instead")
        return text

    def _number(self, section: str, key: str, default: str | None = None) -> Fraction:
        return q16(self._text(section, key, default))

    def _numbers(self, section: str, key: str, count: int, default: str | None = None) -> list[Fraction]:
        """count numbers; a single one stands for all."""
        numbers = [q16(part) for part in self._text(section, key, default).split(",")]
        if len(numbers) == 1:
            numbers *= count
        if len(numbers) != count:
            raise ConfigError(f"{self.path}: [{section}] {key}: {count} numbers are needed")
        return numbers

    def _axis(self, name: str) -> Axis:
        unit = UNIT[name]
        def number(key: str, default: str | None = None) -> Fraction:
            return self._number(name, key, default)

        return Axis(unit=unit, speed=number(f"speed_{unit}_s"), accel=number(f"accel_{unit}_s2"), jerk=number(f"jerk_{unit}_s3"),
                    sign=int(self._text(name, "sign", "1")), scale=number("scale", "1"), offset=number(f"offset_{unit}", "0"),
                    low=number(f"min_{unit}"), high=number(f"max_{unit}"))

    def _read(self) -> None:
        self.kind = self._text("platform", "kind")
        if self.kind not in ("hexapod", "tripod", "tripod-3rps"):
            raise ConfigError(f"{self.path}: [platform] kind = {self.kind} is unknown")
        self.cylinders = count = 6 if self.kind == "hexapod" else 3
        self.cycle_us = int(self._text("platform", "cycle_us", "1000"))

        self.strokes = self._numbers("geometry", "stroke_mm", count)
        self.margin = self._number("cylinders", "margin_mm")
        self.limits = Limits("mm", *(self._number("cylinders", key) for key in ("speed_mm_s", "accel_mm_s2", "jerk_mm_s3")))
        self.engage_speed = self._number("engage", "speed_mm_s")
        self.engage_accel = self._number("engage", "accel_mm_s2")
        self.settled = self._number("pose", "settled_extension_mm")
        self.neutral = self._numbers("pose", "neutral", 6)

        # a mechanism of three cylinders has three free axes; what it does to the others is not limited
        self.free_axes = POSE_AXES if count == 6 else ("roll", "pitch", "z")
        self.axes = {name: self._axis(name) for name in self.free_axes}
        self.has_angle = self._text("angle", "present", "no") == "yes"
        if self.has_angle:
            self.axes["angle"] = self._axis("angle")
        self.wrap = self._text("angle", "wrap", "as-sent")

        lines = [line for line in self._text("relays", "lines", "none").split(",") if line.strip() not in ("", "none")]
        self.relay_mask = (1 << len(lines)) - 1
        self.safe_mask = int(self._text("relays", "safe_mask", "0"), 16)
        self._read_geometry(count)

    def _read_geometry(self, count: int) -> None:
        def triple(key: str, default: str | None = None) -> list[float]:
            return [float(v) for v in self._numbers("geometry", key, 3, default)]

        self.base = [triple(f"base{i + 1}_mm") for i in range(count)]
        self.plate = [triple(f"plate{i + 1}_mm") for i in range(count)]
        self.retracted = [float(v) for v in self._numbers("geometry", "retracted_length_mm", count)]
        self.mrp = triple("mrp_mm", "0, 0, 0")
        zero_height = float(self._number("geometry", "zero_height_mm"))
        self.centre = [self.mrp[0], self.mrp[1], self.mrp[2] + zero_height]  # the motion reference point at pose zero
        self.arms = [[p - m for p, m in zip(joint, self.mrp)] for joint in self.plate]
        # 3-RPS: joints where ideal hinges hold them, on one circle whose radius is that of joint 1, at 0, 120 and 240 degrees
        radius, height = math.hypot(*self.plate[0][:2]), self.plate[0][2]
        turns = [math.radians(120 * i) for i in range(3)]
        self.hinge_planes = [(math.sin(turn), math.cos(turn)) for turn in turns]
        self.hinge_arms = [[radius * math.cos(turn) - self.mrp[0], radius * math.sin(turn) - self.mrp[1], height - self.mrp[2]]
                           for turn in turns]

    def place(self, pose: Sequence[float], arms: Sequence[Sequence[float]]) -> list[tuple[float, float, float]]:
        """Where points of the plate are in the base frame: centre + (x, y, z) + Rz(yaw) Ry(pitch) Rx(roll) * arm."""
        roll, pitch, yaw = (math.radians(v) for v in pose[:3])
        cr, sr, cp, sp, cy, sy = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch), math.cos(yaw), math.sin(yaw)
        at = [c + p for c, p in zip(self.centre, pose[3:6])]
        return [(at[0] + cy * cp * x + (cy * sp * sr - sy * cr) * y + (cy * sp * cr + sy * sr) * z,
                 at[1] + sy * cp * x + (sy * sp * sr + cy * cr) * y + (sy * sp * cr - cy * sr) * z,
                 at[2] - sp * x + cp * sr * y + cp * cr * z) for x, y, z in arms]

    def extensions(self, pose: Sequence[float]) -> list[float]:
        """Of each cylinder, mm, for a complete pose (degrees and mm)."""
        return [math.dist(joint, base) - length for joint, base, length in zip(self.place(pose, self.arms), self.base, self.retracted)]

    def guide_error(self, pose: Sequence[float]) -> float:
        """How far a pose is from what the mechanism can hold, mm or deg: the guide, or the planes in which the cylinders swing."""
        if self.kind == "hexapod":
            return 0.0
        if self.kind == "tripod":
            return max(abs(pose[axis]) for axis in (2, 3, 4))
        joints = self.place(pose, self.hinge_arms)
        return max(abs(s * x - c * y) for (s, c), (x, y, _) in zip(self.hinge_planes, joints))


def changed(text: str, changes: Mapping[str, object], name: str = "configuration") -> str:
    """The text of a configuration with other values: {"udp.port": 9801}. A key that is not there is added to its section, a section to the end."""
    lines = text.splitlines()
    for where, value in changes.items():
        section, dot, key = where.partition(".")
        if not (section and dot and key):
            raise ConfigError(f"{name}: a change is named section.key, as in udp.port, not {where!r}")
        if "\n" in str(value):
            raise ConfigError(f"{name}: {where}: a value is one line")
        heads = [i for i, line in enumerate(lines) if line.strip().startswith("[")]
        begin = next((i for i in heads if lines[i].split(";")[0].strip() == f"[{section}]"), None)
        if begin is None:
            lines += ["", f"[{section}]", f"{key} = {value}"]
            continue
        end = next((i for i in heads if i > begin), len(lines))
        at = next((i for i in range(begin + 1, end) if not lines[i].strip().startswith((";", "#")) and lines[i].partition("=")[0].strip() == key), None)
        if at is None:
            lines.insert(begin + 1, f"{key} = {value}")
        else:
            lines[at] = f"{key} = {value}"
    return "\n".join(lines) + "\n"
