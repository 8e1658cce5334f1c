"""A word that comes in a late tick is new: nothing of the time before it counts for it, but that of letting go does."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest

from hapticd.tick.guard import Mode
from hapticd.tick.remote.port import PortState
from tests.tick.remote.rig import COUPLING, FORCE_PORT, PERIOD_S, PROMPT, WALL, Rig, update

LATE = [1e-3, 5e-3, 10e-3, 30e-3, 45e-3]
TOOL = COUPLING + PROMPT
BALL = """
[[scene.objects]]
name = "ball"
shape = "box"
size_m = [0.1, 0.1, 0.1]
position_m = [0.0, 0.0, -0.05]
stiffness_n_per_m = 2000.0
remote = true
max_speed_m_per_s = 1.0
"""
AWAY = [0.5, 0.5, 0.5]


def real(scene: str, axes: str = "x", **info: Any) -> Rig:
    rig = Rig(scene, axes=axes, simulated=False, **info)
    rig.go([0.0] * len(axes), 5)
    return rig


def held(rig: Rig, ticks: int = 400, **said: Any) -> float:
    """The force of a tool whose client says the same in every tick."""
    for _ in range(ticks):
        rig.say("tool", **said)
        rig.go()
    return rig.force[0]


@pytest.mark.parametrize("late_s", LATE)
def test_the_first_word_of_a_force_comes_in_as_from_a_tick_in_time(late_s: float) -> None:
    """2.7 N of 3 N at once, in a tick that was 45 ms late."""
    rig = real(FORCE_PORT)
    rig.say("field", force_n=[3.0])
    assert rig.go(dt_s=late_s)[0] == pytest.approx(0.012)
    assert rig.go()[0] == pytest.approx(0.048)


@pytest.mark.parametrize("late_s", LATE)
def test_another_force_comes_as_slowly(late_s: float) -> None:
    rig = real(FORCE_PORT)
    for _ in range(200):
        rig.say("field", force_n=[3.0])
        rig.go()
    rig.say("field", force_n=[-3.0])
    assert rig.go(dt_s=late_s)[0] == pytest.approx(3.0 - 0.6)


@pytest.mark.parametrize("late_s", LATE)
@pytest.mark.parametrize(("before_n_per_m", "after_n_per_m"), [(2000.0, 0.0), (0.0, 2000.0)])
def test_another_stiffness_of_a_coupling_comes_by_the_ramp(
    late_s: float, before_n_per_m: float, after_n_per_m: float
) -> None:
    """3.2 N in a tick."""
    rig = real(TOOL)
    before_n = held(rig, position_m=[2e-3], stiffness_n_per_m=before_n_per_m)
    forces_n = [before_n]
    for dt_s in (late_s, PERIOD_S, PERIOD_S):
        rig.say("tool", position_m=[2e-3], stiffness_n_per_m=after_n_per_m)
        forces_n.append(rig.go(dt_s=dt_s)[0])
    assert max(abs(after - before) for before, after in pairwise(forces_n)) <= 0.09


def test_a_ramp_that_is_under_way_goes_by_the_time_of_a_late_tick() -> None:
    """Else it would take longer than it may."""
    rig = real(TOOL)
    before_n = held(rig, position_m=[2e-3])
    for dt_s in (PERIOD_S, PERIOD_S, 20e-3, PERIOD_S):
        rig.say("tool", position_m=[2e-3], stiffness_n_per_m=0.0)
        rig.go(dt_s=dt_s)
    assert rig.force[0] == pytest.approx(before_n * (1.0 - 22e-3 / 50e-3)), "each tick gives what was reached before"


@pytest.mark.parametrize("late_s", LATE)
@pytest.mark.parametrize(
    ("was", "is_now"), [("max_force_n = 6.0", "max_force_n = 1.0"), ("n_per_m = 2000.0", "n_per_m = 200.0")]
)
@pytest.mark.parametrize("turned", [False, True])
def test_a_reload_that_took_long_changes_a_coupling_by_the_ramp(
    late_s: float, was: str, is_now: str, turned: bool
) -> None:
    """6 N became 2.9 N at once."""
    before, after = TOOL, TOOL.replace(was, is_now)
    if turned:
        before, after = after, before
    rig = real(before)
    forces_n = [held(rig, position_m=[2.5e-3])]
    rig.switch(after)
    rig.tick.begin_late(late_s - PERIOD_S)
    for dt_s in (late_s, PERIOD_S, PERIOD_S):
        rig.say("tool", position_m=[2.5e-3])
        forces_n.append(rig.go(dt_s=dt_s)[0])
    assert max(abs(after - before) for before, after in pairwise(forces_n)) <= 0.15


@pytest.mark.parametrize("late_s", LATE)
def test_a_stiffer_object_comes_by_the_ramp(late_s: float) -> None:
    """0.5 N became 9.5 N in that tick."""
    rig = Rig(BALL, axes="xyz", arm=False, simulated=False)
    rig.at = [0.0, 0.0, 1e-3]
    rig.sample.position_m[:] = rig.at
    rig.tick.start(rig.sample)
    assert rig.tick.arm()
    for tick in range(400):
        rig.say("ball", stiffness_n_per_m=100.0)
        rig.go([0.0, 0.0, 1e-3 - 6e-3 * min(1.0, tick / 200)])
    assert rig.force[2] == pytest.approx(0.5)
    rig.say("ball", stiffness_n_per_m=2000.0)
    assert rig.go(dt_s=late_s)[2] == pytest.approx(0.7)
    rig.say("ball", stiffness_n_per_m=2000.0)
    assert rig.go()[2] == pytest.approx(0.9)


@pytest.mark.parametrize("late_s", LATE)
def test_a_word_is_no_older_than_it_is(late_s: float) -> None:
    """With 20 ms to hold it was let go, though its client speaks in every tick."""
    rig = real(TOOL + "hold_s = 0.02\n")
    held(rig, position_m=[2e-3])
    rig.say("tool", position_m=[2e-3])
    rig.go(dt_s=late_s)
    assert rig["tool"].age_s == pytest.approx(PERIOD_S)
    assert rig["tool"].state is PortState.HELD
    rig.go(dt_s=late_s)
    assert rig["tool"].age_s == pytest.approx(PERIOD_S + late_s)


@pytest.mark.parametrize("late_s", LATE)
def test_a_target_that_moves_along_with_the_device_is_not_thrown_ahead(late_s: float) -> None:
    """By 15 mm, and the coupling's force from 1 N to its limit."""
    rig = real(TOOL, has_clock=False)
    x_m = 0.0
    for dt_s in [PERIOD_S] * 400 + [late_s] + [PERIOD_S] * 15:
        x_m += 0.5 * dt_s
        rig.say("tool", position_m=[x_m], velocity_m_per_s=[0.5])
        (force_n,) = rig.go([x_m], dt_s=dt_s)
        assert force_n <= 1.001
        assert rig["tool"].target_m[0] - x_m <= 0.5e-3 + 1e-9
    assert force_n == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("apart", [1, 4, 10, 20])
