#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""make_frames.py - writes FRAMES full of hostile input: what senders do, what they should not, and operators in between.

usage: make_frames.py SEED COUNT [--kind hexapod|tripod] [--motor] [--stroke MM] [--centre Z]      COUNT datagrams, to standard output

The same arguments give the same bytes on every machine and version of Python: only random(), whose sequence is documented to stay, is used.
"""
import argparse
import math
import random
import sys

RATES_HZ = (10, 20, 30, 50, 60, 75, 90, 100, 120, 144, 200, 250, 333, 500, 1000)
AMPLITUDES = (20, 20, 25, 90, 90, 100)  # roll, pitch, yaw, x, y, z: about what platforms reach
ANGLE_AMPLITUDE = 400
GARBAGE = ("", "@", "#", "@A6", "@A6:", "@A6:#", "@A6:,,,,,,#", "@A6:1,2,3,4,5,6,7,8,9#", "@A6:1,2,3,4,5,6,G#", "@A6:1,2,3,4,5,6,12345#",
           "@A6:nan,0,0,0,0,0,0#", "@A6:inf,0,0,0,0,0,0#", "@A6:0x10,0,0,0,0,0,0#", "@A6:1 2,0,0,0,0,0,0#", "@A6:--1,0,0,0,0,0,0#",
           "@A6:1e99,0,0,0,0,0,0#", "@A6:1,5,0,0,0,0,0,0,0#", "@A6T:0,0,0,0,0,0,-1#", "@A6T:0,0,0,0,0,0#", "@A6T:0,0,0,0,0,0,3600001#",
           "@A9:1,2,3#", "@a6:0,0,0,0,0,0,0#", "A6:0,0,0,0,0,0,0#", "#A6:0,0,0,0,0,0,0#", "@A6:0,0,0,0,0,0,0", "@A6:0,0,0@A6:9,9,9#",
           "\\x00\\x01\\xff\\xfe", "@\\xd0\\x906:0,0,0,0,0,0,0#",
           "@C6:99999,0,0,0,0,0,0#", "@C6:1,2,3,4,5,6", "\\\\\\n\\r\\n", "@A6:" + "1" * 600 + "#",
           "@A6:" + "0.000000000000000000000000000001," * 6 + "0#", "@C3:-1e-40,1e4,32768,0#", "@A7:1,2,3,4,5,6,7,8,9#", "!" * 3)
EXTREMES = ("32767", "-32768", "32767.99999", "1e4", "-1E+03", "1E-05", "-4.371139E-08", "0.0000001", ".5", "5.", "+7", "-0", "99", "-99", "0")


class Maker:
    def __init__(self, seed, kind, has_motor, stroke, centre, out):
        self.random = random.Random(seed).random
        self.cylinders = 6 if kind == "hexapod" else 3
        self.has_motor, self.stroke, self.centre, self.out = has_motor, stroke, centre, out
        self.t_ms, self.left = 0.0, 0
        self.actions = []  # of the operator, still to come in this round

    # ---- chance, from random() alone ----
    def between(self, low, high):
        return low + (high - low) * self.random()

    def whole(self, low, high):
        return low + int((high - low + 1) * self.random())

    def pick(self, choices):
        return choices[int(len(choices) * self.random())]

    def chance(self, share):
        return self.random() < share

    def shuffled(self, choices):
        rest, result = list(choices), []
        while rest:
            result.append(rest.pop(self.whole(0, len(rest) - 1)))
        return result

    # ---- lines ----
    def put(self, text, counts=True):
        self.out.write(f"{self.t_ms:.3f} {text if text.strip() else chr(92) + 'x20'}\n")
        self.left -= counts

    def wait(self, ms):
        self.t_ms += ms

    def request(self, text, wait_ms=0.0):
        self.put(f"!{text}", counts=False)
        self.wait(wait_ms)

    def number(self, value):
        return self.pick(("{:.3f}", "{:.6f}", "{:.1f}", "{:g}", "{:.0f}", "{:.7e}")).format(value)

    def frame(self, command, values, last):
        return f"@{command}:{','.join(values)}{'' if last is None else ',' + last}#"

    def mask(self):
        return self.pick(("0", "F0", "0FFF", "ffff", "0x1", None)) if self.chance(0.3) else f"{self.whole(0, 4095):X}"

    def command(self, space):
        """A command of this platform; hexapods take some of three axes too."""
        if space == "C":
            return "C3" if self.cylinders == 3 else "C7" if self.has_motor and self.chance(0.4) else "C6"
        motor = self.has_motor and self.chance(0.4)
        if self.cylinders == 3 or self.chance(0.1):
            return "A4" if motor else "A3"
        return "A7" if motor else "A6"

    def values(self, command, pose, extensions, angle):
        """The numbers a command takes, in its order."""
        if command[0] == "C":
            numbers = list(extensions)
        else:
            numbers = [pose[0], pose[1], pose[5]] if command in ("A3", "A4") else list(pose)
        return numbers + ([angle] if command in ("A4", "A7", "C7") else [])

    def random_pose(self, share):
        """On all axes, where cylinders limit most, or on one of them, whose own limits count then."""
        one = self.whole(0, 5) if self.chance(0.3) else None
        pose = [self.between(-a, a) * share if one in (None, i) else 0.0 for i, a in enumerate(AMPLITUDES)]
        pose[5] += self.centre
        return pose

    def random_extensions(self, share):
        middle = self.between(0.3, 0.7)
        return [self.stroke * (middle + self.between(-0.6, 0.6) * share) for _ in range(self.cylinders)]

    def random_frame(self, share, time_ms=None):
        command = self.command("C" if self.chance(0.15) else "A")
        numbers = self.values(command, self.random_pose(share), self.random_extensions(share), self.between(-1, 1) * ANGLE_AMPLITUDE * share)
        last = self.mask() if time_ms is None else str(time_ms)
        return self.frame(command + ("" if time_ms is None else "T"), [self.number(v) for v in numbers], last)

    # ---- scenes ----
    def stream(self):
        """A smooth signal at some rate, with jitter, losses, doubled and late packets, now and then a spike; T of the period, or masks."""
        period = 1000 / self.pick(RATES_HZ)
        jitter = period * self.pick((0, 0, 0.1, 0.3, 0.9))
        loss, spikes = self.pick((0, 0.01, 0.2)), self.pick((0, 0, 0.02))
        share = self.pick((0.05, 0.15, 0.3, 0.7, 1.5))
        space = "C" if self.chance(0.2) else "A"
        command = self.command(space)
        is_timed = self.chance(0.3)
        waves = [(self.between(0.05, 3), self.between(0, 6.28), self.between(0, share)) for _ in range(7)]
        style = self.pick(("{:.3f}", "{:.6f}", "{:g}", "{:.7e}"))
        start, clock = self.t_ms, self.t_ms
        for _ in range(self.whole(20, 400)):
            clock += period
            at = (clock - start) / 1000
            wave = [math.sin(6.28 * rate * at + phase) * a for rate, phase, a in waves]
            pose = [a * w for a, w in zip(AMPLITUDES, wave)]
            pose[5] += self.centre
            extensions = [self.stroke * (0.5 + 0.5 * w) for w in wave[:self.cylinders]]
            if self.chance(0.01):
                clock += period * self.pick((1, 2, 3, 5, 20))  # the sender pauses
            if self.chance(spikes):
                pose = self.random_pose(3)
            texts = [style.format(v) for v in self.values(command, pose, extensions, ANGLE_AMPLITUDE * wave[6])]
            text = self.frame(command + "T", texts, f"{period:.0f}") if is_timed else self.frame(command, texts, self.mask())
            if not self.chance(loss):
                self.t_ms = max(self.t_ms, clock + self.between(0, jitter))
                for _ in range(2 if self.chance(0.01) else 1):
                    self.put(text + self.pick(("", "", "\\n", "\\r\\n", "\\x00")))

    def steps(self):
        """Targets far apart at any time."""
        share = self.pick((0.1, 0.2, 0.5, 1, 2))
        for _ in range(self.whole(3, 40)):
            self.put(self.random_frame(share))
            self.wait(self.pick((0, 1, 3, 20, 150, 700, 1500)) * self.between(0.5, 1.5))

    def timed(self):
        """Timed moves that follow each other too early, in time, or late."""
        share = self.pick((0.02, 0.2, 0.6, 1.5))
        for _ in range(self.whole(3, 20)):
            time_ms = self.whole(0, 3000) if self.chance(0.9) else self.pick((0, 1, 2, 3600000))
            self.put(self.random_frame(share, time_ms))
            self.wait(min(time_ms, 4000) * self.pick((0.1, 0.5, 1, 1, 1.1, 2)) + self.whole(0, 300))

    def isolated(self):
        """Timed moves with nothing near them: from rest, and long enough for what they ask."""
        for _ in range(self.whole(1, 4)):
            at_rest = self.random_frame(0.2)
            for _ in range(25):
                self.put(at_rest)
                self.wait(100)
            self.wait(250)
            time_ms = self.whole(800, 3000)
            self.put(self.random_frame(0.1, time_ms))
            self.wait(time_ms + self.whole(50, 200))

    def switching(self):
        """Pose and cylinder frames in turn, as if two senders fought."""
        gap = self.pick((1, 5, 16.667, 100))
        for i in range(self.whole(10, 150)):
            command = self.command("AC"[i % 2])
            numbers = self.values(command, self.random_pose(0.5), self.random_extensions(0.5), self.between(-90, 90))
            self.put(self.frame(command, [self.number(v) for v in numbers], self.mask()))
            self.wait(gap)

    def extremes(self):
        """Numbers at the edges of what can be written."""
        for _ in range(self.whole(5, 60)):
            command = self.command("AC"[self.chance(0.4)])
            count = len(self.values(command, [0] * 6, [0] * self.cylinders, 0))
            texts = [self.pick(EXTREMES) for _ in range(count)]
            timed = self.chance(0.3)
            self.put(self.frame(command + ("T" if timed else ""), texts, str(self.whole(0, 3000)) if timed else self.mask()))
            self.wait(self.pick((0, 5, 16, 100, 400)))

    def garbage(self):
        """Nonsense between good frames, and good frames with something broken."""
        for _ in range(self.whole(10, 120)):
            text = self.pick(GARBAGE)
            if self.chance(0.4):
                text = self.random_frame(0.3)
                cut = self.whole(0, len(text) - 1)
                text = text[:cut] + self.pick(("", ",", "#", "@", "-", "e", "\\xff", "\\n", " ")) + text[cut + self.whole(0, 1):]
            elif self.chance(0.2):
                text = "".join(f"\\x{self.whole(0, 255):02x}" for _ in range(self.whole(1, 80)))
            if not text.startswith("!"):
                self.put(text)
            self.wait(self.pick((0, 0, 1, 10, 60)))

    def several(self):
        """Many frames in a datagram, many datagrams in a cycle."""
        for _ in range(self.whole(5, 60)):
            frames = [self.random_frame(0.4, self.whole(0, 500) if self.chance(0.3) else None) for _ in range(self.whole(1, 8))]
            if self.chance(0.3):
                frames.insert(self.whole(0, len(frames)), self.pick(GARBAGE))
            text = self.pick(("", "\\n", " ")).join(frames)
            if not text.startswith("!"):
                self.put(text)
            self.wait(self.pick((0, 0, 0.2, 7, 33)))

    def silence(self):
        """Long enough for one of the silence times, then for more or fewer of them."""
        for choices in ((1500,), (200, 600, 3000, 11000)):
            self.put(self.random_frame(0.5))
            self.wait(self.pick(choices))

    def senders(self):
        """Two senders at once, then one alone for long enough to be followed; in the end the first one again."""
        for _ in range(self.whole(4, 30)):
            self.request(f"from 10.0.0.{self.whole(1, 2)}")
            self.put(self.random_frame(0.4, self.whole(0, 600) if self.chance(0.2) else None))
            self.wait(self.pick((0, 5, 16.667, 40)))
        self.wait(self.pick((100, 2600)))
        for _ in range(self.whole(5, 60)):
            self.put(self.random_frame(0.3))
            self.wait(16.667)
        self.request("from 127.0.0.1", 2600)

    def intensity(self):
        """More or less of the motion while it is on; all of it again in the end."""
        share, period = self.pick((0.1, 0.5, 1)), self.pick((5, 16.667, 50))
        for _ in range(self.whole(2, 6)):
            self.request(f"intensity {self.whole(0, 100)}")
            for _ in range(self.whole(1, 40)):
                self.put(self.random_frame(share, self.whole(0, 800) if self.chance(0.1) else None))
                self.wait(period)
        self.request("intensity 100", self.pick((0, 2100)))

    def operator(self):
        """Requests in the middle of motion."""
        self.put(self.random_frame(0.6, self.whole(100, 1500) if self.chance(0.5) else None))
        self.wait(self.between(0, 500))
        self.actions = self.actions or self.shuffled(("hold", "park", "estop", "mix"))
        action = self.actions.pop()
        if action == "hold":
            self.request("hold", self.between(0, 800))
            self.put(self.random_frame(0.5))
            self.request("resume", self.between(0, 400))
        elif action == "park":
            self.request("park", self.pick((100, 1000, 5000)))
            self.request("engage", self.pick((50, 500, 4000)))
        elif action == "estop":
            self.request("estop on", self.between(0, 1500))
            self.put(self.random_frame(0.5))
            self.request("reset", self.between(0, 100))
            self.request("estop off", self.between(0, 500))
        else:
            for _ in range(self.whole(2, 12)):
                self.request(self.pick(("hold", "resume", "park", "engage", "reset", "estop on", "estop off")), self.pick((0, 1, 5, 50, 300)))
            self.request("estop off")
        self.recover()

    def recover(self):
        """Gets the platform back to ENGAGED from wherever the requests have left it."""
        for text in ("reset", "engage", "resume"):
            self.request(text, self.between(1, 20))
        if self.chance(0.7):
            self.wait(self.pick((1000, 3000, 6000)))

    def make(self, count):
        scenes = [self.stream] * 5 + [self.operator] * 4
        scenes += [self.steps, self.timed, self.isolated, self.switching, self.extremes, self.garbage, self.several, self.silence, self.senders,
                   self.intensity]
        self.left = count
        self.out.write("; hostile input made by make_frames.py\n")
        self.request("engage", self.pick((0, 100, 4000)))
        while self.left > 0:
            for scene in self.shuffled(scenes):
                if self.left > 0:
                    scene()
                    self.wait(self.pick((0, 0, 10, 300)))


def main():
    parser = argparse.ArgumentParser(description="Writes FRAMES full of hostile input.")
    parser.add_argument("seed", type=int)
    parser.add_argument("count", type=int, help="datagrams, at least")
    parser.add_argument("--kind", choices=("hexapod", "tripod"), default="hexapod")
    parser.add_argument("--motor", action="store_true", help="the platform has a rotation motor")
    parser.add_argument("--stroke", type=float, default=300, metavar="MM")
    parser.add_argument("--centre", type=float, default=0, metavar="Z", help="the z about which senders move (default 0)")
    arguments = parser.parse_args()
    Maker(arguments.seed, arguments.kind, arguments.motor, arguments.stroke, arguments.centre, sys.stdout).make(arguments.count)


if __name__ == "__main__":
    main()
