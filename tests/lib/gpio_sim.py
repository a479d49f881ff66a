# SPDX-License-Identifier: MIT
"""gpio_sim.py - GPIO chips that the kernel simulates (gpio-sim), their lines seen and pulled from outside. Root, on a kernel of its own."""
from pathlib import Path

CONFIGFS = Path("/sys/kernel/config/gpio-sim")


def is_there():
    return CONFIGFS.is_dir()


class Chip:
    """A chip whose line n is called PREFIXn."""

    def __init__(self, label, lines, prefix):
        self.folder = CONFIGFS / label
        self.bank = self.folder / "bank"
        self.lines = lines
        self.is_live = False
        self.bank.mkdir(parents=True)
        (self.bank / "num_lines").write_text(str(lines), encoding="ascii")
        (self.bank / "label").write_text(label, encoding="ascii")
        for n in range(lines):
            (self.bank / f"line{n}").mkdir()
            (self.bank / f"line{n}/name").write_text(f"{prefix}{n}", encoding="ascii")
        self.plug()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.unplug()
        for n in range(self.lines):
            (self.bank / f"line{n}").rmdir()
        self.bank.rmdir()
        self.folder.rmdir()

    def plug(self):
        (self.folder / "live").write_text("1", encoding="ascii")
        self.is_live = True
        device, chip = ((folder / name).read_text(encoding="ascii").strip() for folder, name in ((self.folder, "dev_name"), (self.bank, "chip_name")))
        self.sysfs = Path("/sys/devices/platform") / device / chip

    def unplug(self):
        """Whoever uses it."""
        if self.is_live:
            (self.folder / "live").write_text("0", encoding="ascii")
        self.is_live = False

    def level(self, line):
        return int((self.sysfs / f"sim_gpio{line}/value").read_text(encoding="ascii"))

    def mask(self, first, count):
        """Levels of lines as a number, the first one in bit 0."""
        return sum(self.level(first + n) << n for n in range(count))

    def pull(self, line, is_up):
        (self.sysfs / f"sim_gpio{line}/pull").write_text("pull-up" if is_up else "pull-down", encoding="ascii")
