#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_mistakes.py BIN [PAIRS [SEED] | PART OF A NAME] - what only the machine can reveal: people who are wrong about theirs, before heavectl setup. Each mistake is named in its
step and mended by one answer, and what is written is right. PAIRS: that many random pairs of mistakes in place of the chosen ones; takes most of a minute each."""
import random
import re
import sys
from pathlib import Path

import tap
from person import Eyes
from test_setup import RETRACTED, Machine, judge

STROKE, START = 120, ("--start", "50")  # a short one: both ends are soon there
BEYOND = r"was measured as [0-9.]+ mm long. It is [0-9.]+ mm long fully in"
BEYOND_OUT, BEYOND_IN = f"went no further out|{BEYOND}", f"went no further in|{BEYOND}"
TIMES = {2.0: "2 times", 0.5: "1/2 of"}


class Mistake:
    """twin: how the machine is. more: likewise, in the file that heave-twin has. rules: what the person answers at first. called: the number that the person gives
    to a cylinder. said: what setup has to say."""

    def __init__(self, name, said, kind=None, twin=(), more="", rules=(), called=None):
        self.name, self.said, self.kind, self.twin, self.more, self.rules, self.called = name, said, kind or name, twin, more, rules, called

    def __repr__(self):
        return self.name


class WrongEyes(Eyes):
    """Of somebody who counts the cylinders otherwise, until told."""
    called = staticmethod(lambda cylinder: cylinder)

    def cylinders(self):
        return {self.called(leg): position for leg, position in super().cylinders().items()}

    def learn(self):
        self.called = lambda cylinder: cylinder


def first(wrong):
    """That answer once; afterwards the person knows better."""
    said = []

    def answer(asked):
        if said:
            return None
        said.append(asked[0])
        return wrong(asked) if callable(wrong) else wrong
    return answer


def power_cycle(machine):
    def answer(_):
        machine.twin.fault("power-off all")
        machine.twin.fault("power-on all")
        return "y"
    return answer


def misread(cylinder, off):
    return lambda machine: [(rf"How long is cylinder {cylinder} now", first(lambda _: f"{machine.eyes.length(cylinder) + off:.2f}"))]


def begun_from_a_file(machine):
    """The file has a stroke that the machine has not; its joints are right."""
    begun = Path(machine.folder.name) / "begun.ini"
    begun.write_text(machine.truth.read_text(encoding="utf-8").replace(f"stroke_mm = {STROKE}", "stroke_mm = 180"), encoding="utf-8")
    return [(r"From what do you want to begin", str(begun)), (r"where the joints are", "k"), (r"Lead:|counts has one turn", ""), (r"Limits of the axes", "y")]


def numbered(name, said, called):
    return Mistake(name, said, kind="numbers", called=called)


MISTAKES = [
    *(Mistake(f"cables {a} and {b} exchanged", rf"Drives {a} and {b} have changed places|Drive \d moves cylinder \d\.", kind="cables", twin=("--swap", f"{a},{b}")) for a, b in ((2, 5), (1, 2), (4, 6))),
    *(Mistake(f"drive {k} runs backwards", f"Drive {k} runs backwards", kind="reversed", twin=("--reverse", str(k))) for k in (4, 1)),
    *(Mistake(f"the screw of {k} x {times}", rf"Drive \d moves cylinder \d by {re.escape(TIMES[times])}", kind="lead", twin=("--lead", f"{k}={times}")) for k, times in ((3, 2.0), (6, 0.5))),
    Mistake("all counts x 0.5", r"by 1/2 of", kind="scale", rules=lambda _: [(r"counts has one turn", "65536")]),
    Mistake("all screws x 2", r"by 2 times", kind="scale", rules=lambda _: [(r"Lead:", "5")]),
    numbered("the front two legs off", "numbered from another side than the front", lambda leg: (leg + 1) % 6 + 1),
    numbered("the front four legs off", "numbered from another side than the front", lambda leg: (leg + 3) % 6 + 1),
    numbered("numbered the other way round", "numbered the other way round", lambda leg: (2 - leg) % 6 + 1),
    *(Mistake(f"the length of {k} misread by {off} mm", "plate did not stand as the measured lengths said", kind="zero", rules=misread(k, off)) for k, off in ((1, -8), (5, 20))),
    Mistake("encoders that lose their counts taken for absolute ones", "encoders lose their counts", kind="encoders", more="homing_method = 17\n",
            rules=lambda machine: [(r"switch the supply of the drives off", first(power_cycle(machine))), (r"Have the cylinders really moved", "h"), (r"Homing method", "17")]),
    Mistake("stroke 180 for 120", BEYOND_OUT, kind="stroke", rules=lambda _: [(r"Stroke of a cylinder", first("180"))]),
    Mistake("a file with a stroke of 180 for 120", BEYOND_OUT, kind="stroke", rules=begun_from_a_file),
    Mistake("fully in 30 mm too long", BEYOND_OUT, kind="stroke", rules=lambda _: [(r"that is fully in", first(f"{RETRACTED + 30}"))]),
    Mistake("fully in 30 mm too short", BEYOND_IN, kind="stroke", rules=lambda _: [(r"that is fully in", first(f"{RETRACTED - 30}"))]),
]
CHOSEN = [  # each kind once, and what disturbs what
    ("the front two legs off", "cables 1 and 2 exchanged", "stroke 180 for 120"),
    ("numbered the other way round", "drive 4 runs backwards", "the length of 1 misread by -8 mm", "fully in 30 mm too short"),
    ("all counts x 0.5", "cables 2 and 5 exchanged", "fully in 30 mm too long", "the length of 5 misread by 20 mm"),
    ("encoders that lose their counts taken for absolute ones", "the screw of 3 x 2.0", "the front four legs off"),
    ("a file with a stroke of 180 for 120", "cables 4 and 6 exchanged"),
]


def made(*mistakes):
    """The machine and the person as they are; setup names each, and what it writes is right."""
    with Machine(*START, *(word for one in mistakes for word in one.twin), cycle_us=4000, stroke=STROKE, more="".join(one.more for one in mistakes)) as machine:
        machine.eyes = WrongEyes(machine.twin, RETRACTED, machine.zero_height())
        for one in mistakes:
            if one.called:
                machine.eyes.called = one.called

        def learn(_):
            machine.eyes.learn()
            return "r"
        rules = [(r"r number them so|The cylinders were numbered", learn), (r"went no further", "s")]
        rules.append((r"What is wrong", "s"))
        rules += [rule for one in mistakes if one.rules for rule in one.rules(machine)]
        code, screen = machine.person(*rules, seconds=1200).run()
        report = Path(f"{machine.file}.report.txt")
        said = re.sub(r"\s+", " ", screen + (report.read_text(encoding="utf-8") if report.exists() else ""))
        missing = [one.name for one in mistakes if not re.search(one.said, said)]
        assert code == 0 and not missing, f"not named: {missing}\n{screen[-4000:]}"
        judge(machine)
        text = machine.file.read_text(encoding="utf-8")
        assert re.search(rf"^stroke_mm = {STROKE}\b", text, re.MULTILINE) and re.search(rf"^retracted_length_mm = {RETRACTED}\b", text, re.MULTILINE), text


def chosen():
    by_name = {one.name: one for one in MISTAKES}
    for names in CHOSEN:
        yield [by_name[name] for name in names]


def random_pairs(count, seed):
    chance = random.Random(seed)
    while count > 0:
        pair = chance.sample(MISTAKES, 2)
        kinds = {one.kind for one in pair}
        if len(kinds) == 2 and kinds != {"lead", "scale"}:  # two wrong scales are one, or none
            yield pair
            count -= 1


def main():
    suite = tap.Suite()
    wanted = sys.argv[2] if len(sys.argv) > 2 else ""
    cases = random_pairs(int(wanted), int(sys.argv[3]) if len(sys.argv) > 3 else 1) if wanted.isdigit() else chosen()
    for mistakes in cases:
        name = "; ".join(one.name for one in mistakes)
        if wanted.isdigit() or wanted in name:
            with suite.case(name):
                made(*mistakes)
    if not wanted:
        with suite.case("a mistake of each kind is among these"):
            assert {one.kind for one in MISTAKES} == {one.kind for mistakes in chosen() for one in mistakes}
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
