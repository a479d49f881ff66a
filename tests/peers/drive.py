# SPDX-License-Identifier: MIT
"""drive.py - one simulated CiA 402 drive on CANopen: NMT, heartbeats, SDO server, PDOs, EMCY, states, modes, and what goes wrong with it.

The SDO protocol is the package canopen's; everything else is written from the standards' rules, strict where real drives are: an object that
several stacks refuse is refused. Times are microseconds of whoever calls.
"""
import canopen
from canopen.sdo import SdoServer
from canopen.sdo.exceptions import SdoAbortedError

import machine
import objects
from motor import Motor

PRE_OPERATIONAL, OPERATIONAL, STOPPED = 0x7F, 0x05, 0x04
PP, HOMING, IP, CSP = 1, 6, 7, 8
MODES = (0, PP, HOMING, IP, CSP)
FOLLOWING_ERROR, HEARTBEAT_LOST, SYNC_LATE, PDO_SHORT, SYNC_LENGTH, SET_POINT_MISSING = 0x8611, 0x8130, 0x8100, 0x8210, 0x8240, 0x8250
WRONG_PERIOD = 0xFF10

DEFAULTS = {
    "node": 1,
    "identity": [0x2E5, 0x402, 0x10000, 1],
    "position": 0,               # counts at power-up
    "lag_us": 2000,              # time constant of the axis behind the demand
    "boot_us": 300000,           # power-up, and reset node
    "reset_us": 50000,           # reset communication
    "sdo_us": 1000,              # answers that late
    "tpdo_us": 150,              # after SYNC
    "delays_us": {"quick": 2000, "power": 50000, "brake": 100000},
    "mode_us": 3000,             # until 6061h follows 6060h
    "jump_counts": 20000,        # a set-point further away than this is a following error at once
    "missed_set_points": 3,      # so many SYNCs without one are a fault
    "home_counts": 0,            # where it finds its zero, counted from power-up
    "is_homed": True,
    "is_there": True,            # false: no power at the start
    "missing_objects": [],       # indexes
    "defaults": {},              # "6007": 1, "60C2:2": -4
    "read_only": [],             # "605A"
    "no_answer": [],             # "6065:0": nothing comes back
    "refuse": {},                # "1016:1": abort code, for good
    "periods_ms": [1, 20],       # what 60C2h takes
}


def where_of(text):
    index, _, sub = text.partition(":")
    return int(index, 16), int(sub or "0", 16)


