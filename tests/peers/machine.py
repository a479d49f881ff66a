# SPDX-License-Identifier: MIT
"""machine.py - the CiA 402 states of a simulated drive: which controlword leads where, and how long it takes."""

NOT_READY, DISABLED, READY, ON, ENABLED, QUICK_STOP, REACTION, FAULT = (
    "not ready", "switch on disabled", "ready", "switched on", "operation enabled", "quick stop", "fault reaction", "fault")

# What 6041h says in bits 0..3, 5, 6.
WORDS = {NOT_READY: 0x00, DISABLED: 0x40, READY: 0x21, ON: 0x23, ENABLED: 0x27, QUICK_STOP: 0x07, REACTION: 0x0F, FAULT: 0x08}
POWERED = (ON, ENABLED, QUICK_STOP, REACTION)

SHUTDOWN, SWITCH_ON, ENABLE, NO_VOLTAGE, STOP = "shutdown", "switch on", "enable", "disable voltage", "quick stop"

# (state, command) -> (next state, which delay); "switch on" from ENABLED is "disable operation".
TRANSITIONS = {
    (DISABLED, SHUTDOWN): (READY, "quick"), (READY, SWITCH_ON): (ON, "power"), (READY, ENABLE): (ON, "power"), (ON, ENABLE): (ENABLED, "brake"),
    (ON, SHUTDOWN): (READY, "quick"), (READY, NO_VOLTAGE): (DISABLED, "quick"), (READY, STOP): (DISABLED, "quick"),
    (ON, NO_VOLTAGE): (DISABLED, "quick"), (ON, STOP): (DISABLED, "quick"), (ENABLED, SWITCH_ON): (ON, "quick"),
    (ENABLED, SHUTDOWN): (READY, "quick"), (ENABLED, NO_VOLTAGE): (DISABLED, "quick"), (QUICK_STOP, NO_VOLTAGE): (DISABLED, "quick"),
}


def command_of(word):
    """Which command a controlword is, after the pattern of bits 7, 3, 2, 1, 0; None where it is none."""
    if word & 0x80:
        return None
    if not word & 0x02:
        return NO_VOLTAGE
    if not word & 0x04:
        return STOP
    if not word & 0x01:
        return SHUTDOWN
    return ENABLE if word & 0x08 else SWITCH_ON


class Machine:
    def __init__(self, delays_us, say):
        self.delays_us, self.say = delays_us, say
        self.state, self.word = NOT_READY, 0
        self.next_state, self.due_us = None, None
        self.is_broken = False  # the cause of the fault stays
        self.go(DISABLED, delays_us["quick"])

    def go(self, state, due_us):
        self.next_state, self.due_us = state, due_us

    def enter(self, state):
        self.next_state = self.due_us = None
        if state != self.state:
            self.state = state
            self.say("state", state)

    def control(self, word, now_us):
        """A new controlword, or the same again: levels count, but for the edge that resets a fault. True: a quick stop begins."""
        rising, self.word = word & ~self.word, word
        if self.state == FAULT and rising & 0x80 and not self.is_broken:
            self.say("fault reset", word)
            self.enter(DISABLED)
            return False
        command = command_of(word)
        if self.state == ENABLED and command == STOP:
            self.enter(QUICK_STOP)
            return True
        target, delay = TRANSITIONS.get((self.state, command), (None, None))
        if target is None:
            self.next_state = self.due_us = None if self.state != NOT_READY else self.due_us
        elif target != self.next_state:
            self.go(target, now_us + self.delays_us[delay])
        return False

    def advance(self, now_us):
        """True: a state was entered."""
        if self.due_us is None or now_us < self.due_us:
            return False
        self.enter(self.next_state)
        return True
