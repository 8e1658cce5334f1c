"""The whole daemon on motors that are not there: what every family of controllers has to show.

A millisecond of the motors is a tick of the daemon's, so that load on this computer changes only how long it takes.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from typing import Any

from hapticd.tick.event import EventCode
from tests.daemon.running import PATIENCE_S, Daemon, Subscriber
from tests.drivers.motors.bench import Bench
from tests.drivers.resting import DisturbedError, Rest, calmest

LIMIT_N_PER_M = 700.0
"""The stiffest wall that these motors hold without a law, where they rest after seconds; 1000 N/m shakes [N/m]."""

SOFT_N_PER_M = 500.0
"""One at which they rest soon [N/m]."""

PRESS_N = 1.0
START_M = 0.002
TICKS = 4000
"""For as long as a wall at the limit takes to rest: one that shakes is told from one that only rings."""
STILL_M = 2e-5
SHAKES_M = 5e-3
"""What shakes moves at least so far: 8 mm at three times the limit; at the limit late states have it move 2 mm [m]."""

BUSY = {
    EventCode.LOOP_LATE,
    EventCode.DEVICE_FROZEN,
    EventCode.DEVICE_LOST,
    EventCode.DEVICE_FAULT,
    EventCode.OVER_SPEED,  # a handle that drifted off while it was let go is put back in one tick
}
"""What this computer brings about when it has no time for the loop or for the motors."""

ATTEMPTS = 15
"""A computer whose processors others want as well disturbs most of them."""


def config(device: str, stiffness_n_per_m: float, law: str = "") -> str:
    """A real configuration: a wall on a device.

    Args:
        device: its [device.options].
        stiffness_n_per_m: of the wall.
        law: "" leaves the default.
    """
    return f"""
[loop]
law_budget = 1.0
{device}
[[scene.walls]]
axis = "x"
stiffness_n_per_m = {stiffness_n_per_m}
{f'[controller]{chr(10)}law = "{law}"' if law else ""}
[safety]
auto_arm = true
max_speed_m_per_s = 20.0
"""


def press(bench: Bench) -> None:
    """A hand pushes the handle into the wall, from above it."""
    with bench.lock:
        shaft = bench.controllers[0].shaft
        shaft.x_m, shaft.v_m_per_s, shaft.hand_n = START_M, 0.0, -PRESS_N


def let_go(bench: Bench) -> None:
    """The hand takes the handle out of the wall."""
    with bench.lock:
        shaft = bench.controllers[0].shaft
        shaft.x_m, shaft.v_m_per_s, shaft.hand_n = START_M, 0.0, 0.0


def let_go_and_arm(daemon: Daemon, bench: Bench) -> None:
    """As a user would: clear a fault that arming tells of, and arm again."""
    let_go(bench)
    end_s = time.monotonic() + PATIENCE_S
    while refused := daemon.ask("clear") or daemon.ask("arm"):
        assert time.monotonic() < end_s, f"{refused}: {daemon.output()}"
        time.sleep(0.05)


def pressed(daemon: Daemon, bench: Bench, still: bool = True) -> Rest:
    """The calmest half second of a handle that a hand presses into the wall; anew where the loop was disturbed.

    Args:
        daemon: that is ready.
        bench: where the motors are.
        still: whether it is to rest, so that a handle that does not though states came late says nothing.
    """
    said = []
    for _ in range(ATTEMPTS):
        let_go_and_arm(daemon, bench)
        press(bench)
        try:
            rest = calmest(daemon.endpoint, TICKS, STILL_M)
        except DisturbedError as disturbed:
            if disturbed.code not in {None, *BUSY}:
                raise
            said.append(str(disturbed))
            continue
        if not (still and rest.disturbed):
            return rest
        said.append(str(rest))
    raise AssertionError(f"{said}: {daemon.output()}")


def lost_and_found(daemon: Daemon, bench: Bench, plug: Callable[[], Any]) -> str:
    """Pull the adapter while the wall pushes, put it in again; what the daemon said."""
    push(daemon, bench)  # first: a busy computer may have lost the device before it pushes
    with Subscriber(daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber:
        subscriber.until("hapticd/status")  # it is connected
        bench.unplug()
        lost = subscriber.until("hapticd/event", code=EventCode.DEVICE_LOST)
        plug()
        subscriber.until("hapticd/event", code=EventCode.DEVICE_FOUND)
    return str(lost["text"])


def push(daemon: Daemon, bench: Bench) -> None:
    """Press until the wall pushes; again when this computer was so busy that the loop has let go."""
    for _ in range(ATTEMPTS):
        let_go_and_arm(daemon, bench)
        press(bench)
        end_s = time.monotonic() + 10.0
        while time.monotonic() < end_s:
            if bench.controllers[0].torque_n_m != 0.0:
                return
            time.sleep(0.001)
    raise AssertionError(f"the wall did not push: {daemon.output()}")


def kill_the_loop(daemon: Daemon, bench: Bench) -> None:
    """End the control process while the wall pushes; returns when the supervisor has ended as well."""
    push(daemon, bench)
    os.kill(daemon.control_pid(), signal.SIGKILL)
    assert daemon.wait_exit() == 1
