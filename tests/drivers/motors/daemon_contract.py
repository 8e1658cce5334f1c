"""What the whole daemon, `hapticd run`, has to show on every family of motor controllers."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Protocol

import pytest

from tests.daemon.running import Daemon
from tests.drivers.motors.bench import Bench
from tests.drivers.motors.daemon import (
    LIMIT_N_PER_M,
    PRESS_N,
    SHAKES_M,
    SOFT_N_PER_M,
    STILL_M,
    config,
    kill_the_loop,
    lost_and_found,
    press,
    pressed,
)

STIFF_N_PER_M = 3.0 * LIMIT_N_PER_M


class Rig(Protocol):
    """A family's device on the bench, as its `lab` makes it."""

    bench: Bench

    @property
    def first(self) -> Any:
        """The first controller."""

    def plug(self) -> Any:
        """Put the adapter in again."""


class MotorDaemonContract:
    """A family inherits it, says what its [device] is, and has a fixture `bench`."""

    DEVICE: ClassVar[str]
    """Its tables; `{port}` is where the adapter is."""

    def device(self, port: Path) -> str:
        return self.DEVICE.format(port=port)

    @pytest.mark.parametrize(
        ("law", "stiffness_n_per_m", "still"),
        [("none", SOFT_N_PER_M, True), ("none", STIFF_N_PER_M, False), ("", STIFF_N_PER_M, True)],
    )
    def test_the_default_law_holds_a_wall_of_three_times_the_limit_and_no_law_does_not(
        self, bench: Rig, tmp_path: Path, law: str, stiffness_n_per_m: float, still: bool
    ) -> None:
        with Daemon(config(self.device(tmp_path / "port"), stiffness_n_per_m, law)) as daemon:
            rest = pressed(daemon.wait_ready(), bench.bench, still)
        if still:
            assert rest.swing_m < STILL_M
            assert rest.mean_m == pytest.approx(-PRESS_N / stiffness_n_per_m, abs=0.1e-3)
        else:
            assert rest.swing_m > SHAKES_M

    def test_sigterm_leaves_no_force(self, bench: Rig, tmp_path: Path) -> None:
        with Daemon(config(self.device(tmp_path / "port"), SOFT_N_PER_M)) as daemon:
            daemon.wait_ready()
            press(bench.bench)
            daemon.process.terminate()
            assert daemon.wait_exit() == 0
            assert bench.first.torque_n_m == 0.0

    def test_a_loop_that_is_killed_leaves_no_force(self, bench: Rig, tmp_path: Path) -> None:
        """The supervisor's helper takes it, since no time passes for the controller's watchdog here."""
        with Daemon(config(self.device(tmp_path / "port"), SOFT_N_PER_M)) as daemon:
            kill_the_loop(daemon.wait_ready(), bench.bench)
            assert bench.first.torque_n_m == 0.0
            assert "the device is without force" in daemon.output()

    def test_an_adapter_that_is_unplugged_is_lost_and_found_again(self, bench: Rig, tmp_path: Path) -> None:
        with Daemon(config(self.device(tmp_path / "port"), SOFT_N_PER_M)) as daemon:
            assert "gone" in lost_and_found(daemon.wait_ready(), bench.bench, bench.plug)
            assert pressed(daemon, bench.bench).swing_m < STILL_M
