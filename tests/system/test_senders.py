#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_senders.py BIN JUDGE - who is followed in a network: heaved, two senders and one that pretends to be another, each in a network name space of its
own on one bridge, as a user or as root. Skipped where the kernel has no such name spaces. JUDGE is tests/judge's."""
import argparse
import json
import math
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time

import harness
import kernel
import tap

HEAVED, FIRST, SECOND, STRANGER = "10.77.0.1", "10.77.0.2", "10.77.0.3", "10.77.0.9"
MOVED = "10.77.0.66"  # what a lease may change FIRST to
OUTSIDE = "192.0.2.7"
TAKEOVER_MS, SILENCE_MS, ENGAGE_MM_S = 2500, 1000, 150
PATIENCE_MS = 60000  # where nobody is to take over, however late a busy machine lets its driver be
PERIOD_S = 0.02
LATE_MS = 100  # a cycle on a busy machine
PROBE = "ip link set lo up && ip link add br0 type bridge && ip link add e0 type veth peer name e1"
FAR = "@A6:0,0,0,0,0,40,0#"
SETUP = f"""ip link set lo up
ip link add br0 type bridge
ip address add {HEAVED}/24 broadcast + dev br0
ip link set br0 up
ip route add default dev br0
"""


def wave(t):
    return f"@A6:{3 * math.sin(t):.3f},{2 * math.sin(1.3 * t):.3f},0,0,0,{10 * math.sin(0.7 * t):.3f},0#"


# --- A host: a process in a name space of its own that does what it is told, line by line ---

class Agent:
    """Runs inside."""

    def __init__(self):
        self.thread, self.is_over, self.sent = None, threading.Event(), 0

    def run(self, command):
        subprocess.run(command, shell=True, check=True)

    def send(self, to, port, texts):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            link.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            for text in texts:
                link.sendto(text.encode(), (to, port))

    def send_to_group(self, group, port, texts):
        """Out of the only card, whatever the routes say."""
        family, level, option = (socket.AF_INET6, socket.IPPROTO_IPV6, socket.IPV6_MULTICAST_IF) if ":" in group else (socket.AF_INET, socket.IPPROTO_IP, socket.IP_MULTICAST_IF)
        card = socket.if_nametoindex("eth0")
        with socket.socket(family, socket.SOCK_DGRAM) as link:
            link.setsockopt(level, option, card if family == socket.AF_INET6 else struct.pack("=4x4xi", card))
            try:
                return sum(link.sendto(text.encode(), (group, port)) > 0 for text in texts)
            except OSError:
                return 0  # an address of IPv6 is tried out for a second first

    def raw(self, to, packets, count, pause_s=0):
        """Whole IPv4 packets, by turns."""
        with socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_RAW) as link:
            packets = [bytes.fromhex(packet) for packet in packets]
            for i in range(count):
                link.sendto(packets[i % len(packets)], (to, 0))
                time.sleep(pause_s)

    def stream(self, port, texts, pretended=None):
        """Over and over again, until end(); under a pretended address, if there is one."""
        self.is_over.clear()
        self.sent = 0
        self.thread = threading.Thread(target=self.keep_sending, args=(port, texts, pretended))
        self.thread.start()

    def keep_sending(self, port, texts, pretended):
        while not self.is_over.is_set():
            text = texts[self.sent % len(texts)]
            try:
                if pretended:
                    self.raw(HEAVED, ipv4(pretended, port, text), 1)
                else:
                    self.send(HEAVED, port, [text])  # a socket each: the sender goes on whatever becomes of its address
            except OSError:
                pass  # no way there at the moment
            self.sent += 1
            time.sleep(PERIOD_S)

    def end(self):
        self.is_over.set()
        self.thread.join()
        return self.sent


def agent_main():
    agent = Agent()
    print("{}", flush=True)
    for line in sys.stdin:
        name, arguments = json.loads(line)
        print(json.dumps({"result": getattr(agent, name)(**arguments)}), flush=True)
    agent.is_over.set()


