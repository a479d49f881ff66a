#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""demo_sender.py - the show of tools/demo: sends frames over UDP to two running platforms and notes what they make of them.

usage: demo_sender.py FOLDER HEAVECTL HEXAPOD_PORT TRIPOD_PORT

FOLDER holds the control sockets hexapod.sock and tripod.sock. Waits until both platforms are ENGAGED, sends the show, leaves what both
report at its end (hexapod.json, tripod.json) for demo_report.py, and shuts them down. Meanwhile `heavectl watch` shows the hexapod, with
what is being sent below. Exit status 1, and one line, if a platform does not come up or does not answer.
"""
import argparse
import contextlib
import fcntl
import json
import math
import os
import pty
import signal
import socket
import subprocess
import sys
import termios
import threading
import time
from pathlib import Path

UP_TIMEOUT_S = 15
DOWN_TIMEOUT_S = 10
SEEN_S = 0.35

# The table of section 2 of the vendor's document, then the examples of its commands. The T forms come first: the forms without T go to the
# same place, and after them there would be no way left to go.
TABLE = ["@A3:12.3,2.5,50,0#", "@A4:12,2,3,30,0#", "@A6:2.5,3.5,6,10,5,40,2#", "@A7:3.5,1.5,12,8,5,30,20,4#",
         "@C3:25,20,6,2#", "@C6:12.5,3.5,16,10,15,40,2#", "@C7:3.5,1.5,12,8,5,30,20,4#"]
EXAMPLES = ["@A3T:5.5,3.0,20,3000#", "@A3:5.5,3.0,20,0F#",
            "@A4T:5.5,3.0,20,45,3000#", "@A4:5.5,3.0,20,45,0F#",
            "@A6T:5,6,0,5.5,3.0,20,3000#", "@A6:5,6,0,5.5,3.0,20,F0#",
            "@A7T:5,6,0,5.5,3.0,20,-30,3000#", "@A7:5,6,0,5.5,3.0,20,-30,F0#",
            "@C3T:55, 33, 25, 3000#", "@C3:55,33,25,01#",
            "@C6T:55,33,25,20,20,50,3000#", "@C6:55,33,25,20,20,50,0100#",
            "@C7T:55, 33, 25, 20, 20, 50, 25.5, 3000#", "@C7:55,33,25,20,20,50,25.5,0100#"]

# As the document prints them, slips included, with the reason they are rejected for. They come while a T move of 3 s is under way.
SLIPS_DURING, SLIP_S = "@A6T:5,6,0,5.5,3.0,20,3000#", 0.8
SLIPS = {"@\u04103:12.3,2.5,50,0#": "command",                       # a Cyrillic A
         "C3T:55, 33, 25, 3000#": "no_head",
         "@C7T:55, 33, 25, 20, 20, 50, 25. 5, 3000#": "value_syntax"}

CYLINDERS = {"hexapod": "six", "tripod": "three"}
ACCEPTED = {"hexapod": {"A3", "A4", "A6", "A7", "C6", "C7"}, "tripod": {"A3", "A4", "C3"}}

POSE_STREAM_HZ = 60
TIMED_STREAM_MS = 20
STREAM_S = 2.5


def sway(t, seconds):
    """A pose t seconds into a stream, from pose zero and back to it."""
    share = math.sin(math.pi * t / seconds) ** 2
    return [share * value for value in (6 * math.sin(2.0 * t), 5 * math.sin(2.6 * t + 1), 4 * math.sin(1.4 * t),
                                        25 * math.sin(1.8 * t), 20 * math.sin(2.2 * t + 2), 30 * math.sin(1.2 * t))]


def pose_stream():
    """Poses with a light that runs over the relays."""
    for i in range(int(STREAM_S * POSE_STREAM_HZ)):
        t = i / POSE_STREAM_HZ
        values = ",".join(f"{value:.6g}" for value in sway(t, STREAM_S))
        yield f"@A6:{values},{1 << int(t * 12) % 12:X}#"


def timed_stream():
    """As public senders do it: T is the period, a line feed ends the datagram, all zeros end the motion."""
    for i in range(int(STREAM_S * 1000 / TIMED_STREAM_MS)):
        values = ",".join(f"{value:.3f}" for value in sway(i * TIMED_STREAM_MS / 1000, STREAM_S))
        yield f"@A6T:{values},{TIMED_STREAM_MS}#\n"
    yield f"@A6T:0.000,0.000,0.000,0.000,0.000,0.000,{TIMED_STREAM_MS}#\n"


def command_of(frame):
    return frame.lstrip("@").partition(":")[0].rstrip("T")


class Counts:
    """What a platform has to report at the end of the show."""

    def __init__(self, name):
        self.name = name
        self.datagrams = 0
        self.timed = 0
        self.accepted = {}
        self.rejected = {}

    def add(self, frame):
        self.datagrams += 1
        command = command_of(frame)
        reason = SLIPS.get(frame) or ("platform" if command not in ACCEPTED[self.name] else None)
        if reason:
            self.rejected[reason] = self.rejected.get(reason, 0) + 1
        else:
            self.accepted[command] = self.accepted.get(command, 0) + 1
            self.timed += "T:" in frame


def expected():
    """Of the whole show, by platform."""
    counts = {name: Counts(name) for name in ACCEPTED}
    for frame in [*TABLE, *EXAMPLES, *SLIPS]:
        for count in counts.values():
            count.add(frame)
    for frame in [*pose_stream(), *timed_stream()]:
        counts["hexapod"].add(frame)
    return counts


class NoAnswer(Exception):
    """A platform is not there, or not as it should be; the text says what is wrong."""


class Screen:
    """heavectl watch: its table with one more line below it, or plain lines where there is no terminal."""

    def __init__(self, command):
        self.is_terminal = sys.stdout.isatty()
        self.note = ""
        self.thread = None
        if self.is_terminal:
            self.master, slave = pty.openpty()
            self.copy_size()
            self.watch = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=slave, stderr=subprocess.DEVNULL)
            os.close(slave)
            self.thread = threading.Thread(target=self.forward, daemon=True)
            self.thread.start()
        else:
            self.watch = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def copy_size(self):
        """The table is as wide as the terminal, also after that has changed."""
        fcntl.ioctl(self.master, termios.TIOCSWINSZ, fcntl.ioctl(1, termios.TIOCGWINSZ, bytes(8)))

    def forward(self):
        """Passes the table on. It clears what is below it every time: that is where the line goes."""
        try:
            while data := os.read(self.master, 65536):
                self.copy_size()
                note = self.note[:os.get_terminal_size(1).columns - 1].encode()
                sys.stdout.buffer.write(data.replace(b"\033[J", b"\033[K\r\n" + note + b"\033[K\033[J"))
                sys.stdout.buffer.flush()
        except OSError:  # what a pseudo-terminal says at its end
            pass

    def say(self, text):
        text = text.encode("ascii", "backslashreplace").decode()
        if self.is_terminal:
            self.note = text
        else:
            print(text, flush=True)

    def wait(self, seconds):
        """Until the end of heaved ends the table."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.watch.wait(seconds)

    def close(self):
        self.watch.terminate()
        self.watch.wait()
        if self.thread:
            self.thread.join(1)
            sys.stdout.write("\033[?25h\033[?1049l")  # said by the table already, unless it did not come to that
            sys.stdout.flush()


