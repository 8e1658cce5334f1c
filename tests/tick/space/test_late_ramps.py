"""A ramp of an object begins when what it was asked with has started, however late a real device's next tick is."""

from __future__ import annotations

import dataclasses

import pytest

from hapticd.config.safety import SafetyConfig
from hapticd.tick.assemble import make_tick
from tests.tick.space.rig import INFO, Rig, ball, config
from tests.tick.space.test_changes import RAMP_TICKS, pressed

REAL = dataclasses.replace(INFO, simulated=False, host_silence_ms=20.0)
AT = (0.0, 0.0, 0.0292)


def come_in(rig: Rig, first_s: float) -> list[float]:
    """The force along z on a device that stands still: after a tick that comes so late, and then in time."""
    found = []
    for tick in range(RAMP_TICKS + 10):
        passed_s = 1e-3 if tick else first_s
        rig.sample.time_ns += round(passed_s * 1e9)
        found.append(rig.tick.advance(rig.sample, passed_s)[2])
    return found


@pytest.mark.parametrize("enable_s", [0.0, 0.02, 0.09])
def test_an_object_comes_in_with_the_first_tick_after_arming_however_late_that_is(enable_s: float) -> None:
    """As a wall does: 1.6 N of 4 in the first tick, where the device took 20 ms to let forces through."""
    rig = Rig(ball(), "none", info=REAL).start((0.0, 0.0, 0.031)).to(AT, 60)
    rig.tick.guard.drop()
    rig.go(AT)
    assert rig.tick.arm()
    steps = [4.0 * min(tick / RAMP_TICKS, 1.0) for tick in range(RAMP_TICKS + 10)]
    assert come_in(rig, 1e-3 + enable_s) == pytest.approx(steps)


@pytest.mark.parametrize("start_s", [0.0, 0.02, 0.04])
@pytest.mark.parametrize("after_n", [2.0, 0.0, 8.0], ids=["softer", "gone", "stiffer"])
def test_an_object_changes_from_when_the_change_is_ready_and_not_from_the_tick_before(
    start_s: float, after_n: float
) -> None:
    """What it took to start laws was counted as the ramp's."""
    rig = Rig(ball(), "none", info=REAL).start((0.0, 0.0, 0.031)).to(AT, 60).go(*(5 * [AT]))
    rig.switch(ball(stiffness=after_n / 8e-4) if after_n else "", "damper")
    rig.tick.begin_late(start_s)
    steps = [4.0 + (after_n - 4.0) * min(tick / RAMP_TICKS, 1.0) for tick in range(RAMP_TICKS + 10)]
    assert come_in(rig, 1e-3 + start_s) == pytest.approx(steps, abs=1e-12)


def test_a_ramp_that_is_under_way_counts_the_time_that_another_request_takes() -> None:
    rig = Rig(ball(), "none", info=REAL).start((0.0, 0.0, 0.031)).to(AT, 60).go(*(5 * [AT]))
    rig.switch(ball(stiffness=2500.0)).go(*(11 * [AT]))
    assert rig.force[2] == pytest.approx(4.0 - 2.0 * 10 / RAMP_TICKS)
    rig.tick.begin_late(0.02)
    assert come_in(rig, 0.021)[0] == pytest.approx(4.0 - 2.0 * 31 / RAMP_TICKS)


def test_what_a_request_takes_is_nothing_to_a_simulated_device_nor_to_one_that_was_never_armed() -> None:
    """A ramp of the one goes by ticks, so that a run can be repeated; and the other has none."""
    fast, slow = (pressed(law="none") for _ in range(2))
    for rig in (fast, slow):
        for _ in rig.tick.switch(config(ball(stiffness=9000.0)).config.scene, SafetyConfig(max_force_n=2.0)):
            pass
    slow.tick.begin_late(0.02)
    assert come_in(slow, 1e-3) == come_in(fast, 1e-3)
    never = make_tick(config(ball()), REAL)
    never.start(fast.sample)
    never.begin_late(0.02)
    assert never.advance(fast.sample, 1e-3) == [0.0, 0.0, 0.0]
