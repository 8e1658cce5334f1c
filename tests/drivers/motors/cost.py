"""What a tick costs with motor controllers and with an Inverse3, beside the simulated device's tick.

python -m tests.drivers.motors.cost [TICKS]

The controllers are in this process and answer over pseudo-terminals and a WebSocket; what is measured is the daemon's
own loop in a process of its own. What USB and the bus add only a device can tell.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from hapticd_bench.tick.bodies import ROUNDS, Bodies, measure_bodies
from hapticd_bench.tick.case import Case, scene
from tests.drivers.haply.service import FakeService
from tests.drivers.moteus.controller import MoteusController
from tests.drivers.motors.bench import Bench, Controller
from tests.drivers.motors.shaft import Shaft
from tests.drivers.motors.wire import FdcanusbEnd, SlcanEnd
from tests.drivers.odrive.controller import OdriveController

TICKS = 4000
SOFT_N_PER_M = 200.0
"""A wall that stays calm while this computer does something else [N/m]: the motors move in real time."""


def measure(ticks: int) -> Bodies:
    """Measure the reference, the simulated device, and each family, moteus with one motor and with three.

    Args:
        ticks: how many of each.
    """
    cases = [Case("reference", "arithmetic"), Case("device", "loopback", scene())]
    with tempfile.TemporaryDirectory() as directory, ExitStack() as stack:
        for name, motors in (("moteus", 1), ("moteus", 3), ("odrive", 1)):
            port = Path(directory) / f"{name}-{motors}"
            stack.enter_context(_bench(name, motors, port))
            cases.append(Case("device", f"{name}, {motors}", _text(name, motors, port)))
        service = stack.enter_context(FakeService())
        cases.append(Case("device", "inverse3", _service_text(service.url)))
        return measure_bodies(cases, ticks, min(ROUNDS, ticks), lambda _: None)


def lines(found: Bodies) -> list[str]:
    """The figures as a table: each as time, and next to the simulated device's."""
    loopback_us = found.bodies[1].paced_us.p50
    shown = [f"{'':22}{'p50 us':>8}{'p99 us':>8}{'to loopback':>12}"]
    for body in found.bodies:
        problem = f"  {body.problem}" if body.problem else ""
        us = body.paced_us
        shown.append(f"{f'{body.group} {body.name}':22}{us.p50:8.1f}{us.p99:8.1f}{us.p50 / loopback_us:12.2f}{problem}")
    return [*shown, f"real-time: {'yes' if found.realtime else 'no'}", *found.warnings]


@contextmanager
def _bench(name: str, motors: int, port: Path) -> Iterator[None]:
    controllers: list[Controller] = []
    for index in range(motors):
        shaft = Shaft()
        shaft.hand_n = -0.2
        if name == "moteus":
            controllers.append(MoteusController(index + 1, shaft))
        else:
            one = OdriveController(index, shaft)
            one.watchdog_s = 1.0
            controllers.append(one)
    end = FdcanusbEnd(port) if name == "moteus" else SlcanEnd(port)
    with Bench(end, controllers, "real"):
        yield


def _text(name: str, motors: int, port: Path) -> str:
    first = 1 if name == "moteus" else 0
    axes = "".join(
        f"[[device.options.axes]]\nid = {first + index}\nradius_m = 0.01\nmax_torque_n_m = 0.05\nlowest_m = -0.05\n"
        'highest_m = 0.05\nhoming = "absolute"\n'
        for index in range(motors)
    )
    return (
        f'[device]\ndriver = "{name}"\n[device.options]\nchannel = "{port}"\n'
        "sign_checked = true\nwatchdog_ms = 1000.0\n"
        f'{axes}[[scene.walls]]\naxis = "x"\nstiffness_n_per_m = {SOFT_N_PER_M}\n[velocity]\nestimator = "device"\n'
        "[safety]\nmax_speed_m_per_s = 100.0\n"
    )


def _service_text(url: str) -> str:
    return (
        f'[device]\ndriver = "inverse3"\naccept_no_watchdog = true\n[device.options]\nurl = "{url}"\n'
        f'[[scene.walls]]\naxis = "x"\nstiffness_n_per_m = {SOFT_N_PER_M}\n[safety]\nmax_speed_m_per_s = 100.0\n'
    )


if __name__ == "__main__":
    for line in lines(measure(int(sys.argv[1]) if len(sys.argv) > 1 else TICKS)):
        print(line)  # noqa: T201 - its output