class Show:
    def __init__(self, folder, heavectl, ports):
        self.heavectl = heavectl
        self.folder = folder
        self.ports = ports
        self.screen = None
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def command(self, name, *arguments):
        return [self.heavectl, "--socket", self.folder / f"{name}.sock", *arguments]

    def ask(self, name, *arguments):
        run = subprocess.run(self.command(name, *arguments), stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
        if run.returncode != 0:
            raise NoAnswer(f"the {name} does not answer: {run.stderr.strip()}")
        return run.stdout

    def status(self, name):
        return json.loads(self.ask(name, "--json", "status"))

    def wait_until_engaged(self):
        deadline = time.monotonic() + UP_TIMEOUT_S
        waiting = list(self.ports)
        while waiting:
            status = self.status(waiting[0])
            state = status["state"]
            if state == "ENGAGED" or (state == "HOLD" and status["held_by_silence"]):  # it was, and has waited for the other one
                waiting.pop(0)
            elif time.monotonic() > deadline:
                raise NoAnswer(f"the {waiting[0]} is not ENGAGED after {UP_TIMEOUT_S} s, but {state}")
            time.sleep(0.05)

    def send(self, frame, *names):
        if self.screen.watch.poll() is not None:
            raise NoAnswer("heaved has ended in the middle of the show")
        for name in names:
            self.socket.sendto(frame.encode(), ("127.0.0.1", self.ports[name]))

    def send_examples(self):
        frames = [*TABLE, *EXAMPLES]
        for number, frame in enumerate(frames, 1):
            takers = " and ".join(CYLINDERS[name] for name in self.ports if command_of(frame) in ACCEPTED[name])
            self.screen.say(f"example {number} of {len(frames)}:  {frame}   (for {takers} cylinders)")
            self.send(frame, *self.ports)
            if frame == SLIPS_DURING:
                self.send_slips()
            time.sleep(SEEN_S)

    def send_slips(self):
        time.sleep(SLIP_S)
        for frame, reason in SLIPS.items():
            self.screen.say(f"meanwhile a misprint of the document, to be rejected ({reason}):  {frame}")
            self.send(frame, *self.ports)
            time.sleep(SLIP_S)

    def send_stream(self, text, frames, period_s):
        self.screen.say(text)
        start = time.monotonic()
        for i, frame in enumerate(frames):
            time.sleep(max(0.0, start + i * period_s - time.monotonic()))
            self.send(frame, "hexapod")
        time.sleep(SEEN_S)

    def play(self):
        self.screen.say("the platforms rise")
        self.wait_until_engaged()
        self.send_examples()
        self.send_stream(f"{POSE_STREAM_HZ} poses a second:  @A6:roll,pitch,yaw,x,y,z,mask#", pose_stream(), 1 / POSE_STREAM_HZ)
        self.send_stream(f"{1000 // TIMED_STREAM_MS} timed poses a second:  @A6T:roll,pitch,yaw,x,y,z,{TIMED_STREAM_MS}#",
                         timed_stream(), TIMED_STREAM_MS / 1000)
        for name in self.ports:
            (self.folder / f"{name}.json").write_text(json.dumps(self.status(name)), encoding="ascii")
        self.screen.say("end of the show: the platforms settle")
        for name in self.ports:
            self.ask(name, "shutdown")
        self.screen.wait(DOWN_TIMEOUT_S)

    def run(self):
        self.status("hexapod")
        self.screen = Screen(self.command("hexapod", "watch"))
        try:
            self.play()
        finally:
            self.screen.close()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("heavectl", type=Path)
    parser.add_argument("hexapod_port", type=int)
    parser.add_argument("tripod_port", type=int)
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    ports = {"hexapod": arguments.hexapod_port, "tripod": arguments.tripod_port}
    try:
        Show(arguments.folder, arguments.heavectl, ports).run()
    except NoAnswer as error:
        print(f"demo: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
