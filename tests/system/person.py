# SPDX-License-Identifier: MIT
"""person.py - somebody at the terminal of heavectl setup: reads the screen, looks at the machine, types, holds the space bar. Knows nothing of setup's insides.

    person = Person([BIN / "heavectl", "setup", "ride.ini"], Eyes(twin, retracted=1300))
    person.rule(r"How many cylinders", "6")          the newest rule that matches the question counts
    code, screen = person.run()
"""
import math
import os
import pty
import re
import select
import signal
import subprocess
import time

from reader import Reader

KEY_S = 1 / 30
THINKS_S = 0.05
READS_S = 0.2  # what the screen asks for, before the key
# What the screen says while a person acts, and what it is about.
MARKS = {"Waiting for it; s and Enter: it is not seen.": "waiting", "Relay %u switches while a key is held.": "relay",
         "Drive %u: by %g mm, outwards. Look which cylinder moves, which way, and how far.": "way",
         "Cylinder %u: by %.1f mm, inwards, to where it stood before.": "way", "Cylinder %u: by %.1f mm, outwards, to where it stood before.": "way",
         "The platform rises by %g mm, or sinks where there is no room above it.": "way", "The plate tilts by %g degrees.": "way", "The plate goes back, level.": "way", "hold a key, the space bar for one; q ends": "hold", "goes on while the key is held": "goes on",
         "let go; hold a key to go on, q to end": "goes on", "stopped: let go of the key and hold it again": "stopped",
         "let go of the key first, then hold the space bar; q ends": "stopped", "let go": "let go",
         "there: let go of the key": "let go", "home has ended; heavectl counts shows what is homed": "let go"}


class Eyes:
    """What can be seen of the machine: how far out each cylinder is, by its place on the platform, and how the plate stands."""

    def __init__(self, twin, retracted, zero_height=0.0):
        self.twin, self.retracted, self.zero_height = twin, retracted, zero_height

    def cylinders(self):
        return {drive["leg"]: drive["position"] for drive in self.twin.status()["drives"]}

    def length(self, cylinder):
        return self.retracted + self.cylinders()[cylinder]

    def plate(self):
        roll, pitch, yaw, x, y, z = self.twin.pose.values()
        return [z + self.zero_height, x, y, roll, pitch, yaw]


    def lowest(self):
        """The hour at which the plate is lowest, with 12 at the front: positive pitch lowers the front, positive roll the left."""
        roll, pitch = self.plate()[3:5]
        return round(math.degrees(math.atan2(-roll, pitch)) / 30) % 12 or 12


