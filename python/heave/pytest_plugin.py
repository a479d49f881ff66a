# SPDX-License-Identifier: MIT
"""pytest_plugin.py - fixtures for tests of hosts, drives and platforms.

    def test_rises(platform, sender):
        platform.wait_for("ENGAGED")
        sender.a6(z=20, time_ms=1000)
        platform.wait_for_pose(z_mm=20)

heaved     a heaved for this test alone, on the configuration of --heave-config, of `heave_config` in pytest's own, or the demonstration platform
platform, sender   of that heaved
twin       heave-twin for it, where it is installed; else the test is skipped
lab        lab.run([COMMAND, ...]) on a kernel with CAN

@pytest.mark.heave("ride.ini", changes={"pose.settled_extension_mm": 10}, arguments=[...]) says it for one test. Where a test fails, its report has heaved's log.
"""
from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import heave
from heave import lab as lab_module
from heave.twin import Twin

if TYPE_CHECKING:
    from heave.platform import Platform
    from heave.sender import Sender

LOGS = "_heave_logs"  # of a test: {name: what has a log}; pytest 6 has no stash


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("heave")
    group.addoption("--heave-config", metavar="FILE", help="the platform of the fixture heaved (else heave_config of pytest's configuration, else a simulated hexapod)")
    group.addoption("--heave-bin", metavar="DIR", help="where heaved is (else HEAVE_BIN, else PATH)")
    parser.addini("heave_config", "the platform of the fixture heaved, relative to this file")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "heave(config, changes={}, arguments=[]): the platform of the fixture heaved, of this test")


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, Any, None]:
    outcome = yield
    report = outcome.get_result()
    if report.failed:
        for name, program in getattr(item, LOGS, {}).items():
            report.sections.append((f"log of {name}", program.log))


def _remember(request: pytest.FixtureRequest, name: str, program: Any) -> None:
    setattr(request.node, LOGS, {**getattr(request.node, LOGS, {}), name: program})


def _program(request: pytest.FixtureRequest, name: str) -> Path:
    try:
        return heave.programs.find(name, request.config.getoption("--heave-bin"))
    except heave.NotInstalled as error:
        raise pytest.UsageError(str(error)) from error


@pytest.fixture
def heave_config(request: pytest.FixtureRequest) -> Path:
    """The configuration that heaved is started on."""
    marker = request.node.get_closest_marker("heave")
    if marker is not None and (marker.args or "config" in marker.kwargs):
        chosen, base = Path(marker.args[0] if marker.args else marker.kwargs["config"]), Path(request.node.fspath).parent
    elif request.config.getoption("--heave-config"):
        chosen, base = Path(request.config.getoption("--heave-config")), Path(request.config.invocation_params.dir)
    elif request.config.getini("heave_config"):
        chosen, base = Path(request.config.getini("heave_config")), request.config.rootpath
    else:
        return heave.demo_config()
    path = base / chosen
    if not path.is_file():
        raise pytest.UsageError(f"{path}: there is no such configuration of a platform")
    return path


@pytest.fixture
def heaved(request: pytest.FixtureRequest, heave_config: Path) -> Iterator[heave.Heaved]:
    marker = request.node.get_closest_marker("heave")
    options = {name: value for name, value in (marker.kwargs if marker else {}).items() if name != "config"}
    with heave.Heaved(heave_config, program=_program(request, "heaved"), **options) as running:
        _remember(request, "heaved", running)
        yield running


@pytest.fixture
def platform(heaved: heave.Heaved) -> Platform:
    return heaved.platform


@pytest.fixture
def sender(heaved: heave.Heaved) -> Sender:
    return heaved.sender


@pytest.fixture
def twin(request: pytest.FixtureRequest, heave_config: Path) -> Iterator[Twin]:
    """On the configuration of heaved, with the same changes. Ask for it before heaved: the drives are there when it looks for them."""
    try:
        program = heave.programs.find("heave-twin", request.config.getoption("--heave-bin"))
    except heave.NotInstalled as error:
        pytest.skip(str(error))
    marker = request.node.get_closest_marker("heave")
    with Twin(heave_config, program=program, changes=marker.kwargs.get("changes") if marker else None) as running:
        _remember(request, "heave-twin", running)
        yield running
        running.check()


class Lab:
    """heave-lab. A command that cannot be run fails the test, with the reason."""

    def run(self, command: Sequence[str], *, virtual_time: bool = False, limit_s: float = 300.0, **options: Any) -> lab_module.Finished:
        return lab_module.run(command, virtual_time=virtual_time, limit_s=limit_s, **options)


@pytest.fixture
def lab() -> Lab:
    return Lab()
