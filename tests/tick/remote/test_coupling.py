"""A coupling pulls the device to where a client says, and gently at each end."""

from __future__ import annotations

import math

import pytest

from hapticd.tick.remote.follower import HASTE_PER_S
from hapticd.tick.remote.port import PortState
from tests.tick.remote.rig import COUPLING, MOST_N, PERIOD_S, RAMP_S, WALL, Rig, apart, length

K, B, FASTEST = 2000.0, 5.0, 1.0
RAMP_TICKS = round(RAMP_S / PERIOD_S)
STEP_N = MOST_N / RAMP_TICKS
"""What a ramp changes a force by in a tick, at most [N]."""
FOLLOW_N = (K + HASTE_PER_S * B) * FASTEST * PERIOD_S
"""What the target's motion changes it by, at most [N]."""


def held_at(rig: Rig, target_m: list[float], ticks: int) -> list[float]:
    for _ in range(ticks):
        rig.say("tool", position_m=target_m)
        rig.go()
    return rig.force


def test_without_a_client_there_is_no_force_and_nothing_to_do() -> None:
    rig = Rig()
    for n in range(100):
        assert rig.go([0.01 * math.sin(0.1 * n)]) == [0.0]
    assert rig["tool"].state is PortState.IDLE
    assert rig["tool"].seq == -1
    assert rig.tick.totals().ledger.energy_j == 0.0


@pytest.mark.parametrize("axes", ["x", "xy", "xyz"])
def test_a_client_that_moves_the_target_moves_the_spring(axes: str) -> None:
    rig = Rig(axes=axes)
    target_m = [1e-3, -5e-4, 2e-4][: len(axes)]
    force = held_at(rig, target_m, 300)
    assert force == pytest.approx([K * m for m in target_m], abs=1e-6)
    port = rig["tool"]
    assert port.state is PortState.HELD
    assert port.seq == rig.seq
    assert port.force_n == force
    assert port.target_m == pytest.approx(target_m)


@pytest.mark.parametrize(("law", "ticks"), [("late-cycle", 300), ("none", 80)])
def test_it_begins_at_the_device_and_goes_to_the_target_no_faster_than_told(law: str, ticks: int) -> None:
    rig = Rig(law=law)
    rig.go([0.02])
    rig.say("tool", position_m=[-0.98])
    assert rig.go() == pytest.approx([0.0], abs=1e-12)
    assert rig["tool"].target_m == [0.02]
    was_m, was_n = 0.02, 0.0
    for _ in range(ticks):
        rig.say("tool", position_m=[-0.98])
        (now_n,) = rig.go()
        (now_m,) = rig["tool"].target_m
        assert 0.0 <= was_m - now_m <= FASTEST * PERIOD_S * (1.0 + 1e-9)
        assert abs(now_n - was_n) <= FOLLOW_N + STEP_N
        assert abs(now_n) <= MOST_N
        was_m, was_n = now_m, now_n
    assert rig["tool"].force_n == pytest.approx([-MOST_N])


def test_a_target_with_a_velocity_is_followed_without_lag_and_no_further_than_hold_s() -> None:
    rig = Rig()
    for n in range(600):
        if n % 20 == 0:
            rig.say("tool", position_m=[0.2 * n * PERIOD_S], velocity_m_per_s=[0.2])
        rig.go()
    assert rig["tool"].target_m[0] == pytest.approx(0.2 * 0.6, abs=1e-6)
    held_m = rig["tool"].target_m[0]
    rig.go(ticks=500)
    assert rig["tool"].target_m[0] - held_m == pytest.approx(0.2 * (0.1 - 0.02), abs=1e-3)


def test_one_that_stands_still_between_its_words_is_made_up_for_within_twenty_ticks_and_never_passed() -> None:
    rig = Rig()
    held_at(rig, [0.0], 100)
    rig.say("tool", position_m=[1e-3])
    way = []
    for _ in range(20):
        rig.go()
        way += rig["tool"].target_m
    assert way == sorted(way)
    assert way[-1] == pytest.approx(1e-3, abs=1e-5)
    assert max(way) <= 1e-3


def test_stiffness_and_damping_go_over_by_a_ramp_and_no_further_than_the_file_allows() -> None:
    rig = Rig()
    held_at(rig, [2e-3], 300)
    (was_n,) = rig.force
    for _ in range(100):
        rig.say("tool", position_m=[2e-3], stiffness_n_per_m=500.0, damping_n_s_per_m=0.0)
        (now_n,) = rig.go()
        assert abs(now_n - was_n) <= 2e-3 * 1500.0 / RAMP_TICKS + 1e-9
        was_n = now_n
    assert rig.force == pytest.approx([1.0])
    for _ in range(100):
        rig.say("tool", position_m=[2e-3], stiffness_n_per_m=1e6, damping_n_s_per_m=1e6)
        rig.go()
    assert rig.force == pytest.approx([4.0])
    assert rig["tool"].damping.now == B


