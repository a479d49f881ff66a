# SPDX-License-Identifier: MIT
"""command.py - draws traces: set-points, speed, acceleration and jerk against their limits, with states, flags and frames; limits used, spectra, frequency responses, animations.

usage: heave plot TRACE [TRACE2] [-o FILE] [--what KIND] [--axes NAME,...] [--from S] [--to S] [--config FILE] [--frames FRAMES]

TRACE    what heaved --trace wrote, or the folder of an incident, whose platform.ini, frames and feedback.csv (where the drives really were: dashed) are taken then. Two are drawn side by side, with the same scales.
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
States colour the background, flags are bars below. Needs matplotlib; an animation does not.

Exit status: 0 drawn, 1 could not be, 2 wrong option.
"""
import argparse
import sys
from pathlib import Path

from heave.configuration import Configuration
from heave.errors import HeaveError
from heave.plot import animation, bode
from heave.plot.dots import dots_of
from heave.plot.feedback import Feedback
from heave.plot.window import CYLINDERS, GROUPS, Window, axes_named
from heave.recording import read_frames

KINDS = ("curves", "limits", "spectrum", "bode", "animation")
PAGE = ".html"
SUFFIXES = (".png", ".svg", ".pdf")
NO_MATPLOTLIB = "needs matplotlib: apt-get install python3-matplotlib, or in a virtual environment pip install matplotlib"


class PlotError(HeaveError):
    """Why nothing is drawn."""


def seconds(text):
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < 1e9:
        raise argparse.ArgumentTypeError(f"{text!r}: seconds from 0 on")
    return round(value * 1e6)


def axes(text):
    try:
        return axes_named(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def parse_arguments(arguments=None, program=None):
    parser = argparse.ArgumentParser(prog=program or "tools/plot", description="Draws traces: set-points, speed, acceleration and jerk against their limits.",
                                     epilog="Speed, acceleration and jerk are finite differences of what the trace holds; peaks are kept.")
    parser.add_argument("trace", nargs="+", metavar="TRACE", help="one, or two side by side; or folders of incidents")
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


def of_trace(given, i):
    """What was given for the i-th trace: its own, the only one, or nothing."""
    return given[min(i, len(given) - 1)] if given else None


def read(arguments, i):
    """(window, configuration, dots, requests, feedback) of the i-th trace."""
    feedback = None
    path = Path(arguments.trace[i])
    config, frames = of_trace(arguments.config, i), of_trace(arguments.frames, i)
    if path.is_dir():
        folder, path = path, path / "trace.csv"
        config = config or (folder / "platform.ini" if (folder / "platform.ini").exists() else None)
        frames = frames or (folder / "frames" if (folder / "frames").exists() else None)
        if (folder / "feedback.csv").exists():
            with open(folder / "feedback.csv", encoding="ascii", errors="replace", newline="") as file:
                feedback = Feedback(file, arguments.from_us, arguments.to_us, name=str(folder / "feedback.csv"))
    with open(path, encoding="ascii", errors="replace", newline="\n") as file:
        window = Window(file, arguments.from_us, arguments.to_us, name=path.parent.name if Path(arguments.trace[i]).is_dir() else path.name)
    platform = Configuration(config) if config else None
    if arguments.what in ("limits", "animation") and platform is None:
        raise PlotError(f"{arguments.what}: needs the configuration of the run, --config FILE")
    lines = read_frames(frames) if frames else []
    return window, platform, dots_of(lines, platform), [(line.t_us, line.text) for line in lines if line.is_request], feedback


def draw(arguments):
    if arguments.what == "animation":
        window, platform, *_ = read(arguments, 0)
        arguments.output.write_text(animation.page(window, platform), encoding="utf-8")
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
        shares.draw_limits(scenes[0], arguments.output)
    elif arguments.what == "spectrum":
        shares.draw_spectrum(scenes, names, arguments.output)
    else:
        curves.draw(scenes, names, arguments.output)


def main(words=None, program=None):
    arguments = parse_arguments(words, program)
    try:
        draw(arguments)
    except (HeaveError, OSError) as error:
        print(f"{program or 'plot'}: {error}", file=sys.stderr)
        return 1
    print(arguments.output)
    return 0