class Drive:
    def __init__(self, config, wire, log, now_us):
        unknown = set(config) - set(DEFAULTS)
        assert not unknown, f"unknown keys {unknown}"
        self.config = {**DEFAULTS, **config}
        self.config["delays_us"] = {**DEFAULTS["delays_us"], **self.config["delays_us"]}
        self.node, self.wire, self.log = self.config["node"], wire, log
        self.object_dictionary = canopen.ObjectDictionary()
        self.timers = {}                # name -> (due_us, call)
        self.now_us = now_us
        self.refusals = {where_of(where): [code, -1] for where, code in self.config["refuse"].items()}
        self.unanswered = {where_of(where) for where in self.config["no_answer"]}
        self.is_powered = False
        self.is_frozen = self.is_mute = self.has_no_heartbeat = self.is_sdo_silent = False
        self.tpdo_drop = self.tpdo_late_us = 0
        self.status_bits = 0, 0
        self.position_at_rest = self.config["position"]
        self.stats = {"largest_step": 0, "largest_lag": 0, "syncs": 0, "set_points": 0, "missed": 0}
        self.last_target = None
        if self.config["is_there"]:
            self.power_up(now_us)

    # --- Life ---

    def say(self, event, value=None):
        self.log(self.now_us, self.node, event, value)

    def after(self, name, delay_us, call):
        self.timers[name] = (self.now_us + delay_us, call)

    def next_due_us(self):
        dues = [due for due, _ in self.timers.values()]
        if self.is_powered and self.machine.due_us is not None:
            dues.append(self.machine.due_us)
        return min(dues, default=None)

    def advance(self, now_us):
        self.now_us = now_us
        for name in [name for name, (due, _) in self.timers.items() if due <= now_us]:
            self.timers.pop(name, (0, lambda: None))[1]()
        if not self.is_powered:
            return
        self.motor.advance(now_us)
        if not self.is_frozen and self.machine.advance(now_us):
            self.entered()
        self.watch()

    def power_up(self, now_us, position=None):
        self.now_us = now_us
        self.is_powered, self.nmt = True, None
        start = self.position_at_rest if position is None else position
        self.od = objects.Dictionary(self.node, self.config["identity"], start)
        for where, value in self.config["defaults"].items():
            self.od.entries[where_of(where)].value = self.od.entries[where_of(where)].default = value
        for where in self.config["read_only"]:
            self.od.entries[where_of(where)].access = "ro"
        for index in self.config["missing_objects"]:
            self.od.remove(int(index, 16))
        self.motor = Motor(start, self.config["lag_us"])
        self.motor.now_us = now_us
        self.is_homed = self.config["is_homed"]
        self.origin = 0                 # what the motor's count is at the drive's zero
        self.machine = machine.Machine(self.config["delays_us"], self.say)
        self.machine.due_us += now_us
        self.say("power")
        self.boot(self.config["boot_us"])

    def power_down(self):
        if self.is_powered:
            self.say("no power")
            self.position_at_rest = round(self.motor.actual)
        self.is_powered, self.nmt = False, None
        self.timers.clear()

    def boot(self, delay_us):
        """Deaf until the boot-up message."""
        self.nmt = None
        for name in list(self.timers):
            if not name.startswith("plan"):
                del self.timers[name]
        self.sdo = SdoServer(0x600 + self.node, 0x580 + self.node, self)
        self.sdo.network = self  # that it sends by send_message
        self.received = {}              # of synchronous RPDOs, until the next SYNC
        self.last_sync_us = self.sync_period_us = None
        self.sync_count = {}            # of TPDOs with a rate
        self.has_set_point = self.heard_master = False
        self.silent_syncs = 0
        self.event_values = {}
        self.active_mode = 0
        self.ip_active = self.pp_ack = False
        self.homing = None
        self.lag_since_us = None
        self.errors = 0
        self.after("boot", delay_us, self.booted)

    def booted(self):
        self.send(0x700 + self.node, [0])
        self.set_nmt(PRE_OPERATIONAL)
        self.beat()

    def set_nmt(self, state):
        was, self.nmt = self.nmt, state
        self.od.is_operational = state == OPERATIONAL
        if state != was:
            self.say("nmt", state)
        if was == OPERATIONAL and state != OPERATIONAL:
            self.connection_lost("left operational")
        self.send_events(force=state == OPERATIONAL and was != OPERATIONAL)

    # --- The bus ---

    def send(self, cob_id, data):
        if self.is_mute:
            return
        try:
            self.wire.send(cob_id, bytes(data))
        except OSError as error:
            self.say("not sent", str(error))

    def send_message(self, cob_id, data):
        """What the SDO server calls."""
        answer = bytes(data)
        self.after(f"sdo {len(self.timers)} {self.now_us}", self.config["sdo_us"], lambda: self.send(cob_id, answer))

    def hear(self, cob_id, data, is_remote):
        if not self.is_powered or self.nmt is None or is_remote:
            return
        if cob_id == 0:
            self.hear_nmt(data)
        elif cob_id == self.od[0x1005] & 0x7FF:
            self.hear_sync(data)
        elif cob_id == 0x600 + self.node:
            self.hear_sdo(data)
        elif cob_id & 0x780 == 0x700:
            self.hear_heartbeat(cob_id & 0x7F)
        elif self.nmt == OPERATIONAL:
            self.hear_pdo(cob_id, data)

    def hear_nmt(self, data):
        if len(data) != 2 or data[1] not in (0, self.node):
            return
        command = data[0]
        if command == 0x01 and self.may_start():
            self.set_nmt(OPERATIONAL)
        elif command == 0x02:
            self.set_nmt(STOPPED)
        elif command == 0x80:
            self.set_nmt(PRE_OPERATIONAL)
        elif command in (0x81, 0x82):
            self.reset(command == 0x81)

    def may_start(self):
        """With SYNC supervised, only while SYNC is there."""
        period_us = self.od[0x1006]
        is_fine = not period_us or (self.last_sync_us is not None and self.now_us - self.last_sync_us <= 1.5 * period_us)
        if not is_fine:
            self.say("start refused", "no SYNC")
        return is_fine

    def reset(self, is_node):
        self.say("reset node" if is_node else "reset communication")
        if self.nmt == OPERATIONAL:
            self.connection_lost("reset")
        if is_node:
            self.position_at_rest = round(self.motor.actual)
            self.power_up(self.now_us)
        else:
            self.od.restore(0x1000, 0x1FFF)
            self.od.is_operational = False
            self.boot(self.config["reset_us"])

    def reboot(self):
        """By itself, as after a dip of the supply."""
        self.power_down()
        self.power_up(self.now_us)

    # --- Heartbeats ---

    def beat(self):
        period_ms = self.od[0x1017]
        if period_ms:
            self.after("beat", period_ms * 1000, self.beat_now)
        else:
            self.timers.pop("beat", None)

    def beat_now(self):
        if not self.has_no_heartbeat:
            self.send(0x700 + self.node, [self.nmt])
        self.beat()

    def hear_heartbeat(self, producer):
        for sub in (1, 2):
            if (0x1016, sub) in self.od.entries and self.od[0x1016, sub] >> 16 & 0x7F == producer and self.od[0x1016, sub] & 0xFFFF:
                self.after("master", (self.od[0x1016, sub] & 0xFFFF) * 1000, self.master_lost)
                self.heard_master = True

    def master_lost(self):
        self.say("master lost")
        self.emergency(HEARTBEAT_LOST, 0x10)
        if self.nmt == OPERATIONAL:
            self.connection_lost("heartbeat")
            reaction = self.od[0x1029, 1]
            if reaction in (0, 2):
                self.set_nmt(PRE_OPERATIONAL if reaction == 0 else STOPPED)

    def connection_lost(self, why):
        """6007h, where the drive has torque."""
        if self.machine.state != machine.ENABLED:
            return
        action = self.od[0x6007]
        self.say("connection lost", f"{why}: 6007h {action}")
        if action == 1:
            self.fault(HEARTBEAT_LOST, 0x10)
        elif action == 2:
            self.machine.enter(machine.DISABLED)
            self.entered()
        elif action == 3:
            self.machine.enter(machine.QUICK_STOP)
            self.quick_stop()

    # --- SDO ---

    def hear_sdo(self, data):
        if self.nmt == STOPPED or len(data) != 8 or self.is_sdo_silent:
            return
        if (data[1] | data[2] << 8, data[3]) in self.unanswered:
            return
        self.sdo.on_request(0x600 + self.node, bytearray(data), self.now_us / 1e6)

    def refuse(self, where):
        refusal = self.refusals.get(where)
        if refusal and refusal[1] != 0:
            refusal[1] -= 1
            raise SdoAbortedError(refusal[0])

    def get_data(self, index, subindex, check_readable=False):
        self.refuse((index, subindex))
        self.motor.advance(self.now_us)
        self.refresh()
        return self.od.read(index, subindex)

    def set_data(self, index, subindex, data, check_writable=False):
        self.refuse((index, subindex))
        before = self.od.entries.get((index, subindex))
        before = before and before.value
        value = self.od.write(index, subindex, data)
        try:
            self.written(index, subindex, value)
        except SdoAbortedError:
            self.od[index, subindex] = before
            raise

    def written(self, index, sub, value):
        self.say("write", f"{index:04X}:{sub} = {value}")
        if index == 0x1017:
            self.beat()
        elif index == 0x1016:
            self.timers.pop("master", None)
        elif index == 0x1019 and self.od[0x1006]:
            raise SdoAbortedError(objects.WRONG_STATE)
        elif index == 0x6040:
            self.control(value)
        elif index == 0x6060:
            self.choose_mode(value)
        elif index == 0x60C2:
            low, high = self.config["periods_ms"]
            if (sub == 1 and not low <= value <= high) or (sub == 2 and value != -3):
                raise SdoAbortedError(objects.BAD_VALUE)

    # --- PDO ---

    def hear_pdo(self, cob_id, data):
        for number in range(objects.PDOS):
            record = 0x1400 + number
            if self.od.is_valid(record) and self.od[record, 1] & 0x7FF == cob_id:
                self.hear_rpdo(record, data)

    def hear_rpdo(self, record, data):
        size = sum(size for _, size in self.od.mapped(record + 0x200))
        if len(data) < size:
            self.emergency(PDO_SHORT, 0x10)
        elif self.od[record, 2] <= 240:
            if record in self.received:
                self.say("set-point overwritten", record)
            self.received[record] = bytes(data)
        else:
            self.apply(self.od.unpack(record + 0x200, data))

    def apply(self, values):
        for where, value in values.items():
            self.od[where] = value
        self.has_set_point |= (0x607A, 0) in values or (0x60C1, 1) in values
        if (0x6060, 0) in values and values[0x6060, 0] != self.active_mode:
            self.choose_mode(values[0x6060, 0])
        if (0x6040, 0) in values:
            self.control(values[0x6040, 0])

    def hear_sync(self, data):
        if len(data) != (1 if 2 <= self.od[0x1019] <= 240 else 0):
            self.emergency(SYNC_LENGTH, 0x10)
            return
        if self.nmt == STOPPED:
            return
        self.note_sync()
        self.motor.advance(self.now_us)
        self.refresh()
        if self.nmt == OPERATIONAL:
            self.stats["syncs"] += 1
            self.send_synchronous()
            received, self.received = self.received, {}
            self.has_set_point = False
            for record, data in received.items():
                self.apply(self.od.unpack(record + 0x200, data))
            self.follow()

    def note_sync(self):
        self.sync_period_us = None if self.last_sync_us is None else self.now_us - self.last_sync_us
        self.last_sync_us = self.now_us
        if self.od[0x1006]:
            self.after("sync", int(1.5 * self.od[0x1006]), self.sync_late)

    def sync_late(self):
        if self.nmt == OPERATIONAL:
            self.emergency(SYNC_LATE, 0x10)
            self.set_nmt(PRE_OPERATIONAL)

    def send_synchronous(self):
        for number in range(objects.PDOS):
            record = 0x1800 + number
            rate = self.od[record, 2]
            if not self.od.is_valid(record) or rate > 240:
                continue
            self.sync_count[record] = self.sync_count.get(record, 0) + 1
            data = self.od.pack(record + 0x200)
            is_due = self.sync_count[record] >= rate if rate else data != self.event_values.get(record)
            if is_due:
                self.sync_count[record] = 0
                self.event_values[record] = data
                self.send_tpdo(record, data)

    def send_tpdo(self, record, data):
        if self.tpdo_drop:
            self.tpdo_drop -= 1
            return
        cob_id = self.od[record, 1] & 0x7FF
        self.after(f"tpdo {record}", self.config["tpdo_us"] + self.tpdo_late_us, lambda: self.send(cob_id, data))

    def send_events(self, force=False):
        """Event-driven TPDOs: whenever what they carry changes."""
        if self.nmt != OPERATIONAL:
            return
        for number in range(objects.PDOS):
            record = 0x1800 + number
            if self.od.is_valid(record) and self.od[record, 2] >= 254 and f"inhibit {record}" not in self.timers:
                data = self.od.pack(record + 0x200)
                if force or data != self.event_values.get(record):
                    self.event_values[record] = data
                    self.send(self.od[record, 1] & 0x7FF, data)
                    if self.od[record, 3]:
                        self.after(f"inhibit {record}", self.od[record, 3] * 100, self.send_events)

    # --- Emergencies and faults ---

    def emergency(self, code, register):
        self.say("emergency", code)
        self.od[0x1001] = register
        self.od[0x603F] = code
        self.od[0x1003] = 1
        self.od[0x1003, 1] = code
        if self.nmt != STOPPED:
            self.send(0x080 + self.node, code.to_bytes(2, "little") + bytes([register, 0, 0, 0, 0, 0]))

    def fault(self, code, register=0x21, is_broken=False):
        """Stops by itself: the reaction of 605Eh, then FAULT."""
        self.machine.is_broken |= is_broken
        if self.machine.state in (machine.REACTION, machine.FAULT):
            return
        had_torque = self.machine.state in (machine.ENABLED, machine.QUICK_STOP)
        self.emergency(code, register)
        self.machine.enter(machine.REACTION)
        if had_torque and self.od[0x605E] in (1, 2):
            self.motor.stop(self.od[0x6085])
            self.after("stopped", self.stop_time_us(), lambda: self.stopped(machine.FAULT))
        else:
            self.stopped(machine.FAULT)

    def stop_time_us(self):
        return int(abs(self.motor.speed) / self.motor.brake) + 1 if self.motor.brake else 0

    def stopped(self, state):
        self.motor.advance(self.now_us)
        self.motor.hold()
        self.machine.enter(state)
        self.entered()

    # --- Controlword, states, modes ---

    def control(self, word):
        if self.is_frozen:
            return
        was_fault = self.machine.state == machine.FAULT
        if self.machine.control(word, self.now_us):
            self.quick_stop()
        if was_fault and self.machine.state == machine.DISABLED:
            self.od[0x1001] = 0
            self.send(0x080 + self.node, bytes(8))
        if self.machine.state == machine.ENABLED:
            self.operate(word)

    def quick_stop(self):
        """605Ah 0: coast; 1, 2: ramp, then no torque; 5, 6: ramp, and it stays."""
        option = self.od[0x605A]
        if option == 0:
            self.stopped(machine.DISABLED)
            return
        self.motor.stop(self.od[0x6085])
        self.after("stopped", self.stop_time_us(), lambda: self.stopped(machine.QUICK_STOP if option >= 5 else machine.DISABLED))

    def entered(self):
        """A state was entered."""
        if self.machine.state == machine.ENABLED:
            self.motor.hold()
            self.last_target = None
            self.silent_syncs = 0
            self.say("enabled", {"actual": self.count(), "target": self.target()})
        else:
            self.ip_active = self.pp_ack = False
            self.homing = None
            if self.machine.state not in machine.POWERED:
                self.motor.hold()
        self.refresh()
        self.send_events()

    def choose_mode(self, mode):
        if mode not in MODES:
            raise SdoAbortedError(objects.BAD_VALUE)
        if self.machine.state == machine.ENABLED and mode != self.active_mode:
            raise SdoAbortedError(objects.WRONG_STATE)
        self.after("mode", self.config["mode_us"], lambda: self.set_mode(mode))

    def set_mode(self, mode):
        self.active_mode = mode
        self.say("mode", mode)
        self.refresh()

    def count(self):
        return round(self.motor.actual) - self.origin

    def target(self):
        entry = self.od.entries.get((0x60C1, 1) if self.active_mode == IP else (0x607A, 0))
        return entry.value if entry else 0

    def operate(self, word):
        """Bit 4 means something else in every mode."""
        start = bool(word & 0x10)
        if self.active_mode == IP:
            self.ip_active = start
        elif self.active_mode == PP and start and not self.pp_ack:
            self.motor.travel(self.od[0x607A] + self.origin, self.od[0x6081])
        elif self.active_mode == HOMING and start and self.homing is None:
            self.homing = "running"
            self.is_homed = False
            self.motor.travel(self.config["home_counts"], self.od[0x6099, 1])
            self.say("homing")
        elif self.active_mode == HOMING and not start:
            self.homing = None
        self.pp_ack = start

    def follow(self):
        """The set-point of a cyclic mode, at SYNC."""
        if self.machine.state != machine.ENABLED or self.is_frozen or self.active_mode not in (IP, CSP) or (self.active_mode == IP and not self.ip_active):
            return
        if not self.has_set_point:
            self.miss()
            return
        self.silent_syncs = 0
        self.stats["set_points"] += 1
        target = self.target()
        before = self.last_target if self.last_target is not None else self.count()
        self.stats["largest_step"] = max(self.stats["largest_step"], abs(target - before))
        self.last_target = target
        if abs(target + self.origin - self.motor.actual) > self.config["jump_counts"]:
            self.say("jump", {"from": self.count(), "to": target})
            self.fault(FOLLOWING_ERROR)
            return
        period_us = self.od[0x60C2, 1] * 1000
        if self.active_mode == CSP and self.sync_period_us and not 0.5 * period_us < self.sync_period_us < 1.5 * period_us:
            self.say("period", {"sync_us": self.sync_period_us, "60C2h_us": period_us})
            self.fault(WRONG_PERIOD)
            return
        self.motor.aim(target + self.origin, period_us)

    def miss(self):
        self.stats["missed"] += 1
        self.silent_syncs += 1
        if self.config["missed_set_points"] and self.silent_syncs >= self.config["missed_set_points"]:
            self.fault(SET_POINT_MISSING, 0x11)

    def watch(self):
        """What a drive looks after by itself: its lag, the end of homing."""
        lag = abs(self.motor.demand - self.motor.actual)
        self.stats["largest_lag"] = max(self.stats["largest_lag"], round(lag))
        if self.machine.state == machine.ENABLED and lag > self.od[0x6065]:
            self.lag_since_us = self.now_us if self.lag_since_us is None else self.lag_since_us
            if self.now_us - self.lag_since_us >= self.od[0x6066] * 1000:
                self.fault(FOLLOWING_ERROR)
        else:
            self.lag_since_us = None
        if self.homing == "running" and self.motor.is_there() and lag < 0.5:
            self.homing = "done"
            self.is_homed = True
            self.origin = round(self.motor.actual) - self.od[0x607C]
            self.say("homed")
        self.refresh()
        self.send_events()

    def is_busy(self):
        """Moves by itself, so that it has to be looked at now and then."""
        return self.is_powered and self.machine.state in machine.POWERED

    def mode_bits(self):
        if self.machine.state != machine.ENABLED:
            return 0
        if self.active_mode == CSP:
            return 0x1000
        if self.active_mode == IP:
            return 0x1000 if self.ip_active else 0
        if self.active_mode == PP:
            return (0x1000 if self.pp_ack else 0) | (0x0400 if self.motor.is_there() else 0)
        if self.active_mode == HOMING:
            return {"running": 0, "done": 0x1400, None: 0x0400}[self.homing]
        return 0

    def refresh(self):
        """The objects that show what is."""
        powered = 0x10 if self.machine.state in machine.POWERED else 0
        set_bits, clear_bits = self.status_bits
        self.od[0x6041] = (machine.WORDS[self.machine.state] | powered | 0x0200 | self.mode_bits() | set_bits) & ~clear_bits
        self.od[0x6061] = self.active_mode
        self.od[0x6064] = self.count()
        self.od[0x6062] = round(self.motor.demand) - self.origin
        self.od[0x606C] = round(self.motor.speed * 1e6)
        self.od[0x60F4] = round(self.motor.demand - self.motor.actual)