def test_a_disarmed_device_has_no_force_and_after_arming_it_comes_in_by_the_ramp() -> None:
    rig = Rig(arm=False)
    assert held_at(rig, [2e-3], 200) == [0.0]
    assert rig.tick.arm()
    (was_n,) = rig.force
    for _ in range(100):
        (now_n,) = held_at(rig, [2e-3], 1)
        assert abs(now_n - was_n) <= 2.0 * MOST_N / RAMP_TICKS
        was_n = now_n
    assert was_n == pytest.approx(4.0)
    rig.tick.release()
    forces = [held_at(rig, [2e-3], 1)[0] for _ in range(RAMP_TICKS)]
    assert forces == sorted(forces, reverse=True)
    assert forces[-1] == pytest.approx(0.0, abs=1e-9)
    assert held_at(rig, [2e-3], 10) == [0.0]


def test_a_device_that_knows_its_place_again_waits_for_the_clients_next_word() -> None:
    """What it was told before was told of another place, perhaps."""
    rig = Rig()
    held_at(rig, [2e-3], 300)
    rig.go([math.nan], ticks=20)
    assert rig.force == [0.0]
    rig.at = [0.0]
    rig.tick.guard.clear()
    rig.go(ticks=5)
    assert rig.tick.arm()
    assert rig.go(ticks=50) == [0.0]
    assert rig["tool"].state is PortState.IDLE
    assert held_at(rig, [2e-3], 300) == pytest.approx([4.0])


def test_the_limit_holds_for_the_vector_and_for_what_the_law_adds() -> None:
    rig = Rig(law="damper", axes="xyz")
    for n in range(400):
        rig.say("tool", position_m=[0.01, -0.01, 0.01])
        rig.go([0.004 * math.sin(0.9 * n), 0.003 * math.cos(1.3 * n), 0.0])
        assert length(rig.force) <= MOST_N
    assert length(rig.force) > 0.9 * MOST_N


def test_beside_a_wall_both_pull_and_the_books_balance() -> None:
    rig = Rig(COUPLING + WALL, law="energy-cycle")
    for n in range(2000):
        rig.say("tool", position_m=[4e-3 * math.sin(0.02 * n)])
        rig.go([1e-3 * math.sin(0.05 * n)])
    assert rig.unbalanced_j() < 1e-9
    assert rig.tick.contacts[0].ledger.energy_j != 0.0
    assert rig["tool"].work_j != 0.0


def test_a_law_that_fails_leaves_the_fallback_and_the_force_goes() -> None:
    rig = Rig(law="tests.tick.remote.failing_law")
    held_at(rig, [2e-3], 100)
    assert rig.tick.fault
    assert "law tests.tick.remote.failing_law: " in rig.tick.fault_text
    held_at(rig, [2e-3], 100)
    assert rig.force == [0.0]


def test_the_impulse_is_the_sum_of_the_forces_that_were_held() -> None:
    rig = Rig(axes="xyz")
    sums = [0.0] * 3
    for n in range(300):
        if n < 150:
            rig.say("tool", position_m=[1e-3, 2e-3, 0.0])
        sums = [have + newton * PERIOD_S for have, newton in zip(sums, rig.force, strict=True)]
        rig.go()
        if n % 7 == 0:
            assert apart(rig["tool"].impulse_n_s, sums) < 1e-12
    assert length(sums) > 0.1


@pytest.mark.parametrize("driven", [False, True])
def test_damping_against_the_ground_pulls_at_no_target(driven: bool) -> None:
    """A client moves its body by the impulse: a damper between the two is felt there, one against the ground is not."""
    rig = Rig(COUPLING.replace("damping_n_s_per_m = 5.0", f"driven = {str(driven).lower()}"), law="damper")
    held_at(rig, [0.0], 100)
    before, spring = rig["tool"].impulse_n_s[0], 0.0
    for n in range(1, 20):
        rig.say("tool", position_m=[0.0])
        rig.go([1e-5 * n])
        spring += -2000.0 * 1e-5 * n * PERIOD_S
    rig.go()
    pulled = rig["tool"].impulse_n_s[0] - before
    assert (pulled == pytest.approx(spring, rel=0.02)) is not driven
