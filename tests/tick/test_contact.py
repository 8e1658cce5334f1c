"""One wall under one law: what the law is shown, and what of its answer counts."""

from __future__ import annotations

import math
from typing import Any

import pytest

from hapticd.config.walls import WallConfig
from hapticd.law import LawParams
from hapticd.tick.contact import Contact, RunningLaw
from hapticd.tick.scene import Wall
from hapticd_controllers import virtual_coupling
from tests.tick.rig import law

PERIOD_S = 1e-3


def contact(step: Any, fields: dict[str, type] | None = None, **keys: Any) -> Contact:
    config = WallConfig.model_validate({"stiffness_n_per_m": 1000.0, "position_m": 0.01, **keys})
    module = law(step, fields=fields)
    made = Contact(Wall(config, 0, PERIOD_S), RunningLaw(module, module.Params()), 1e-5)
    made.start(0.02)
    return made


def tick(
    made: Contact, position_m: float, velocity_m_per_s: float = 0.0, share: float = 1.0, gain: float = 1.0
) -> float:
    made.wall.pass_time(1.0)
    made.observe(made.wall.outward * (position_m - made.wall.position_m), velocity_m_per_s, PERIOD_S)
    made.act(1.0)
    made.settle(share, gain, 12.0, PERIOD_S)
    return made.applied_n


def own(_state: Any, _params: Any, shown: Any) -> Any:
    return shown.contact_n


@pytest.mark.parametrize(("free_side", "outward"), [("positive", 1.0), ("negative", -1.0)])
def test_a_law_sees_its_wall_from_the_outside_whichever_side_is_free(free_side: str, outward: float) -> None:
    """Inside is x < 0, a positive velocity leaves, a positive force pushes out."""
    seen: list[tuple[float, ...]] = []

    def step(_state: Any, _params: Any, shown: Any) -> float:
        forces = shown.contact_n, shown.spring_n
        seen.append((shown.x_m, shown.moved_m, shown.velocity_m_per_s, *forces, shown.dt_s, shown.resolution_m))
        force_n: float = shown.contact_n
        return force_n

    made = contact(step, free_side=free_side, damping_n_s_per_m=10.0)
    made.start(0.01 + outward * 0.001)
    tick(made, 0.01 - outward * 0.002, -outward * 0.3)
    assert seen[0] == pytest.approx((-0.002, -0.003, -0.3, 2.0 + 3.0, 2.0, PERIOD_S, 1e-5))
    assert made.in_contact
    tick(made, 0.01 + outward * 0.001, outward * 0.3)
    assert seen[1] == pytest.approx((0.001, 0.003, 0.3, 0.0, 0.0, PERIOD_S, 1e-5))


def test_a_law_sees_the_force_that_was_applied_and_which_part_of_it_was_the_walls_own() -> None:
    seen: list[tuple[float, float]] = []

    def step(_state: Any, _params: Any, shown: Any) -> float:
        seen.append((shown.applied_n, shown.applied_contact_n))
        force_n: float = shown.contact_n + 6.0
        return force_n

    made = contact(step)
    for share in (0.5, 0.25, 1.0):
        tick(made, 0.008, share=share)
    assert seen == [(0.0, 0.0), pytest.approx((4.0, 1.0)), pytest.approx((2.0, 0.5))]


def test_during_a_blend_what_is_not_the_laws_own_part_counts_as_the_walls() -> None:
    """A law that reckons with what the wall gave must not be told that a ramp of zero was the whole wall."""
    made = contact(lambda _state, _params, shown: shown.contact_n + 6.0)
    made.start(0.008)
    made.blend(4, 1.0, 12.0)
    for count in range(6):
        applied_n = tick(made, 0.008)
        assert applied_n == pytest.approx(8.0 * min(1.0, count / 4.0))
        assert made.tick.applied_contact_n == pytest.approx(applied_n - 6.0)


def test_outside_a_wall_nothing_is_sent_whatever_the_law_says_but_it_sees_the_tick() -> None:
    seen: list[bool] = []

    def step(_state: Any, _params: Any, shown: Any) -> float:
        seen.append(shown.in_contact)
        return 5.0

    made = contact(step)
    assert [tick(made, position_m) for position_m in (0.02, 0.009, 0.01, 0.02)] == [0.0, 5.0, 0.0, 0.0]
    assert seen == [False, True, False, False]


def test_even_nonsense_outside_is_no_force() -> None:
    made = contact(lambda _state, _params, _shown: None)
    assert tick(made, 0.02) == 0.0


