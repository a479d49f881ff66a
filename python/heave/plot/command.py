# SPDX-License-Identifier: MIT
"""command.py - draws traces: set-points, speed, acceleration and jerk against their limits, with states, flags and frames; limits used, spectra, frequency responses, animations.

usage: heave plot TRACE [TRACE2] [-o FILE] [--what KIND] [--axes NAME,...] [--from S] [--to S] [--config FILE] [--frames FRAMES]

TRACE    what heaved --trace wrote; or samples, as `heavectl scope > FILE` writes them, all or columns of one's choice; or the folder of an incident, whose platform.ini, frames and
         feedback.csv are taken then. Of samples and incidents, dashed lines are where the drives really were. Two are drawn side by side, with the same scales.
-o FILE  .png, .svg or .pdf, or .html for an animation (default: TRACE with .png or .html)
--what   curves; limits: how much of each limit was used; spectrum: acceleration over frequency; animation: the platform in motion, a page of its own for a browser.
         bode: gain and phase over frequency; TRACE is then a CSV file with columns frequency_hz, gain, phase_deg, and axis where it has several; two are drawn in one.
         Limits and animation need --config. Default: by the name of FILE
--axes   roll pitch yaw x y z angle c1 ... c6, or pose, cylinders, all (default: the cylinders in use, in a spectrum the pose)
--from, --to   in s since the start
--config what heaved ran with: limits as dashed lines, or in words where they are far from what happened
--frames what it played or recorded: dots where the frames asked to be (for cylinders, poses need --config), and operators' requests
--config and --frames may be given twice, for two traces; one counts for both.

Speed, acceleration and jerk are finite differences of the nine-decimal integers, so nothing is smoothed; the peaks of long traces are kept.
States colour the background, flags are bars below. Faults are red lines with number and name, of incidents and samples, and of the `!fault` of FRAMES. Needs matplotlib; an animation does not.

Exit status: 0 drawn, 1 could not be, 2 wrong option.
"""
from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from heave.configuration import Configuration
from heave.errors import HeaveError
from heave.faults import fault_text
from heave.plot import animation, bode
from heave.plot.dots import Dot, dots_of
from heave.plot.feedback import Feedback
from heave.plot.sampled import Sampled, is_sampled
from heave.plot.window import CYLINDERS, GROUPS, Window, axes_named
from heave.recording import Line, read_frames

Parts = tuple[Window, Configuration | None, list[Dot], list[tuple[int, str]], Feedback | None, list[tuple[int, str]]]
KINDS = ("curves", "limits", "spectrum", "bode", "animation")
PAGE = ".html"
SUFFIXES = (".png", ".svg", ".pdf")
FAULT = "!fault "
LATE = "!late "  # nobody asked for it: the bar of the flag `late` shows it
NO_MATPLOTLIB = "needs matplotlib: apt-get install python3-matplotlib, or in a virtual environment pip install matplotlib"


class PlotError(HeaveError):
    """Why nothing is drawn."""


def seconds(text: str) -> int:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < 1e9:
        raise argparse.ArgumentTypeError(f"{text!r}: seconds from 0 on")
    return round(value * 1e6)


def axes(text: str) -> list[str]:
    try:
        return axes_named(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def parse_arguments(arguments: Sequence[str] | None = None, program: str | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog=program or "tools/plot", description="Draws traces: set-points, speed, acceleration and jerk against their limits.",
                                     epilog="Speed, acceleration and jerk are finite differences of what the trace holds; peaks are kept.")
    parser.add_argument("trace", nargs="+", metavar="TRACE", help="one, or two side by side; or samples of heavectl scope; or folders of incidents")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help=f"{', '.join(SUFFIXES)}, or {PAGE} for an animation (default: TRACE with .png or {PAGE})")
    parser.add_argument("--what", choices=KINDS, help="curves (default), limits used, spectrum of the acceleration, bode of a measured frequency response, animation (by the name of FILE)")
    parser.add_argument("--axes", type=axes, metavar="NAME,...",
                        help="roll pitch yaw x y z angle c1 ... c6, pose, cylinders, all (default: the cylinders in use)")
    parser.add_argument("--from", type=seconds, dest="from_us", metavar="S", help="in s since the start")
    parser.add_argument("--to", type=seconds, dest="to_us", metavar="S")
    parser.add_argument("--config", action="append", default=[], metavar="FILE", help="limits of this configuration; twice for two traces")
    parser.add_argument("--frames", action="append", default=[], metavar="FRAMES", help="frames as dots; twice for two traces")
    result = parser.parse_args(arguments)
    for name, given in (("TRACE", result.trace), ("--config", result.config), ("--frames", result.frames)):
        if len(given) > 2:
            parser.error(f"at most two of {name}")
    if len(result.config) > len(result.trace) or len(result.frames) > len(result.trace):
        parser.error("--config and --frames: at most one for each trace")
    if result.from_us is not None and result.to_us is not None and result.to_us <= result.from_us:
        parser.error("--to must be later than --from")
    is_page = result.output is not None and result.output.suffix.lower() == PAGE
    result.what = result.what or ("animation" if is_page else "curves")
    wanted = (PAGE,) if result.what == "animation" else SUFFIXES
    first = Path(result.trace[0])
    result.output = result.output or (first / "trace.csv" if first.is_dir() else first).with_suffix(wanted[0])
    if result.output.suffix.lower() not in wanted:
        parser.error(f"{result.output}: one of {', '.join(wanted)} for {result.what}")
    given = [name for name, value in (("--axes", result.axes), ("--from", result.from_us), ("--to", result.to_us), ("--config", result.config), ("--frames", result.frames)) if value]
    if result.what == "bode" and given:
        parser.error(f"bode: {given[0]} is of a trace")
    if result.what in ("limits", "animation") and len(result.trace) > 1:
        parser.error(f"{result.what}: of one trace")
    return result


