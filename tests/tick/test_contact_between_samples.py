"""A device that is slower than the loop: a wall's force may change between two samples, and the device moves on."""

from __future__ import annotations

from typing import Any

import pytest

from hapticd.config.walls import WallConfig
from hapticd.tick.contact import Contact, RunningLaw
from hapticd.tick.scene import Wall
from tests.tick.rig import Rig, law, pushes, running, scene, wall

PERIOD_S = 1e-3
LIMIT_N = 12.0


def contact(shown: list[tuple[float, float]]) -> Contact:
    """A wall of 1 kN/m at 0 under a law that adds 1 N, and what that law is shown of what was applied."""

    def step(_state: Any, _params: Any, tick: Any) -> float:
        shown.append((tick.applied_n, tick.applied_contact_n))
        return float(tick.contact_n) + 1.0

    module = law(step)
    config = WallConfig.model_validate({"stiffness_n_per_m": 1000.0})
    made = Contact(Wall(config, 0, PERIOD_S), RunningLaw(module, module.Params()), 0.0)
    made.start(0.0)
    return made


def sample(made: Contact, x_m: float, periods: float = 1.0) -> None:
    """A tick with a new sample."""
    made.observe(x_m, 0.0, PERIOD_S)
    made.act(periods)
    made.settle(1.0, 1.0, LIMIT_N, PERIOD_S)


def repeat(made: Contact, gain: float, periods: float = 1.0) -> None:
    """A tick without one, by whose end a release has left so much."""
    made.hold(periods)
    made.settle(gain, gain, LIMIT_N, 0.0)


def test_each_force_counts_for_as_long_as_it_was_held() -> None:
    shown: list[tuple[float, float]] = []
    made = contact(shown)
    sample(made, -3e-3)
    sample(made, -3e-3)
    before_j = made.ledger.energy_j, made.ledger.dissipated_j
    repeat(made, 0.5, periods=3.0)  # until then 4 N, of which 3 N are the wall's
    repeat(made, 0.25, periods=2.0)  # 2 N
    sample(made, -5e-3, periods=1.0)  # 1 N
    mean_n = (3.0 * 4.0 + 2.0 * 2.0 + 1.0 * 1.0) / 6.0
    assert shown[-2:] == [pytest.approx((4.0, 3.0)), pytest.approx((mean_n, 0.75 * mean_n))]
    assert made.ledger.energy_j - before_j[0] == pytest.approx(2e-3 * mean_n)
    assert made.ledger.dissipated_j - before_j[1] == pytest.approx(2e-3 * 0.25 * mean_n)
    sample(made, -4e-3)
    assert shown[-1] == pytest.approx((6.0, 5.0)), "and what waited is over with the sample"
    assert made.ledger.energy_j - before_j[0] == pytest.approx(2e-3 * mean_n - 1e-3 * 6.0)


def test_what_was_held_before_a_contact_was_begun_anew_counts_no_more() -> None:
    shown: list[tuple[float, float]] = []
    made = contact(shown)
    sample(made, -3e-3)
    repeat(made, 0.5)
    made.start(-1e-3)
    before_j = made.ledger.energy_j
    sample(made, -2e-3)
    assert shown[-1] == (0.0, 0.0)
    assert made.ledger.energy_j == before_j


def test_in_ticks_in_which_no_time_passes_what_was_applied_last_counts() -> None:
    shown: list[tuple[float, float]] = []
    made = contact(shown)
    sample(made, -3e-3)
    repeat(made, 0.5, periods=0.0)
    sample(made, -3e-3, periods=0.0)
    assert shown[-1] == pytest.approx((2.0, 1.5))


def test_a_clock_that_leaps_makes_no_mean_that_is_no_number() -> None:
    shown: list[tuple[float, float]] = []
    made = contact(shown)
    sample(made, -3e-3)
    repeat(made, 0.5, periods=1.7e308)
    repeat(made, 0.5, periods=1.7e308)
    sample(made, -3e-3, periods=1.7e308)
    assert shown[-1] == pytest.approx(((4.0 + 2.0 + 2.0) / 3.0, (3.0 + 1.5 + 1.5) / 3.0))


def press_and_let_go(rig: Rig, gap: int, at_ms: dict[int, Any]) -> float:
    """Press into the wall and on, with a sample each `gap` ticks, while this happens; the work that went in [J]."""
    went_in_j = 0.0
    rig.force(0.0)
    for n in range(1, 401):
        went_in_j -= rig.tick.force_n[0] * -2e-5
        if n in at_ms:
            at_ms[n](rig)
        if n % gap == 0:
            rig.sample.position_m[0] = -2e-5 * n
            rig.sample.time_ns += gap * 1_000_000
        rig.tick.advance(rig.sample, PERIOD_S)
    return went_in_j


@pytest.mark.parametrize("gap", [1, 4, 10, 20])
@pytest.mark.parametrize(
    "at_ms",
    [
        {103: lambda rig: rig.tick.release()},
        {103: lambda rig: rig.tick.release(), 174: lambda rig: rig.tick.arm()},
        {103: lambda rig: rig.switch(scene(wall(300.0)))},
        {103: lambda rig: rig.switch(scene())},
        {103: lambda rig: rig.switch(make_law=running(pushes(5.0)))},
    ],
    ids=["a release", "an arming", "a softer wall", "no wall", "another law"],
)
def test_the_books_have_what_a_force_took_while_a_ramp_changed_it(gap: int, at_ms: dict[int, Any]) -> None:
    rig = Rig(wall(1000.0), at_m=0.0, has_clock=True, nominal_rate_hz=1000.0 / gap)
    went_in_j = press_and_let_go(rig, gap, at_ms)
    energy_j, stored_j, dissipated_j, generated_j = rig.books_j
    assert went_in_j > 1e-3
    assert energy_j == pytest.approx(went_in_j, rel=1e-9)
    assert energy_j == pytest.approx(stored_j + dissipated_j - generated_j, rel=1e-9)
    assert rig.tick.fault == 0


def test_the_fallback_of_a_law_that_fails_begins_where_the_force_is_and_not_at_its_mean() -> None:
    def step(_state: Any, _params: Any, tick: Any) -> float:
        if tick.x_m < -2.5e-3:
            raise ValueError
        return float(tick.contact_n)

    rig = Rig(wall(2000.0), module=law(step), at_m=0.0, has_clock=True, nominal_rate_hz=100.0)
    rig.force(-2e-3, ticks=2)
    rig.tick.release()
    for _ in range(9):
        (held_n,) = rig.tick.advance(rig.sample, PERIOD_S)
    rig.sample.position_m[0] = -3e-3
    rig.sample.time_ns += 10_000_000
    (begun_n,) = rig.tick.advance(rig.sample, PERIOD_S)
    assert rig.tick.fallback
    assert held_n == pytest.approx(4.0 * 41.0 / 50.0)
    assert begun_n == pytest.approx(4.0 * 40.0 / 50.0)
