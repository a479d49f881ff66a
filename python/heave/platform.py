# SPDX-License-Identifier: MIT
"""platform.py - a running heaved over its control socket: status, requests, waiting. What status holds: docs/status-json.md."""
from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from heave.errors import HeaveError, NotRunning, PlatformFault, Refused, WaitTimeout
from heave.samples import Samples

RUN = Path("/run/heave")
LOOK_S = 0.05       # between two looks at the status
AGAIN_S = 0.1       # between two requests for drives that are not ready
DUMP_S = 60.0       # a slow disk
LAST_RESORTS = {"FAULT", "ESTOP"}
Status = dict[str, Any]


def find_socket(name: str | None = None) -> Path:
    """Where heavectl would look: that of the service heave@NAME; else $HEAVE_SOCKET, the one of /run/heave, the only service."""
    if name is not None:
        return RUN / name / "heaved.sock"
    if os.environ.get("HEAVE_SOCKET"):
        return Path(os.environ["HEAVE_SOCKET"])
    services = sorted(RUN.glob("*/heaved.sock"))
    if not (RUN / "heaved.sock").exists() and len(services) > 1:
        raise NotRunning(f"there are several platforms: {', '.join(path.parent.name for path in services)}; say which one, as in Platform(name={services[0].parent.name!r})")
    return services[0] if services and not (RUN / "heaved.sock").exists() else RUN / "heaved.sock"


