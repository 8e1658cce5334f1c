"""A wall, a hand that presses into it, and a whole daemon on the fake device, which the test sees from the outside."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.daemon.running import Daemon
from tests.drivers.forcedimension.bench import Bench

AXES = ("x", "y", "z")
PRESS_N = 3.0
WALL_M = -0.01
SLOW = 0.02
"""What a second of the wall clock is to the fake's watchdog in the daemon: a busy computer must not trip it."""

_STILL_M = 0.05e-3


def config(
    bench: Bench,
    stiffness_n_per_m: float,
    law: str = "energy-cycle",
    rate_hz: float = 1000.0,
    axis: str = "z",
    accept_no_watchdog: bool = False,
) -> str:
    return f"""
        [loop]
        rate_hz = {rate_hz}
        law_budget = 1.0
        [device]
        driver = "omega7"
        accept_no_watchdog = {str(accept_no_watchdog).lower()}
        [device.options]
        library = "{bench.directory}"
        [[scene.walls]]
        axis = "{axis}"
        position_m = {WALL_M}
        stiffness_n_per_m = {stiffness_n_per_m}
        [controller]
        law = "{law}"
        [safety]
        auto_arm = true
    """


def press(bench: Bench, drop_m: float, rate_hz: float = 1000.0, axis: str = "z") -> None:
    """Put the device above the wall, at rest, with a hand that presses."""
    across = [float(name == axis) for name in AXES]
    bench.set(-1, period_us=1e6 / rate_hz)
    bench.set(hand_n=[-PRESS_N * one for one in across], position_m=[(WALL_M + drop_m) * one for one in across])


@dataclass(frozen=True)
class Rest:
    """What some time in the wall came to."""

    peak_to_peak_m: float
    depth_m: float

    def held(self, stiffness_n_per_m: float) -> bool:
        called_for_m = PRESS_N / stiffness_n_per_m
        return self.peak_to_peak_m < _STILL_M and abs(self.depth_m - called_for_m) <= max(0.1 * called_for_m, 3e-5)


def rest_of(positions_m: Sequence[float]) -> Rest:
    return Rest(max(positions_m) - min(positions_m), WALL_M - sum(positions_m) / len(positions_m))


class Lab:
    """A daemon on a device of its own.

    The device moves in real time, since the loop takes dt from the clock of a computer that is never quite on time.

    Args:
        fake_sdk: where the fake was built.
        file: the device's memory.
        stiffness_n_per_m: wall.
        rate_hz: of the loop.
        law: what stabilises the wall.
        prepare: does more to the device before the daemon sees it.
        accept_no_watchdog: what the user has agreed to.
    """

    def __init__(
        self,
        fake_sdk: Path,
        file: Path,
        stiffness_n_per_m: float,
        rate_hz: float = 1000.0,
        law: str = "energy-cycle",
        prepare: Callable[[Bench], None] = lambda _: None,
        accept_no_watchdog: bool = False,
    ) -> None:
        self.file = file
        self.stiffness_n_per_m = stiffness_n_per_m
        self.rate_hz = rate_hz
        self.bench = Bench(fake_sdk, file)
        press(self.bench, 0.003, rate_hz)
        self.bench.set(-1, wall_scale=SLOW, real_time=1)
        prepare(self.bench)
        os.environ["FAKE_DHD_FILE"] = str(file)
        try:
            text = config(self.bench, stiffness_n_per_m, law, rate_hz, accept_no_watchdog=accept_no_watchdog)
            self.daemon = Daemon(text)
        finally:
            del os.environ["FAKE_DHD_FILE"]
        self.ask = self.daemon.ask

    def __enter__(self) -> Lab:
        self.daemon.wait_ready()
        return self

    def __exit__(self, *exception: object) -> None:
        self.daemon.__exit__(*exception)

    def look(self) -> Bench:
        """Its device; a process sees one at a time, so this takes the view away from another lab."""
        self.bench.attach(self.file)
        return self.bench
