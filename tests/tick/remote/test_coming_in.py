"""A coupling is soft when it comes into force and what it is when that time is over."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from hapticd.tick.remote.follower import HASTE_PER_S
from tests.tick.remote.rig import COUPLING, PERIOD_S, PROMPT, RAMP_S, Hand, Rig

K, B = 2000.0, 5.0
OFF_M = 1e-3
COME_IN = "come_in_s = 0.2\n"
TICKS = 200
RAMP_TICKS = round(RAMP_S / PERIOD_S)
FOLLOWED = 60  # ticks after which the followed target is there
FOLLOW_N = (K + HASTE_PER_S * B) * OFF_M * HASTE_PER_S * PERIOD_S
"""What the target's way to `OFF_M` changes the force by, at most [N]."""


def pulled(rig: Rig, ticks: int) -> list[float]:
    """The force on a device at rest whose target is `OFF_M` away, tick by tick."""
    found = []
    for _ in range(ticks):
        rig.say("tool", position_m=[OFF_M])
        found += rig.go()
    return found


@pytest.mark.parametrize(
    ("said", "law", "ticks"), [(COME_IN, "none", TICKS), (COME_IN, "late-cycle", TICKS), ("", "late-cycle", 300)]
)
def test_its_spring_grows_evenly_and_then_is_what_it_is(said: str, law: str, ticks: int) -> None:
    force = pulled(Rig(COUPLING + said, law=law), ticks + 50)
    for tick in range(FOLLOWED, ticks):
        assert force[tick] == pytest.approx(K * OFF_M * tick / ticks, rel=0.02)
    assert force[ticks + 2 :] == pytest.approx([K * OFF_M] * 48, rel=1e-9)


@pytest.mark.parametrize(("said", "law"), [(PROMPT, "late-cycle"), ("", "none"), ("", "ring-damping")])
def test_without_a_time_of_its_own_the_ramp_alone_brings_it_in(said: str, law: str) -> None:
    force = pulled(Rig(COUPLING + said, law=law), FOLLOWED + 10)
    assert force[FOLLOWED:] == pytest.approx([K * OFF_M] * 10, rel=1e-3)


def test_its_damper_comes_in_with_it() -> None:
    rig = Rig(COUPLING + COME_IN)
    rig.say("tool", position_m=[0.0], stiffness_n_per_m=0.0)
    rig.go([0.0])
    found = []
    for tick in range(TICKS + 50):
        rig.say("tool", position_m=[0.0], stiffness_n_per_m=0.0)
        found += rig.go([1e-4 * (tick + 1)])
    assert found[TICKS // 2] == pytest.approx(-0.5 * B * 0.1, rel=0.05)
    assert found[-1] == pytest.approx(-B * 0.1, rel=1e-6)


def test_it_comes_in_anew_after_each_silence_and_only_then() -> None:
    rig = Rig(COUPLING + COME_IN)
    first = pulled(rig, TICKS + 50)
    assert pulled(rig, 50) == pytest.approx([K * OFF_M] * 50)
    rig.go(ticks=300)  # silence: let go
    assert rig.force == [0.0]
    assert pulled(rig, TICKS + 50) == pytest.approx(first, rel=1e-9)


@pytest.mark.parametrize("at", [70, 120])
def test_a_reload_that_takes_the_time_away_makes_no_jump_of_it(at: int) -> None:
    rig = Rig(COUPLING + COME_IN)
    force = pulled(rig, at)
    rig.switch(COUPLING + PROMPT)
    force += pulled(rig, 300)
    assert force[-1] == pytest.approx(K * OFF_M)
    steps = [abs(after - before) for before, after in pairwise(force[FOLLOWED:])]
    assert max(steps) <= 1.01 * K * OFF_M / RAMP_TICKS


def test_what_a_client_changes_as_it_comes_in_goes_over_as_slowly_and_the_rest_by_the_ramp() -> None:
    rig = Rig(COUPLING + COME_IN)
    force = pulled(rig, 100)
    for _ in range(TICKS):
        rig.say("tool", position_m=[OFF_M], stiffness_n_per_m=0.25 * K)
        force += rig.go()
    steps = [abs(after - before) for before, after in pairwise(force)]
    assert max(steps[FOLLOWED:TICKS]) <= 1.001 * K * OFF_M / TICKS
    assert max(steps[TICKS:]) <= 1.001 * (max(force) - 0.25 * K * OFF_M) / RAMP_TICKS
    assert force[-1] == pytest.approx(0.25 * K * OFF_M)


def test_the_books_balance_as_it_comes_in_under_a_hand_that_moves() -> None:
    rig = Rig(COUPLING + COME_IN, law="late-cycle")
    hand = Hand(rig)
    for tick in range(900):
        if tick < 300 or tick > 480:
            rig.say("tool", position_m=[0.01 * math.sin(0.02 * tick)])
        hand.run(1, [2.0 * math.sin(0.03 * tick)])
    assert rig.unbalanced_j() < 1e-9
    assert abs(rig.energy_j) > 1e-4


@pytest.mark.parametrize("enable_s", [0.0, 0.02, 0.09])
def test_it_comes_in_with_the_first_tick_after_arming_however_late_that_is(enable_s: float) -> None:
    """What the device took to let forces through was counted as the ramp's: 0.8 N of 2 came at once."""
    rig = Rig(COUPLING + PROMPT, arm=False, simulated=False, host_silence_ms=20.0)
    pulled(rig, 2 * FOLLOWED)
    assert rig.tick.arm()
    rig.say("tool", position_m=[OFF_M])
    force = [*rig.go(dt_s=PERIOD_S + enable_s), *pulled(rig, RAMP_TICKS)]
    assert force == pytest.approx([K * OFF_M * tick / RAMP_TICKS for tick in range(RAMP_TICKS + 1)], rel=1e-4)


@pytest.mark.parametrize("start_s", [0.0, 0.02, 0.04])
def test_another_law_of_it_comes_in_once_that_has_started_however_long_that_took(start_s: float) -> None:
    rig = Rig(COUPLING + PROMPT, simulated=False, host_silence_ms=20.0)
    pulled(rig, 2 * FOLLOWED)
    held_n = rig.force[0]
    for axis in rig.tick.own_ports.axes:
        axis.law.step = lambda *_: 0.0
        rig.tick._blend(axis)
    rig.tick.begin_late(start_s)
    rig.say("tool", position_m=[OFF_M])
    force = [*rig.go(dt_s=PERIOD_S + start_s), *pulled(rig, RAMP_TICKS)]
    assert force == pytest.approx([held_n * (1.0 - tick / RAMP_TICKS) for tick in range(RAMP_TICKS + 1)], abs=1e-9)


def test_a_time_shorter_than_the_ramp_leaves_the_ramp() -> None:
    force = pulled(Rig(COUPLING + "come_in_s = 0.01\n"), 200)
    plain = pulled(Rig(COUPLING + PROMPT), 200)
    assert force[RAMP_TICKS + 20 :] == pytest.approx(plain[RAMP_TICKS + 20 :], rel=1e-9)
    assert all(soft <= hard + 1e-12 for soft, hard in zip(force, plain, strict=True))
    steps = [abs(after - before) for before, after in pairwise(force)]
    assert max(steps) <= FOLLOW_N + K * OFF_M * 2.0 / RAMP_TICKS