@pytest.mark.parametrize("every", [1, 7])
def test_an_object_is_where_its_client_says_however_far_samples_are_apart(apart: int, every: int) -> None:
    """It was a sample ahead, 4 mm at 20 ms and 0.2 m/s, or not, with a client that speaks now and then."""
    rig = Rig(BALL, axes="xyz")
    off_m = []
    for tick in range(1200):
        x_m = 0.2 * max(0, tick - 300) * 1e-3
        if tick % every == 0:
            velocity = [0.2 if tick >= 300 else 0.0, 0.0, 0.0]
            rig.say("ball", position_m=[x_m, 0.0, -0.2], velocity_m_per_s=velocity)
        if tick % apart:
            rig.repeat()
            continue
        rig.sample.position_m[:] = AWAY
        rig.sample.time_ns += apart * 1_000_000
        rig.sample.sequence += 1
        rig.tick.advance(rig.sample, PERIOD_S)
        if tick > 700:
            off_m.append(rig["ball"].target_m[0] - x_m)
    assert max(off_m) <= 0.2e-3 + 1e-9
    assert min(off_m) >= -0.15e-3


@pytest.mark.parametrize("hold_s", [0.1, 1.0])
def test_an_object_that_is_let_go_stops(hold_s: float) -> None:
    """It went on for `hold_s`: half a metre."""
    rig = Rig(BALL + f"hold_s = {hold_s}\n", axes="xyz")
    for tick in range(300):
        turn = {"angular_velocity_rad_per_s": [0.0, 0.0, 2.0]}
        rig.say("ball", position_m=[0.5 * tick * 1e-3, 0.0, -0.2], velocity_m_per_s=[0.5, 0.0, 0.0], **turn)
        rig.go(AWAY)
    at_m, turned = list(rig["ball"].target_m), rig["ball"].turning.now
    rig["ball"].take(update(rig.seq + 1, released=True))
    rig.go(AWAY, 500)
    assert rig["ball"].state is PortState.RELEASED
    assert math.dist(rig["ball"].target_m, at_m) < 1e-6
    assert math.dist(rig["ball"].turning.now, turned) < 2e-3


