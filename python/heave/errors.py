# SPDX-License-Identifier: MIT
"""errors.py - what goes wrong, each with a text for people. All are HeaveError."""
from __future__ import annotations

from typing import Any


class HeaveError(Exception):
    """Of everything in this package."""


class NotInstalled(HeaveError):
    """A program of Heave that is nowhere to be found."""


class NotRunning(HeaveError):
    """No heaved answers there, or it may not be asked; or the one that was started has ended."""


class Refused(HeaveError):
    """heaved has refused a request; the text is its own. answer: all that it said, with "why" where a program may care."""

    def __init__(self, request: str, text: str, state: str | None = None, answer: dict[str, Any] | None = None):
        super().__init__(text)
        self.request, self.state, self.answer = request, state, answer or {}


class PlatformFault(HeaveError):
    """The platform is in FAULT or ESTOP, where something else was waited for; status says all."""

    def __init__(self, text: str, status: dict[str, Any]):
        super().__init__(text)
        self.status = status


class WaitTimeout(HeaveError, TimeoutError):
    """What was waited for has not come; status is the last one."""

    def __init__(self, text: str, status: dict[str, Any] | None = None):
        super().__init__(text)
        self.status = status


class FrameError(HeaveError, ValueError):
    """A command with values that no platform takes."""


class PlayFailed(HeaveError):
    """heaved --play has ended with an error; the text is its own."""

    def __init__(self, text: str, exit_code: int):
        super().__init__(text)
        self.exit_code = exit_code