class Host:
    """The same from outside: host.send(...) and so on."""

    def __init__(self, number, address):
        self.address, self.port = address, f"e{number}"
        self.process = subprocess.Popen(["unshare", "--net", sys.executable, __file__, "--agent"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.process.stdout.readline()
        sh(f"ip link add {self.port} type veth peer name eth0 netns {self.process.pid}; ip link set {self.port} master br0; ip link set {self.port} up")
        self.run(command=f"ip address add {address}/24 broadcast + dev eth0 && ip link set eth0 up && ip route add default dev eth0")

    def __getattr__(self, name):
        def call(**arguments):
            print(json.dumps([name, arguments]), file=self.process.stdin, flush=True)
            return json.loads(self.process.stdout.readline())["result"]
        return call

    def close(self):
        self.process.stdin.close()
        self.process.wait(timeout=harness.WAIT_S)
        self.process.stdout.close()
        subprocess.run(["ip", "link", "delete", self.port], stderr=subprocess.DEVNULL, check=False)


def sh(commands):
    subprocess.run(["sh", "-e", "-c", commands], check=True)


def ipv4(source, port, payload, to=HEAVED, pieces=1):
    """A datagram as whole IPv4 packets, in hexadecimal; more than one piece: fragments."""
    data = struct.pack(">HHHH", 40000, port, 8 + len(payload), 0) + payload.encode()
    each = -(-len(data) // (8 * pieces)) * 8 if pieces > 1 else len(data)
    packets = []
    for at in range(0, len(data), each):
        part, is_last = data[at:at + each], at + each >= len(data)
        head = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(part), 0x1234, (0 if is_last else 0x2000) | at // 8, 64, socket.IPPROTO_UDP, 0,
                           socket.inet_aton(source), socket.inet_aton(to))
        packets.append((head + part).hex())
    return packets


# --- The platform among them ---

class Net(harness.Bench):
    def __init__(self, bin_dir):
        super().__init__(bin_dir, udp__bind="0.0.0.0", udp__silence_hold_ms=SILENCE_MS, engage__speed_mm_s=ENGAGE_MM_S, engage__accel_mm_s2=600)
        text = self.config.read_text(encoding="utf-8")  # a lone frame gets where it leads before the silence holds it
        self.config.write_text(text.replace("[engage]\n", "[engage]\nblend_ms = 250\n", 1), encoding="utf-8")
        self.trace, self.record = self.folder / "live.csv", self.folder / "record.txt"
        self.hosts = []

    def __exit__(self, *arguments):
        for host in self.hosts:
            host.close()
        super().__exit__(*arguments)

    def host(self, address):
        self.hosts.append(Host(len(self.hosts), address))
        return self.hosts[-1]

    def set_udp(self, **changes):
        """Keys of [udp], also such as are not in the file."""
        text = self.config.read_text(encoding="utf-8")
        for key, value in changes.items():
            text = re.sub(rf"^{key} *=.*\n", "", text, flags=re.MULTILINE).replace("[udp]\n", f"[udp]\n{key} = {value}\n")
        self.config.write_text(text, encoding="utf-8")

    def up(self):
        self.daemon = self.start("--trace", self.trace, "--record", self.record)
        self.wait_state("ENGAGED")

    def reload(self, **changes):
        self.set_udp(**changes)
        before = self.daemon.log.read_text().count("has been read again")
        self.daemon.send_signal(signal.SIGHUP)
        harness.wait_for(lambda: self.daemon.log.read_text().count("has been read again") > before, "the configuration is read again")

    def driver(self):
        sender = self.status()["sender"]
        return sender and sender["address"].rsplit(":", 1)[0]

    def wait_driver(self, address):
        harness.wait_for(lambda: self.driver() == address, f"{address} drives")

    def count(self, *names):
        value = self.status()["counters"]
        for name in names:
            value = value[name]
        return value

    def wait_more(self, than, *names):
        harness.wait_for(lambda: self.count(*names) > than, f"more than {than} {'.'.join(names)}")

    def wait_height(self, mm):
        harness.wait_for(lambda: abs(self.status()["pose_sent"]["z_mm"] - mm) < 0.001, f"{mm} mm up")

    def down(self):
        """Ends well, every limit kept in every cycle; the rows."""
        assert self.stop(self.daemon) == 0, self.daemon.log.read_text()
        with self.trace.open("rb") as trace:
            run = subprocess.run([sys.argv[2], self.config], stdin=trace, stdout=subprocess.PIPE, check=False)
        assert run.returncode == 0, run.stdout.decode()
        return harness.rows_of(self.trace.read_bytes())

    def frames(self):
        """What was recorded: (ms, address) of every datagram."""
        found, sender = [], "127.0.0.1"
        for line in self.record.read_text(encoding="utf-8").splitlines():
            at, _, text = line.partition(" ")
            if text.startswith("!from "):
                sender = text.split()[1]
            elif text.startswith("@"):
                found.append((float(at), sender))
        return found


def owners(frames):
    """Who drives from when on, by silence alone: a second opinion."""
    changes, last = [], None
    for at, sender in frames:
        if not changes:
            changes.append((at, sender))
        elif sender != changes[-1][1]:
            if at - last < TAKEOVER_MS:
                continue
            changes.append((at, sender))
        last = at
    return changes


def speed_of_takeover(rows, since_ms):
    """The fastest cylinder until the take-over that begins there has arrived, mm/s."""
    at = next(i for i, row in enumerate(rows) if float(row["t_ms"]) >= since_ms)
    fastest, is_begun = 0, False
    while not is_begun or "takeover" in rows[at]["flags"]:
        is_begun = is_begun or "takeover" in rows[at]["flags"]
        for i in range(1, 7):
            fastest = max(fastest, abs(float(rows[at][f"c{i}_mm"]) - float(rows[at - 1][f"c{i}_mm"])) * 1000)
        at += 1
    return fastest


def taken_over_in_hold(rows, at_ms):
    """A cycle takes what came until it ran, and a busy machine runs it later than its time in the row."""
    changes = [float(row["t_ms"]) for before, row in zip(rows, rows[1:]) if (before["state"], row["state"]) == ("HOLD", "ENGAGED")]
    assert any(at_ms - LATE_MS <= t <= at_ms + 1 for t in changes), (at_ms, changes)


def two_senders(net):
    """One is followed; the other after silence, at engage speed; then at once, by a list of priorities."""
    first, second = net.host(FIRST), net.host(SECOND)
    net.up()
    first.stream(port=net.port, texts=[wave(i * PERIOD_S) for i in range(400)])
    net.wait_more(10, "accepted", "A6")
    second.stream(port=net.port, texts=[FAR])
    net.wait_more(20, "other_sender")
    status = net.status()
    assert status["sender"]["address"].startswith(f"{FIRST}:") and status["other_sender"]["address"].startswith(f"{SECOND}:"), status
    assert status["pose_sent"]["z_mm"] < 11 and re.search(rf"frame from {SECOND}:\d+ not followed: {FIRST}:\d+ drives", net.daemon.log.read_text())
    first.end()
    net.wait_driver(SECOND)
    net.wait_height(40)
    net.reload(priority=FIRST)
    first.stream(port=net.port, texts=[wave(i * PERIOD_S) for i in range(400)])
    net.wait_driver(FIRST)
    net.wait_more(net.count("accepted", "A6") + 20, "accepted", "A6")
    first.end(), second.end()
    assert net.count("owner_changes") >= 2
    rows, changes = net.down(), owners(net.frames())
    assert [sender for _, sender in changes[:2]] == [FIRST, SECOND], changes
    taken_over_in_hold(rows, changes[1][0])
    assert 1 < speed_of_takeover(rows, changes[1][0]) <= ENGAGE_MM_S * 1.000001


def spoofed(net):
    """Addresses outside `allow`, in any number, change nothing; who takes the driver's address can do what the driver can, within the limits."""
    first, second, stranger = net.host(FIRST), net.host(SECOND), net.host(STRANGER)
    net.set_udp(allow=f"{FIRST}, 10.77.0.128/25", takeover_ms=PATIENCE_MS)
    net.up()
    first.stream(port=net.port, texts=[wave(i * PERIOD_S) for i in range(400)])
    net.wait_more(10, "accepted", "A6")
    # not allowed: each one refused and counted
    second.send(to=HEAVED, port=net.port, texts=[FAR] * 5)
    stranger.raw(to=HEAVED, packets=ipv4(OUTSIDE, net.port, FAR) + ipv4("10.77.0.127", net.port, FAR), count=10)
    net.wait_more(14, "refused_senders")
    # allowed by its network, but not the one that drives
    stranger.raw(to=HEAVED, packets=ipv4("10.77.0.128", net.port, FAR), count=5)
    net.wait_more(4, "other_sender")
    assert net.driver() == FIRST and net.count("refused_senders") == 15
    # as the driver: followed, as the driver would be
    wild = [f"@A6:{value},-{value},{value},{value},-{value},{value},FFF#" for value in (90, 1000, 32000)] + ["@A6T:0,0,0,0,0,90,0#", "@C6:9999,0,9999,0,9999,0,0#"]
    accepted = net.count("accepted", "A6")
    stranger.raw(to=HEAVED, packets=[packet for text in wild for packet in ipv4(FIRST, net.port, text)], count=100, pause_s=0.01)
    net.wait_more(accepted + 60, "accepted", "A6")
    first.end()
    stranger.stream(port=net.port, texts=[FAR], pretended=FIRST)
    net.wait_height(40)
    stranger.end()
    first.stream(port=net.port, texts=[wave(i * PERIOD_S) for i in range(400)])
    assert net.driver() == FIRST and net.count("owner_changes") == 0
    # a flood from outside: the kernel's filter drops it unread, and the driver is heard
    flood = {"to": HEAVED, "packets": [packet for i in range(250) for packet in ipv4(f"192.0.2.{i}", net.port, FAR)], "count": 10000}
    log = lambda: net.daemon.log.read_text()  # noqa: E731
    harness.wait_for(lambda: stranger.raw(**flood) or "a flood of useless datagrams" in log(), "the flood is noticed")
    before = net.status()["counters"]
    stranger.raw(**flood)
    harness.wait_for(lambda: net.count("lost_in_kernel") >= before["lost_in_kernel"] + 10000 or "is over" in log(), "the kernel drops it")
    assert net.count("refused_senders") < before["refused_senders"] + 1000 or "is over" in log()
    accepted = net.count("accepted", "A6")
    net.wait_more(accepted + 20, "accepted", "A6")
    assert net.driver() == FIRST and net.count("owner_changes") == 0
    first.end()
    net.down()


def odd_datagrams(net):
    """Broadcast and fragments are as any others, what is not for this machine is not heard."""
    first, stranger = net.host(FIRST), net.host(STRANGER)
    net.set_udp(takeover_ms=PATIENCE_MS)
    net.up()
    first.stream(port=net.port, texts=[FAR])
    net.wait_height(40)
    sent = first.end()
    count = sent
    net.wait_more(count - 1, "datagrams")
    assert net.count("datagrams") == count

    def heard(more):
        nonlocal count
        first.send(to=HEAVED, port=net.port, texts=[FAR])  # comes after whatever was sent before
        net.wait_more(count + more, "datagrams")
        count += more + 1
        assert net.count("datagrams") == count, (net.count("datagrams"), count)

    first.send(to="10.77.0.255", port=net.port, texts=[FAR])
    heard(1)
    first.send(to="255.255.255.255", port=net.port, texts=[FAR])
    heard(1)
    first.send(to="239.1.2.3", port=net.port, texts=[FAR])
    heard(0)
    stranger.send(to="10.77.0.255", port=net.port, texts=["@A6:0,0,0,0,0,0,0#"])
    net.wait_more(0, "other_sender")
    count += 1
    pieces = ipv4(FIRST, net.port, FAR, pieces=3)
    assert len(pieces) > 1
    first.raw(to=HEAVED, packets=pieces, count=len(pieces))
    heard(1)
    first.raw(to=HEAVED, packets=pieces[::-1], count=len(pieces))
    heard(1)
    first.raw(to=HEAVED, packets=pieces[:-1], count=len(pieces) - 1)  # the rest never comes
    heard(0)
    assert net.count("rejected") and sum(net.count("rejected").values()) == 0 and net.driver() == FIRST
    net.down()


def joined_groups(net):
    """A group that was asked for is heard as any datagram is, from IPv4 and IPv6; another group is not; a card that is not there ends the start."""
    first = net.host(FIRST)
    for bind, group, other in (("0.0.0.0", "239.1.2.3", "239.1.2.4"), ("::", "239.1.2.3", "239.1.2.4"), ("::", "ff15::9800", "ff15::9801"), ("::", "ff02::98", "ff02::99")):
        net.set_udp(bind=bind, group=f"{group}%br0", takeover_ms=PATIENCE_MS)
        net.up()
        assert f"UDP {bind} port {net.port}, group {group}%br0, control" in net.daemon.log.read_text()
        harness.wait_for(lambda: first.send_to_group(group=group, port=net.port, texts=[FAR]), f"{FIRST} has an address to send from")
        net.wait_height(40)
        first.send_to_group(group=other, port=net.port, texts=[FAR])
        first.send(to=HEAVED, port=net.port, texts=[FAR])  # comes after it
        net.wait_more(1, "datagrams")
        assert net.count("datagrams") == 2, (bind, group)
        net.down()
    net.set_udp(bind="0.0.0.0", group="239.1.2.3%eth7")
    failed = subprocess.run([net.bin / "heaved", "--config", net.config, "--socket", net.socket], capture_output=True, text=True, timeout=harness.WAIT_S, check=False)
    assert failed.returncode == 69 and "udp: group 239.1.2.3%eth7: this machine has no network interface \"eth7\": see `ip link`" in failed.stderr, failed


def moved_sender(net):
    """An address that changes in the ride is another sender; a link that goes down is silence."""
    first = net.host(FIRST)
    net.up()
    first.stream(port=net.port, texts=[wave(i * PERIOD_S) for i in range(400)])
    net.wait_more(10, "accepted", "A6")
    # the link
    sh(f"ip link set {first.port} down")
    net.wait_state("HOLD")
    assert net.status()["held_by_silence"] is True
    sh(f"ip link set {first.port} up")
    net.wait_state("ENGAGED")
    assert net.count("owner_changes") == 0
    net.wait_more(net.count("accepted", "A6") + 10, "accepted", "A6")
    # the address
    first.run(command=f"ip address delete {FIRST}/24 dev eth0 && ip address add {MOVED}/24 dev eth0")
    net.wait_more(0, "other_sender")
    net.wait_driver(MOVED)
    net.wait_state("ENGAGED")
    net.wait_more(net.count("accepted", "A6") + 10, "accepted", "A6")
    first.end()
    assert net.count("owner_changes") == 1
    rows = net.down()
    changes = owners(net.frames())
    assert [sender for _, sender in changes] == [FIRST, MOVED], changes
    taken_over_in_hold(rows, changes[1][0])


# --- Reordered and duplicated ones, on a network of paper ---

def disturbed(frames, every):
    """One of so many comes just after the next one, one of seven twice."""
    lines = []
    for i, (at, text) in enumerate(frames):
        is_late = i % every == 3 and 10 < i < len(frames) - 60
        lines.append((at + (21 + i % 5 if is_late else 0), text))
        if i % 7 == 0:
            lines.append((lines[-1][0] + i % 3, text))
    return sorted(lines, key=lambda line: line[0])


def reordered(bench):
    """What comes twice or in the wrong order may cost a way back and forth: within the limits, over in a moment, and the end is the same."""
    bench.config = bench.write_config("patient.ini", udp__silence_hold_ms=0)

    def play(frames):
        trace = bench.play(bench.file("frames.txt", "".join(f"{at} {text}\n" for at, text in frames)))
        run = subprocess.run([sys.argv[2], bench.config], input=trace, stdout=subprocess.PIPE, check=False)
        assert run.returncode == 0, run.stdout.decode()
        return harness.rows_of(trace)

    frames = [(15000 + 20 * i, wave(i * PERIOD_S)) for i in range(300)]
    straight = play(frames)
    for every, most_mm in ((20, 1), (5, 20)):
        off_mm = [abs(float(a["z_mm"]) - float(b["z_mm"])) for a, b in zip(straight, play(disturbed(frames, every)))]
        assert 0.01 < max(off_mm) <= most_mm, f"one of {every} overtaken: {max(off_mm):.3f} mm beside the stream in its order"
        assert max(off_mm[-200:]) < 1e-6, f"one of {every} overtaken: ends {off_mm[-1]} mm elsewhere"


NAMES = {
    "two senders at two addresses: one drives, the other after silence or by priority": two_senders,
    "spoofed addresses: outside allow nothing, as the driver no more than the driver": spoofed,
    "broadcast, multicast, fragments": odd_datagrams,
    "a group of [udp] group is heard, IPv4 and IPv6, and no other": joined_groups,
    "an address that changes, a link that goes down and up in the ride": moved_sender,
}
ON_PAPER = "reordered and duplicated frames: within the limits, and the end is the same"

def why_not():
    """Why there are no name spaces here, or None."""
    try:
        status, output = kernel.bounded([*kernel.own_name_space(), "sh", "-e", "-c", PROBE], harness.WAIT_S)
    except OSError as error:
        return str(error)
    return None if status == 0 else f"no network name spaces with veth and bridge here: {output.strip() or 'no answer'}"


def case_inside(arguments):
    """One case, in a name space of its own."""
    sh(SETUP)
    with Net(arguments.bin) as net:
        NAMES[arguments.inside](net)


def judge_child(child, reason):
    if reason is not None:
        raise tap.Skip(reason)
    output = child.communicate()[0]
    assert child.returncode == 0, output


def in_spaces(suite, names):
    """All at once: what they do is mostly to wait."""
    reason = why_not() if names else None
    command = [*kernel.own_name_space(), sys.executable, *sys.argv, "--inside"]
    children = {name: subprocess.Popen([*command, name], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) for name in names if reason is None}
    for name in names:
        with suite.case(name):
            judge_child(children.get(name), reason)


def main():
    if sys.argv[1:] == ["--agent"]:
        return agent_main()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin")
    parser.add_argument("judge")
    parser.add_argument("--only", default="", help="run the cases whose name contains this")
    parser.add_argument("--inside", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.inside:
        return case_inside(arguments)
    suite = tap.Suite()
    if arguments.only in ON_PAPER:
        with harness.Bench(arguments.bin) as bench, suite.case(ON_PAPER):
            reordered(bench)
    in_spaces(suite, [name for name in NAMES if arguments.only in name])
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