def of_trace(given: Sequence[str], i: int) -> str | None:
    """What was given for the i-th trace: its own, the only one, or nothing."""
    return given[min(i, len(given) - 1)] if given else None


def read(arguments: argparse.Namespace, i: int) -> Parts:
    """(window, configuration, dots, requests, feedback, faults) of the i-th trace."""
    feedback = None
    path = Path(arguments.trace[i])
    config: str | Path | None = of_trace(arguments.config, i)
    frames: str | Path | None = of_trace(arguments.frames, i)
    if path.is_dir():
        folder, path = path, path / "trace.csv"
        config = config or (folder / "platform.ini" if (folder / "platform.ini").exists() else None)
        frames = frames or (folder / "frames" if (folder / "frames").exists() else None)
        if (folder / "feedback.csv").exists():
            with open(folder / "feedback.csv", encoding="ascii", errors="replace", newline="") as file:
                feedback = Feedback(file, arguments.from_us, arguments.to_us, name=str(folder / "feedback.csv"))
    name = path.parent.name if Path(arguments.trace[i]).is_dir() else path.name
    with open(path, encoding="ascii", errors="replace", newline="\n") as file:
        first = file.readline()
        file.seek(0)
        samples = Sampled(file, name) if is_sampled(first) else None
        window = Window(samples.trace if samples else file, arguments.from_us, arguments.to_us, name=name)
    if samples and samples.feedback:
        feedback = Feedback(samples.feedback, arguments.from_us, arguments.to_us, name=name)
    platform = Configuration(config) if config else None
    if arguments.what in ("limits", "animation"):
        of_run(arguments, platform)
    lines = read_frames(frames) if frames else []
    requests = [(line.t_us, line.text) for line in lines if line.is_request and not line.text.startswith((LATE, FAULT))]
    return window, platform, dots_of(lines, platform), requests, feedback, feedback.faults if feedback else faults_of(lines)


def faults_of(lines: Sequence[Line]) -> list[tuple[int, str]]:
    """What heaved found by itself, where nothing else tells of faults."""
    return [(line.t_us, fault_text(*line.text.split()[1:3])) for line in lines if line.text.startswith(FAULT)]


def of_run(arguments: argparse.Namespace, platform: Configuration | None) -> Configuration:
    if platform is None:
        raise PlotError(f"{arguments.what}: needs the configuration of the run, --config FILE")
    return platform


def draw(arguments: argparse.Namespace) -> None:
    if arguments.what == "animation":
        window, platform, *_, faults = read(arguments, 0)
        arguments.output.write_text(animation.page(window, of_run(arguments, platform), faults), encoding="utf-8")
        return
    if arguments.what == "bode":
        responses = []
        for name in arguments.trace:
            with open(name, encoding="utf-8", errors="replace", newline="") as file:
                responses.append((Path(name).name, bode.read_response(file, name)))
        try:
            bode.draw_bode(responses, arguments.output)
        except ImportError as error:
            raise PlotError(f"{NO_MATPLOTLIB} ({error})") from error
        return
    parts = [read(arguments, i) for i in range(len(arguments.trace))]
    usual = GROUPS["pose"] if arguments.what == "spectrum" else CYLINDERS
    names = arguments.axes or [name for name in usual if any(part[0].is_used(name) for part in parts)] or usual
    try:
        from heave.plot import curves, shares  # after the arguments: their errors and --help need no matplotlib
    except ImportError as error:
        raise PlotError(f"{NO_MATPLOTLIB} ({error})") from error
    scenes = [curves.Scene(*part) for part in parts]
    if arguments.what == "limits":
        shares.draw_limits(scenes[0], of_run(arguments, scenes[0].platform), arguments.output)
    elif arguments.what == "spectrum":
        shares.draw_spectrum(scenes, names, arguments.output)
    else:
        curves.draw(scenes, names, arguments.output)


def main(words: Sequence[str] | None = None, program: str | None = None) -> int:
    arguments = parse_arguments(words, program)
    try:
        draw(arguments)
    except (HeaveError, OSError) as error:
        print(f"{program or 'plot'}: {error}", file=sys.stderr)
        return 1
    print(arguments.output)
    return 0
