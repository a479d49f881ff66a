# SPDX-License-Identifier: MIT
"""Heave from Python: send frames, ask and command a platform, start one of one's own, run it offline, judge what it did.

    from heave import Heaved
    with Heaved() as heaved:                    # the demonstration platform, simulated
        heaved.platform.wait_for("ENGAGED")
        heaved.sender.a6(z=20, time_ms=2000)
        heaved.platform.wait_for_pose(z_mm=20)
"""
from heave import judge, programs, recording
from heave.daemon import Heaved
from heave.errors import FrameError, HeaveError, NotInstalled, NotRunning, PlatformFault, PlayFailed, Refused, WaitTimeout
from heave.frames import COMMANDS, frame
from heave.offline import Run, play
from heave.platform import Platform
from heave.programs import demo_config
from heave.samples import Samples, SamplesError
from heave.sender import Sender, Sent
from heave.twin import Twin

__version__ = "0.1.0"
__all__ = ["COMMANDS", "FrameError", "HeaveError", "Heaved", "NotInstalled", "NotRunning", "Platform", "PlatformFault", "PlayFailed", "Refused", "Run", "Samples", "SamplesError",
           "Sender", "Sent", "Twin", "WaitTimeout", "demo_config", "frame", "judge", "play", "programs", "recording"]
