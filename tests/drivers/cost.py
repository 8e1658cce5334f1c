"""What a tick costs with each driver: `hapticd bench device` on its double, one after the other.

    python -m tests.drivers.cost [TICKS]

Doubles run in real time beside the command, on the same processors; each answers as soon as this computer lets it. What
USB, a bus and a processor of its own add or save only a device can tell.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest

from hapticd_drivers.rig.serial_rig import SerialRig, SerialRigOptions
from tests.daemon.running import HAPTICD
from tests.drivers.forcedimension.bench import Bench as SdkBench
from tests.drivers.forcedimension.building import build as build_sdk
from tests.drivers.haply.service import FakeService
from tests.drivers.moteus.controller import MoteusController
from tests.drivers.motors.bench import Bench, Controller
from tests.drivers.motors.shaft import Shaft
from tests.drivers.motors.wire import FdcanusbEnd, SlcanEnd
from tests.drivers.odrive.controller import OdriveController
from tests.drivers.rig.device import Rig
from tests.drivers.rig.device import build as build_rig
from tests.drivers.rig.hid_bench import HidDouble
from tests.drivers.rig.hid_bench import build as build_hid
from tests.firmware.board import Board
from tests.firmware.board import build as build_board

OMEGA7, FALCON = 35, 60
ATTEMPTS = 5
"""A computer that is away for 50 ms stops any real device's loop."""

Double = tuple[str, dict[str, str]]
"""The [device] of a configuration, and the environment in which a program finds the double."""


@contextmanager
def _simulated(_: Path) -> Iterator[Double]:
    yield "", {}


def _behind_the_sdk(device_type: int) -> Callable[[Path], AbstractContextManager[Double]]:
    @contextmanager
    def made(directory: Path) -> Iterator[Double]:
        file = directory / "devices"
        bench = SdkBench(build_sdk(directory / "sdk"), file)
        bench.set(type=device_type)
        bench.set(-1, wall_scale=0.02, real_time=1)  # a busy computer must not trip its watchdog
        text = f'driver = "omega7"\naccept_no_watchdog = true\n[device.options]\nlibrary = "{bench.directory}"'
        yield text, {"FAKE_DHD_FILE": str(file)}

    return made


@contextmanager
def _serial_rig(directory: Path) -> Iterator[Double]:
    with Rig(build_rig(directory / "core"), directory / "port", pace="real") as rig:
        rig.set_home()
        yield _rig_on(rig.port), {}


@contextmanager
def _hapkit(directory: Path) -> Iterator[Double]:
    parts = directory / "board"
    parts.mkdir()
    with Board(build_board(parts, "hapkit"), directory / "port", pace="real") as board:
        with SerialRig(SerialRigOptions(port=str(board.port), sign_checked=True), 0.001) as rig:
            assert rig._talk is not None
            rig._talk.set_home(0, 0)  # as a calibration has told it
        yield _rig_on(board.port), {}


def _rig_on(port: Path) -> str:
    return f'driver = "serial-rig"\n[device.options]\nport = "{port}"\nsign_checked = true'


@contextmanager
def _hid_rig(directory: Path) -> Iterator[Double]:
    double = HidDouble(build_hid(directory))
    try:
        yield 'driver = "hid-rig"\n[device.options]\nsign_checked = true', double.environment
    finally:
        double.close()


def _motors(name: str, motors: int) -> Callable[[Path], AbstractContextManager[Double]]:
    @contextmanager
    def made(directory: Path) -> Iterator[Double]:
        port = directory / "port"
        controllers: list[Controller] = []
        for index in range(motors):
            if name == "moteus":
                controllers.append(MoteusController(index + 1, Shaft()))
            else:
                one = OdriveController(index, Shaft())
                one.watchdog_s = 1.0
                controllers.append(one)
        axes = "\n".join(
            f"[[device.options.axes]]\nid = {one.address}\nradius_m = 0.01\nmax_torque_n_m = 0.05\nlowest_m = -0.03\n"
            'highest_m = 0.03\nhoming = "absolute"'
            for one in controllers
        )
        options = f'channel = "{port}"\nsign_checked = true\nwatchdog_ms = 1000.0\n{axes}'
        with Bench(FdcanusbEnd(port) if name == "moteus" else SlcanEnd(port), controllers, "real"):
            yield f'driver = "{name}"\n[device.options]\n{options}', {}

    return made


@contextmanager
def _inverse3(_: Path) -> Iterator[Double]:
    with FakeService() as service:
        yield f'driver = "inverse3"\naccept_no_watchdog = true\n[device.options]\nurl = "{service.url}"', {}


DOUBLES: dict[str, Callable[[Path], AbstractContextManager[Double]]] = {
    "loopback": _simulated,
    "omega7": _behind_the_sdk(OMEGA7),
    "omega7, a Falcon": _behind_the_sdk(FALCON),
    "serial-rig": _serial_rig,
    "serial-rig, a Hapkit": _hapkit,
    "hid-rig": _hid_rig,
    "moteus": _motors("moteus", 1),
    "moteus, three motors": _motors("moteus", 3),
    "odrive": _motors("odrive", 1),
    "inverse3": _inverse3,
}
"""Every driver, by what the table of docs/benchmarks.md calls it."""

CONFIG = """
[device]
{device}
[safety]
max_speed_m_per_s = 100.0
"""


def measure(name: str, ticks: int) -> dict[str, Any]:
    """What the command prints of a driver on its double.

    Args:
        name: one of `DOUBLES`.
        ticks: how many.

    Raises:
        AssertionError: it failed; says what the command said.
    """
    with tempfile.TemporaryDirectory() as place, DOUBLES[name](Path(place)) as (device, environment):
        config = Path(place) / "lab.toml"
        config.write_text(CONFIG.format(device=device))
        done = subprocess.run(
            [HAPTICD, "bench", "device", "--config", config, "--ticks", str(ticks), "--json"],
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        found: dict[str, Any] = json.loads(done.stdout)
        return found


def row(name: str, found: dict[str, Any]) -> str:
    """A line of the table in docs/benchmarks.md."""
    figures = [found[name]["p50"] for name in ("device_us", "simulated_us", "read_us", "write_us")]
    us = " | ".join(f"{figure:.1f}" for figure in figures)
    return f"| {name} | {us} | {found['p50_ratio']:.1f} |"


if __name__ == "__main__":
    for each in DOUBLES:
        for _ in range(ATTEMPTS):
            try:
                said = row(each, measure(each, int(sys.argv[1]) if len(sys.argv) > 1 else 4000))
                break
            except (AssertionError, pytest.skip.Exception) as error:  # a build skips where it has no compiler
                said = f"| {each} | {error} |"
        print(said, flush=True)  # noqa: T201 - the table is what the program is for
