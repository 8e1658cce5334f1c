"""The books are the work of the written force, through every transition."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.config.safety import SafetyConfig
from hapticd.errors import ConfigError
from hapticd.tick.guard import Guard
from tests.examples import examples
from tests.tick.rig import Rig, device, law, returns, running, scene, wall
from tests.tick.transitions import DEEDS, MOVES, TRANSITIONS, pressed


@pytest.mark.parametrize("new", [scene(), scene(wall(500.0, position_m=1e-3))])
def test_the_sum_of_all_books_does_not_jump_when_walls_go(new: Any) -> None:
    """Energy is what the written force did to the device, at every tick, whichever walls there are."""
    rig = Rig(wall(2000.0), at_m=0.0)
    for count in range(300):
        if count in (55, 70):
            rig.switch(new if count == 55 else scene(wall(2000.0)))
        rig.force(-3e-3 * math.sin(0.05 * count))
        energy_j, stored_j, dissipated_j, generated_j = rig.books_j
        assert energy_j == pytest.approx(rig.energy_j, abs=1e-12)
        assert energy_j == pytest.approx(stored_j + dissipated_j - generated_j, abs=1e-12)
    assert not rig.tick.leaving
    assert rig.tick.past.energy_j != 0.0


@examples(100)
@given(path=st.lists(st.tuples(DEEDS, st.integers(1, 15), MOVES), min_size=1, max_size=20))
def test_the_books_are_the_work_of_the_written_force_through_every_transition(
    path: list[tuple[str, int, float]],
) -> None:
    rig = pressed()
    position_m = -2e-3
    for deed, ticks, move_m in path:
        if deed in TRANSITIONS:
            TRANSITIONS[deed][0](rig)
        elif deed in ("arm", "clear"):
            (rig.tick.arm if deed == "arm" else rig.tick.guard.clear)()
        for _ in range(ticks):
            position_m = min(0.01, max(-0.01, position_m + move_m))
            generated_j = rig.books_j[3]
            rig.force(position_m)
            energy_j, stored_j, dissipated_j, now_generated_j = rig.books_j
            assert energy_j == pytest.approx(rig.energy_j, abs=1e-9)
            assert energy_j == pytest.approx(stored_j + dissipated_j - now_generated_j, abs=1e-7)
            assert now_generated_j >= generated_j * (1.0 - 1e-12)


def test_a_release_under_a_moving_hand_generates_nothing_that_the_hold_did_not() -> None:
    """A spring that fades: what it made is at most k/2 dx^2 at every step, since fading only ever takes."""
    rig = pressed()
    rig.tick.release()
    made_j = rig.books_j[3]
    for count in range(60):
        before_m = rig.tick.motion.position_m[0]
        rig.force(-2e-3 - 1e-3 * math.sin(0.3 * count))
        now_j = rig.books_j[3]
        assert now_j - made_j <= 0.5 * 2000.0 * (rig.tick.motion.position_m[0] - before_m) ** 2 + 1e-12
        made_j = now_j
    assert rig.books_j[1] == 0.0


def test_a_debt_is_carried_to_the_next_law_and_a_credit_is_not() -> None:
    told: list[Any] = []
    watching = running(law(returns(0.0), lambda _state, _params, snapshot: told.append(snapshot)))
    rig = pressed()
    rig.force(-4e-3)
    rig.switch(make_law=watching)
    assert rig.books_j[0] > 0.0
    assert told[-1].debt_j == 0.0
    rig = pressed()
    rig.force(-1e-3)
    rig.force(-1e-4)
    rig.switch(make_law=watching)
    assert told[-1].debt_j == pytest.approx(-rig.books_j[0])
    assert told[-1].debt_j > 0.0
    assert told[-1].applied_n == pytest.approx(0.2)
    assert told[-1].velocity_m_per_s == pytest.approx(0.9)
    assert told[-1].x_m == -1e-4


def test_the_damping_that_was_reached_is_told_to_the_next_law() -> None:
    def step(state: Any, _params: Any, tick: Any) -> float:
        state.damping_n_s_per_m = 31.0
        force_n: float = tick.contact_n
        return force_n

    told: list[Any] = []
    module = law(step, fields={"damping_n_s_per_m": float})
    module.__dict__["LEARNED"] = ("damping_n_s_per_m",)
    rig = pressed(module=module)
    rig.switch(make_law=running(law(returns(0.0), lambda _state, _params, snapshot: told.append(snapshot))))
    assert told[-1].damping_n_s_per_m == 31.0


def test_the_simulation_profile_lifts_the_limits_of_a_simulated_device() -> None:
    lifted = {"profile": "simulation", "max_force_n": 12.0}
    rig = Rig(wall(12000.0), at_m=0.0, simulated=True, max_force_n=math.inf, safety=lifted)
    assert rig.force(-0.05) == pytest.approx(600.0)
    with pytest.raises(ConfigError):
        Guard(SafetyConfig(profile="simulation"), device())


def test_a_debt_ends_with_the_contact_one_sample_after_the_last_force() -> None:
    rig = pressed(wall(2000.0))
    contact = rig.tick.contacts[0]
    while contact.ledger.debt_j == 0.0:  # a wall that is left sample by sample gives more than it took
        rig.force(-3e-3 if contact.x_m == -2e-3 else -2e-3)
    rig.force(0.01)
    assert contact.ledger.debt_j > 0.0
    rig.force(0.01)
    assert contact.ledger.debt_j == 0.0
    before = rig.books_j
    rig.force(0.05, ticks=20)
    assert rig.books_j == before