@pytest.mark.parametrize("enabling_s", [0.09, 0.3, 0.9])
@pytest.mark.parametrize("speaks", [False, True])
def test_a_client_that_was_silent_while_the_device_was_enabled_comes_in_with_nothing(
    enabling_s: float, speaks: bool
) -> None:
    """2.8 N of one that was dead: no tick counts the time that enabling takes."""
    rig = Rig(FORCE_PORT, arm=False, simulated=False)
    rig.go([0.0], 5)
    for tick in range(100):
        rig.say("field", force_n=[3.0 - 1e-3 * (tick % 2)])
        rig.go()
    assert rig.tick.arm()
    rig.tick.begin_late(enabling_s)
    if speaks:
        rig.say("field", force_n=[3.0])
    forces_n = [rig.go(dt_s=enabling_s)[0], *(rig.go()[0] for _ in range(30))]
    assert (max(forces_n) > 1.0) is speaks
    assert any(forces_n) is speaks
    assert rig["field"].state is (PortState.HELD if speaks else PortState.IDLE)


@pytest.mark.parametrize("lost", [False, True], ids=["impossible", "not calibrated"])
def test_what_is_told_while_the_device_is_nowhere_is_that_nothing_pushes(lost: bool) -> None:
    """A second later the port still had 2 N, held, of a client that was a millisecond old, and the wall 3 N."""
    rig = real(TOOL + WALL, has_clock=True)
    for tick in range(300):
        rig.say("tool", position_m=[0.0])
        rig.go([-1e-3 * min(1.0, tick / 200)])
    assert rig["tool"].force_n[0] == pytest.approx(2.0)
    rig["tool"].news = None
    for tick in range(1000):
        if lost:
            rig.sample.calibrated = False
        rig.sample.position_m[:] = [0.0 if lost else math.nan]
        rig.sample.time_ns += 1_000_000
        rig.sample.sequence += 1
        if 300 < tick < 500:
            rig.say("tool", position_m=[0.0])
        force_n = list(rig.tick.advance(rig.sample, PERIOD_S))
        if tick == 499:
            assert rig["tool"].state is PortState.HELD
    assert rig.tick.guard.mode is Mode.DISARMED
    assert force_n == rig["tool"].force_n == [0.0]
    assert rig.tick.contacts[0].applied_n == 0.0
    assert rig["tool"].state is PortState.STALE
    assert rig["tool"].news is PortState.STALE