class Platform:
    """Each request is a connection of its own: it takes nobody's place for long, and outlives a restart of heaved."""

    def __init__(self, socket_path: str | os.PathLike[str] | None = None, *, name: str | None = None, by: str | None = None, timeout: float = 5.0):
        """name: the service heave@NAME. by: who asks, for the operator log. timeout: of one answer, in s."""
        self.socket = Path(socket_path) if socket_path is not None else find_socket(name)
        self.by, self.timeout = by, timeout

    # ---- asking ----
    def _connect(self, timeout: float) -> socket.socket:
        link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        link.settimeout(timeout)
        try:
            link.connect(str(self.socket))
        except OSError as error:
            link.close()
            raise NotRunning(f"heaved cannot be asked at {self.socket}: {error.strerror or error}") from error
        return link

    def _answers(self, link: socket.socket, *requests: str) -> Iterator[dict[str, Any]]:
        try:
            link.sendall("".join(f"{request}\n" for request in requests).encode())
            for line in link.makefile("rb"):
                yield json.loads(line)
        except TimeoutError as error:
            raise NotRunning(f"heaved does not answer at {self.socket}") from error
        except (OSError, ValueError) as error:
            raise NotRunning(f"heaved at {self.socket} has gone: {error}") from error
        raise NotRunning(f"heaved at {self.socket} has closed the connection")

    def request(self, text: str) -> dict[str, Any]:
        """Any line that heaved takes, and its answer. Refused: the error has heaved's own words."""
        if "\n" in text or "\0" in text:
            raise HeaveError(f"{text!r}: a request is one line")
        with self._connect(DUMP_S if text == "dump" else self.timeout) as link:
            answers = self._answers(link, *([f"by {self.by}"] if self.by else []), text)
            if self.by:
                self._checked(next(answers), f"by {self.by}")
            return self._checked(next(answers), text)

    @staticmethod
    def _checked(answer: dict[str, Any], request: str) -> dict[str, Any]:
        if not answer.get("ok"):
            raise Refused(request, str(answer.get("error", "refused without a reason")), answer.get("state"), answer)
        return answer

    def status(self) -> Status:
        return self.request("status")

    def samples(self) -> Samples:
        """Every cycle, out of shared memory; needs numpy."""
        return Samples(self.socket, timeout=self.timeout)

    @property
    def state(self) -> str:
        return str(self.status()["state"])

    def _bring_up(self, request: str) -> dict[str, Any]:
        """Drives that are not there yet may be soon: they start, or are being set up. Who asks again says what it has heard, so that a hold in between ends it."""
        end, text = time.monotonic() + self.timeout, request
        while True:
            try:
                return self.request(text)
            except Refused as refused:
                if refused.answer.get("why") != "not-ready" or time.monotonic() >= end:
                    raise
                text = f"heard {refused.answer['tick']} {request}"
            time.sleep(AGAIN_S)

    def engage(self) -> dict[str, Any]:
        """Waits for drives that are being set up, for timeout."""
        return self._bring_up("engage")

    def hold(self) -> dict[str, Any]:
        return self.request("hold")

    def resume(self) -> dict[str, Any]:
        return self.request("resume")

    def park(self) -> dict[str, Any]:
        """As engage(), where the platform is in OFF."""
        return self._bring_up("park")

    def reset(self) -> dict[str, Any]:
        return self.request("reset")

    def shutdown(self) -> dict[str, Any]:
        return self.request("shutdown")

    def commissioned(self) -> dict[str, Any]:
        """Says that the platform was seen to rise as it should: from now on it does so at engage speed."""
        return self.request("commissioned")

    def acknowledge(self) -> dict[str, Any]:
        return self.request("acknowledge")

    def intensity(self, percent: int) -> dict[str, Any]:
        return self.request(f"intensity {percent}")

    def dump(self) -> Path:
        """The last minutes, as after a fault: the folder they are in. Takes as long as the disk."""
        return Path(self.request("dump")["folder"])

    def incidents(self) -> list[dict[str, Any]]:
        return list(self.request("incidents")["incidents"])

    def seen(self) -> list[dict[str, Any]]:
        """The incidents, and all of them have been seen."""
        return list(self.request("seen")["incidents"])

    def watch(self, hz: int = 20) -> Iterator[Status]:
        """The status again and again, until the caller stops. It may have to give way to a newer client, which is Refused."""
        with self._connect(self.timeout) as link:
            for answer in self._answers(link, f"watch {hz}"):
                yield self._checked(answer, "watch")

    # ---- waiting ----
    def wait_until(self, condition: Callable[[Status], Any], timeout: float = 20.0, what: str = "what was waited for", *, allow_fault: bool = False) -> Status:
        """The first status of which condition holds. A FAULT or ESTOP ends the waiting at once, but with allow_fault."""
        end = time.monotonic() + timeout
        while True:
            status = self.status()
            if condition(status):
                return status
            if status["state"] in LAST_RESORTS and not allow_fault:
                raise PlatformFault(f"{what}: {_story(status)}", status)
            if time.monotonic() >= end:
                raise WaitTimeout(f"{what}: not within {timeout:g} s; {_story(status)}", status)
            time.sleep(min(LOOK_S, max(0.0, end - time.monotonic())))

    def wait_for(self, *states: str, timeout: float = 20.0) -> Status:
        """Until the platform is in one of these states: `wait_for("ENGAGED", timeout=20)`."""
        if not states:
            raise HeaveError("wait_for: a state is needed, as in wait_for('ENGAGED')")
        return self.wait_until(lambda status: status["state"] in states, timeout, " or ".join(states), allow_fault=bool(LAST_RESORTS & set(states)))

    def wait_for_pose(self, *, timeout: float = 20.0, tolerance: float = 0.1, actual: bool = False, **axes: float) -> Status:
        """Until the set-points (actual: the feedback) are there: `wait_for_pose(z_mm=20, roll_deg=0)`; axes that are not named may be anywhere."""
        member = "pose_actual" if actual else "pose_sent"

        def is_there(status: Status) -> bool:
            pose = status[member]
            for axis in axes if pose is not None else ():
                if axis not in pose:
                    raise HeaveError(f"{axis!r} is no axis of {member}: {', '.join(pose)}")
            return pose is not None and all(abs(pose[axis] - wanted) <= tolerance for axis, wanted in axes.items())

        return self.wait_until(is_there, timeout, f"{member} at {', '.join(f'{axis} {wanted:g}' for axis, wanted in axes.items())}")


def _story(status: Status) -> str:
    """Where the platform is, and what keeps it."""
    parts = [f"it is in {status['state']}"]
    fault = status.get("fault") or {}
    if status["state"] == "ESTOP" or status.get("estop_active"):
        parts.append("the e-stop is pressed" if status.get("estop_active") else "the e-stop was pressed")
    if fault.get("code"):
        axis = f" of axis {fault['axis']}" if fault.get("axis") else ""
        parts.append(f"fault {fault['name']}{axis}: {fault.get('text', '')}. {fault.get('remedy', '')}".strip())
    if (status.get("goal") or status["state"]) != status["state"]:
        parts.append(f"on its way to {status['goal']}")
    if status["state"] in ("OFF", "HOMING"):
        drives = [f"drive {each['number']} is {each['drive']}" for each in status.get("cylinders", []) if each.get("drive") not in ("enabled",)]
        parts += drives[:3]
    if (status.get("bus") or {}).get("trouble"):
        parts.append(f"bus: {status['bus']['trouble']}")
    return "; ".join(parts)
