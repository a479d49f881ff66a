# SPDX-License-Identifier: MIT
"""faults.py - what a plan can do to a simulated drive, by name."""


def refuse_sdo(drive, index, sub=0, code=0x08000000, times=-1):
    drive.refusals[int(index, 16), sub] = [code, times]


def set_flag(name, value):
    def act(drive):
        setattr(drive, name, value)
    return act


def freeze(drive, frozen=True):
    """The axis is stuck; the electronics go on."""
    drive.motor.is_frozen = frozen


def power(drive, on):
    if on and not drive.is_powered:
        drive.power_up(drive.now_us)
    elif not on:
        drive.power_down()


ACTIONS = {
    "fault": lambda drive, code=0x2310: drive.fault(code),
    "broken": lambda drive, code=0x2310: drive.fault(code, is_broken=True),
    "repaired": lambda drive: setattr(drive.machine, "is_broken", False),
    "emergency": lambda drive, code=0xFF00, register=0x81: drive.emergency(code, register),
    "reboot": lambda drive: drive.reboot(),
    "off": lambda drive: power(drive, False),
    "on": lambda drive: power(drive, True),
    "jam": freeze,
    "stuck": set_flag("is_frozen", True),            # answers, but no longer acts on anything
    "mute": set_flag("is_mute", True),               # hears everything, nothing comes out
    "unmute": set_flag("is_mute", False),
    "heartbeat off": set_flag("has_no_heartbeat", True),
    "heartbeat on": set_flag("has_no_heartbeat", False),
    "sdo off": set_flag("is_sdo_silent", True),
    "sdo on": set_flag("is_sdo_silent", False),
    "tpdo late": lambda drive, us: setattr(drive, "tpdo_late_us", us),
    "tpdo drop": lambda drive, count: setattr(drive, "tpdo_drop", count),
    "refuse sdo": refuse_sdo,
    "answer sdo": lambda drive: drive.unanswered.clear(),
    "take sdo": lambda drive, index, sub=0: drive.refusals.pop((int(index, 16), sub)),
    "status": lambda drive, set_bits=0, clear_bits=0: setattr(drive, "status_bits", (set_bits, clear_bits)),  # in 6041h, whatever it does
    "mode": lambda drive, mode: setattr(drive, "active_mode", mode),
    "nmt": lambda drive, state: drive.set_nmt(state),
    "disable": lambda drive: drive.machine.enter("switch on disabled") or drive.entered(),
}


def act(drive, name, arguments):
    drive.say("plan", name)
    ACTIONS[name](drive, **arguments)
