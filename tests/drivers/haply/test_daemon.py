"""The whole daemon, `hapticd run`, on an Inverse3 behind a service that is not there."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.daemon.running import Daemon
from tests.drivers.haply.service import FakeService
from tests.drivers.motors.daemon import LIMIT_N_PER_M, PRESS_N, SHAKES_M, STILL_M, config, kill_the_loop, pressed

STIFF_N_PER_M = 3.0 * LIMIT_N_PER_M


class Handle:
    """The cursor's x axis, as the motors' tests push a shaft."""

    def __init__(self, service: FakeService) -> None:
        self._cursor = service.cursor
        self.shaft = self

    x_m = property(lambda self: self._cursor.x_m[0], lambda self, value: self._put("x_m", value))
    v_m_per_s = property(lambda self: self._cursor.v_m_per_s[0], lambda self, value: self._put("v_m_per_s", value))
    hand_n = property(lambda self: self._cursor.hand_n[0], lambda self, value: self._put("hand_n", value))
    torque_n_m = property(lambda self: self._cursor.force_n[0])

    def _put(self, name: str, value: float) -> None:
        getattr(self._cursor, name)[0] = value


class HandleBench:
    """What the motors' tests ask of a bench."""

    def __init__(self, service: FakeService) -> None:
        self.lock = service.lock
        self.controllers: list[Any] = [Handle(service)]


@pytest.fixture
def service() -> Iterator[FakeService]:
    with FakeService() as made:
        yield made


def device(service: FakeService) -> str:
    return f"""
[device]
driver = "inverse3"
accept_no_watchdog = true
[device.options]
url = "{service.url}"
max_force_n = 5.0
"""


@pytest.mark.parametrize(("law", "still"), [("none", False), ("", True)])
def test_the_default_law_holds_a_wall_of_three_times_the_limit_and_no_law_does_not(
    service: FakeService, law: str, still: bool
) -> None:
    bench: Any = HandleBench(service)
    with Daemon(config(device(service), STIFF_N_PER_M, law)) as daemon:
        rest = pressed(daemon.wait_ready(), bench, still)
    if still:
        assert rest.swing_m < STILL_M
        assert rest.mean_m == pytest.approx(-PRESS_N / STIFF_N_PER_M, abs=0.1e-3)
    else:
        assert rest.swing_m > SHAKES_M


def test_a_loop_that_is_killed_leaves_no_force(service: FakeService) -> None:
    """The supervisor's helper tells the service so."""
    bench: Any = HandleBench(service)
    with Daemon(config(device(service), 500.0)) as daemon:
        kill_the_loop(daemon.wait_ready(), bench)
        assert service.cursor.force_n == [0.0, 0.0, 0.0]