class Person:
    def __init__(self, command, eyes, rules=(), seconds=400, language=None, environment=None):
        """language: of the screen, by its catalogue; None: English. The rules are English always."""
        self.eyes, self.seconds, self.reader = eyes, seconds, Reader(language)
        self.marks = [(re.compile(self.reader.own(text) + (r"(?=\r)" if text == "let go" else "")), kind) for text, kind in MARKS.items()]
        self.marks.append((re.compile(r"heavectl: [^\n]*\n"), "let go"))
        self.rules = [(re.compile(pattern, re.DOTALL), answer) for pattern, answer in (*self.of_setup(), *rules)]
        self.answered = []  # questions, with what was answered
        self.before, self.after, self.is_held = {}, {}, False
        self.plate_then, self.plate_now = [0.0] * 6, [0.0] * 6
        self.said_of_the_plate = None
        self.relay_until, self.relays = None, set()  # a relay is held for a second, and watched
        self.works = {}  # what the screen asks the person to work, with how
        self.text, self.read = "", 0
        self.master, slave = pty.openpty()
        self.process = subprocess.Popen([str(word) for word in command], stdin=slave, stdout=slave, stderr=slave, start_new_session=True, env=environment or {**os.environ, "LC_ALL": "C.UTF-8"})
        os.close(slave)

    def rule(self, pattern, answer):
        self.rules.append((re.compile(pattern, re.DOTALL), answer))
        return self

    def remember(self, other):
        """What the same person saw before another setup was ended; what was moved then stands where it stands now."""
        self.before, self.plate_then = other.before, other.plate_then
        self.after, self.plate_now = self.eyes.cylinders(), self.eyes.plate()
        return self

    # --- Eyes ---

    def moved(self):
        """The cylinder that has moved most since the key was pressed, and by how much."""
        ways = {leg: self.after[leg] - self.before[leg] for leg in self.before}
        leg = max(ways, key=lambda one: abs(ways[one]))
        return (leg, ways[leg]) if abs(ways[leg]) > 0.3 else (0, 0.0)

    def plate_is_so(self, question):
        """Who has measured twice is sure of the lengths."""
        said = [float(number) for number in re.findall(r"-?\d+\.\d+", question)]
        is_again, self.said_of_the_plate = said == self.said_of_the_plate, said
        return "y" if max(abs(a - b) for a, b in zip(said, self.eyes.plate())) < 1 else "l" if is_again else "n"

    def has_risen(self, way):
        up, *others = (now - then for now, then in zip(self.plate_now, self.plate_then))
        return "n" if max(map(abs, others)) > 0.5 else "y" if abs(up - way) < 0.5 else "l"

    def of_setup(self):
        return [(r"Which cylinder has moved", lambda _: str(self.moved()[0])),
                (r"look at all of them again l again, over 20 mm each", "l"),
                (r"longer or shorter", lambda _: "l" if self.moved()[1] > 0 else "s"),
                (r"By how many mm has cylinder", lambda _: f"{abs(self.moved()[1]):.0f}"),
                (r"Has cylinder (\d), and no other, become (longer|shorter) by ([0-9.]+)",
                 lambda asked: "y" if self.moved()[0] == int(asked[1]) and abs(self.moved()[1] - float(asked[3]) * (1 if asked[2] == "longer" else -1)) < 0.6 else "n"),
                (r"How long is cylinder (\d)", lambda asked: f"{self.eyes.length(int(asked[1])):.2f}"),
                (r"plate stands like this", lambda asked: self.plate_is_so(asked.string)),
                (r"Has relay (\d), and no other", lambda asked: "y" if self.relays == {int(asked[1])} and self.eyes.twin.relays == [] else "n"),
                (r"at which hour is the plate lowest", lambda _: str(self.eyes.lowest())),
                (r"Has it (risen|sunk) by ([0-9.]+)", lambda asked: self.has_risen(float(asked[2]) * (1 if asked[1] == "risen" else -1)))]

    # --- Hands ---

    def answer(self, question):
        for pattern, answer in reversed(self.rules):
            found = pattern.search(question)
            if found:
                text = answer(found) if callable(answer) else answer
                if text is None:
                    continue
                self.answered.append((question.strip(), text))
                time.sleep(THINKS_S)
                os.write(self.master, f"{text}\n".encode())
                return
        raise AssertionError(f"nobody knows what to answer:\n{question}\n--- the screen:\n{self.text[-3000:]}")

    def look(self):
        """Reads, and does what the newest words ask for. Returns False at the end."""
        came = bool(select.select([self.master], [], [], KEY_S)[0])
        if came:
            try:
                self.text += os.read(self.master, 4096).decode(errors="replace")
            except OSError:
                return False
        new = self.text[self.read:]
        found, kind = min(((found, kind) for look, kind in self.marks if (found := look.search(new))), key=lambda one: (one[0].start(), -one[0].end()), default=(None, None))
        if found:
            self.read += found.end()
            if kind == "hold":
                time.sleep(READS_S)
                self.is_held = True
            elif kind == "relay":
                self.relay_until, self.relays = time.monotonic() + 1.5, set()
            elif kind == "waiting":
                next(work for asked, work in self.works.items() if asked in self.reader.english(new[:found.end()]))()
            elif kind == "way" and self.eyes is not None:
                self.before, self.plate_then = self.eyes.cylinders(), self.eyes.plate()
            elif kind == "let go":
                self.is_held = False
                time.sleep(0.5)
                if self.eyes is not None and self.before:
                    self.after, self.plate_now = self.eyes.cylinders(), self.eyes.plate()
            elif kind == "stopped":
                self.is_held = False
                time.sleep(0.3)
                self.is_held = True
        elif self.relay_until is not None and time.monotonic() > self.relay_until:
            self.is_held, self.relay_until = False, None
        elif self.is_held:
            if self.relay_until is not None:
                self.relays |= set(self.eyes.twin.relays)
            os.write(self.master, b" ")
        elif new.endswith("> ") and not came:
            asked = self.reader.english(new.replace("\r", "").rsplit("\n\n", 1)[-1])
            self.read = len(self.text)
            self.answer(re.sub(r"[ \n]+", " ", asked))
        return self.process.poll() is None

    def run(self):
        """To the end of the conversation. Where the person does not know what to answer nothing is left running."""
        end = time.monotonic() + self.seconds
        try:
            while self.look():
                assert time.monotonic() < end, f"not done in {self.seconds} s:\n{self.text[-60000:]}"
        except AssertionError:
            self.kill()
            raise
        return self.end()

    def end(self):
        while select.select([self.master], [], [], 0)[0]:
            try:
                self.text += os.read(self.master, 4096).decode(errors="replace")
            except OSError:
                break
        code = self.process.wait(timeout=30)
        os.close(self.master)
        return code, self.text.replace("\r", "")

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(timeout=10)
        os.close(self.master)


def chord(radius_mm, degrees):
    return 2 * radius_mm * math.sin(math.radians(degrees) / 2)