@pytest.mark.parametrize(
    ("answer", "error"),
    [(None, TypeError), ("5", TypeError), (1j, TypeError), (math.nan, ArithmeticError), (1e300, ArithmeticError)],
)
def test_nonsense_inside_is_an_error(answer: Any, error: type[Exception]) -> None:
    made = contact(lambda _state, _params, _shown: answer)
    made.observe(-0.001, 0.0, PERIOD_S)
    with pytest.raises(error):
        made.act(1.0)


def test_a_law_publishes_damping_and_mass_if_it_has_them() -> None:
    def step(state: Any, _params: Any, shown: Any) -> Any:
        state.damping_n_s_per_m += 2.5
        state.felt_mass_kg = 0.3
        return shown.contact_n

    made = contact(step, {"damping_n_s_per_m": float, "felt_mass_kg": float})
    tick(made, 0.02)
    assert (made.damping_n_s_per_m, made.felt_mass_kg) == (2.5, 0.3)
    plain = contact(own)
    tick(plain, 0.009)
    assert (plain.damping_n_s_per_m, plain.felt_mass_kg) == (0.0, 0.0)


def test_a_new_law_is_shown_the_contact_as_it_is_not_as_the_old_one_left_it() -> None:
    def step(_state: Any, _params: Any, shown: Any) -> float:
        force_n: float = shown.contact_n
        shown.x_m = shown.applied_n = shown.spring_n = shown.resolution_m = math.nan
        return force_n

    made = contact(step, damping_n_s_per_m=10.0)
    tick(made, 0.008, 0.1)
    module = law(own)
    made.take_law(RunningLaw(module, module.Params()), 0.1, PERIOD_S)
    shown = made.tick
    assert (shown.x_m, shown.applied_n, shown.applied_contact_n, shown.resolution_m) == pytest.approx(
        (-0.002, 1, 1, 1e-5)
    )
    assert (shown.velocity_m_per_s, shown.dt_s, shown.in_contact) == (0.1, PERIOD_S, True)
    assert (shown.contact_n, shown.spring_n, shown.moved_m) == pytest.approx((1.0, 2.0, -0.012))


def test_a_change_of_the_wall_comes_at_its_tick() -> None:
    made = contact(own, changes=[{"at_s": 0.002, "stiffness_n_per_m": 3000.0}])
    assert [tick(made, 0.009) for _ in range(4)] == pytest.approx([1.0, 1.0, 3.0, 3.0])


def test_the_books_hold_the_spring_that_is_left_of_a_release() -> None:
    made = contact(own)
    tick(made, 0.008)
    assert made.ledger.stored_j == pytest.approx(0.5 * 1000.0 * 0.002**2)
    tick(made, 0.008, share=0.25, gain=0.25)
    assert made.ledger.stored_j == pytest.approx(0.25 * 0.5 * 1000.0 * 0.002**2)
    tick(made, 0.008, share=0.0, gain=0.0)
    assert made.ledger.stored_j == 0.0
    assert made.ledger.dissipated_j == pytest.approx(0.5 * 1000.0 * 0.002**2)


def test_a_limit_that_a_damper_shares_with_the_spring_takes_nothing_from_the_spring() -> None:
    """Pressed fast, spring and damper ask for more than the limit: what is cut is the damper's."""
    made = contact(own, damping_n_s_per_m=20.0)
    position_m = 0.01
    for _ in range(10):
        position_m -= 1e-3
        made.observe(position_m - 0.01, -1.0, PERIOD_S)
        made.act(1.0)
        made.settle(min(1.0, 12.0 / made.force_n), 1.0, 12.0, PERIOD_S)
    assert made.applied_n == 12.0
    assert made.ledger.generated_j == pytest.approx(10 * 0.5 * 1000.0 * 1e-3**2)


class Two(LawParams):
    """A number and a switch."""

    gain: float = 2.0
    on: bool = True


def test_parameters_arrive_as_plain_numbers() -> None:
    module = law(lambda _state, params, _shown: params.gain if params.on else 0.0)
    module.__dict__["Params"] = Two
    running = RunningLaw(module, Two(gain=3.0))
    assert running.step(running.state, running.params, None) == 3.0
    assert not isinstance(running.params, LawParams)


def test_a_law_that_is_made_once_more_has_nothing_that_the_first_one_changes() -> None:
    """Couplings have one an axis."""
    first = RunningLaw(virtual_coupling, virtual_coupling.Params())
    twin = first.another()
    for one in (first.state, first.params):
        for name in type(one).__slots__:
            setattr(one, name, 7)
    fresh = RunningLaw(virtual_coupling, virtual_coupling.Params())
    for same, one in ((fresh.state, twin.state), (fresh.params, twin.params)):
        assert repr(one) == repr(same)
    assert twin.rests is fresh.rests is False
