"""What docs/controllers.md says that the ring-damping law makes of each swing, with its numbers, swing by swing."""

from __future__ import annotations

import math
from copy import copy
from itertools import pairwise
from typing import Any

import pytest

from hapticd.law import LawSnapshot, LawTick, fresh_state, plain_object, scalar_params
from hapticd_controllers import ring_damping
from hapticd_controllers.ring_damping import Params

DT_S = 1e-3
WALL_N_PER_M = 4e3
LEAK = 0.5 * WALL_N_PER_M * DT_S
OWN_MS = 20
"""Half a period that no hand has."""
MASS_KG = WALL_N_PER_M * (OWN_MS * DT_S / math.pi) ** 2
"""What swings so in this wall."""
LARGE_M = 2e-4
"""Many counts of the device."""


class Shown:
    """A law that is shown where a device is; what it does to that device is no matter.

    It takes over at `x_m`, on the way out where that is said; else on the way in, so that a turn is seen at once.
    """

    def __init__(
        self,
        params: Params | None = None,
        before_n_s_per_m: float = 0.0,
        resolution_m: float = 1e-6,
        *,
        x_m: float = -1e-3,
        outward: bool = False,
    ) -> None:
        self.params: Any = plain_object("Params", scalar_params(params or Params()))
        self.state: Any = fresh_state(ring_damping)
        self.tick = LawTick(resolution_m)
        self.tick.dt_s, self.tick.x_m = DT_S, x_m
        self.stiffness_n_per_m = WALL_N_PER_M
        self._outward = False
        taken = LawSnapshot(x_m=x_m, velocity_m_per_s=float(outward), damping_n_s_per_m=before_n_s_per_m)
        ring_damping.start(self.state, self.params, taken)

    def go(self, *x_m: float) -> float:
        """Be at each of these places for a tick; the force of the last [N]."""
        tick = self.tick
        for at_m in x_m:
            tick.moved_m, tick.x_m, tick.in_contact = at_m - tick.x_m, at_m, at_m < 0.0
            tick.velocity_m_per_s = tick.moved_m / tick.dt_s
            tick.spring_n = tick.contact_n = max(0.0, -self.stiffness_n_per_m * at_m)
            force_n: float = ring_damping.step(self.state, self.params, tick)
            tick.applied_contact_n = tick.contact_n
        return force_n

    def rest(self, ticks: int) -> None:
        self.go(*[self.tick.x_m] * ticks)

    def swing(self, times: int, half_ms: int = OWN_MS, length_m: float = LARGE_M, shrinks: float = 1.0) -> list[Any]:
        """From turn to turn as on a spring; the state when each is noticed, while the next one goes on."""
        found = []
        for _ in range(times):
            self._outward = not self._outward
            from_m, way_m = self.tick.x_m, length_m if self._outward else -length_m
            before = self.state.outward
            for at in range(1, half_ms + 1):
                to_m = from_m + 0.5 * way_m * (1.0 - math.cos(math.pi * at / half_ms))
                self.go(round(to_m / self.tick.resolution_m) * self.tick.resolution_m)
                if self.state.outward != before:
                    before = self.state.outward
                    found.append(copy(self.state))
            length_m *= shrinks
        return found


# Brake


def test_the_brake_rises_fourfold_with_each_stubborn_swing_then_waits_for_two_and_is_halved_until_it_begins_anew() -> (
    None
):
    shown = Shown(Params(brake_ratio=0.5, least_brake_ratio=1 / 128))
    shown.state.first_brake = 1 / 128
    rises, falls = [1 / 32, 1 / 8, 1 / 2], [1 / 2, 1 / 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32, 1 / 64, 1 / 128]
    assert [swing.brake for swing in shown.swing(26)] == [0.0, 1 / 128, *rises, *falls, *rises, *falls, 1 / 32, 1 / 8]


def test_a_brake_that_begins_between_the_steps_is_the_full_one_at_most() -> None:
    shown = Shown(Params(brake_ratio=0.5))
    shown.state.first_brake = 0.05
    assert [swing.brake for swing in shown.swing(5)] == pytest.approx([0.0, 0.05, 0.2, 0.5, 0.5])


@pytest.mark.parametrize(("stubborn", "share"), [(0, 0.7), (1, 1.0), (3, 1.0), (4, 8.0), (5, 8.0)])
def test_the_first_brake_falls_after_a_ring_that_dies_away_and_rises_after_four_stubborn_swings(
    stubborn: int, share: float
) -> None:
    shown = Shown(outward=True)
    shown.state.first_brake = first = 1 / 64
    swings = shown.swing(2 + stubborn) + shown.swing(3, length_m=0.5 * LARGE_M, shrinks=0.5)
    assert max(swing.stubborn for swing in swings) == stubborn
    shown.rest(100)
    assert (shown.state.brake, shown.state.swings, shown.state.stubborn) == (0.0, 0.0, 0.0)
    assert shown.state.first_brake == pytest.approx(share * first)


def test_the_first_brake_stays_between_its_least_and_the_full_one() -> None:
    for first, stubborn, after in ((0.021, 0, 0.02), (0.1, 5, 0.7), (0.02, 0, 0.02)):
        shown = Shown(Params(brake_ratio=0.7, least_brake_ratio=0.02), outward=True)
        shown.state.first_brake = first
        shown.swing(2 + stubborn)
        shown.swing(3, length_m=0.5 * LARGE_M, shrinks=0.5)
        shown.rest(100)
        assert shown.state.first_brake == pytest.approx(after)


def test_two_half_periods_without_a_turn_are_silence() -> None:
    shown = Shown()
    shown.swing(6)
    assert shown.state.brake > 0.0
    last_s = shown.state.last_s
    while shown.state.brake > 0.0 and shown.state.swing_s < 1.0:
        before_s = shown.state.swing_s
        shown.rest(1)
    assert before_s <= 2.0 * last_s < before_s + DT_S


@pytest.mark.parametrize("ratio", [0.99, 1.0, 1.5])
def test_silence_ends_a_critical_brake_as_any_other(ratio: float) -> None:
    """A swing under it counted as 0 s long, and silence is told by the last swing: it never came."""
    shown = Shown(Params(brake_ratio=ratio))
    assert shown.swing(3)[-1].brake == pytest.approx(ratio)
    shown.rest(5000)
    assert shown.state.brake == 0.0


@pytest.mark.parametrize(("counts", "brakes"), [(3, False), (4, True)])
def test_a_swing_below_two_turn_thresholds_is_not_braked(counts: int, brakes: bool) -> None:
    """A threshold is 1.6 counts."""
    swings = Shown(resolution_m=1e-5).swing(12, 40, counts * 1e-5)
    assert any(swing.brake > 0.0 for swing in swings) == brakes


@pytest.mark.parametrize(("share", "stubborn"), [(0.94, 0.0), (0.96, 6.0)])
def test_what_is_less_than_nineteen_twentieths_of_the_swing_before_the_last_dies_away(
    share: float, stubborn: float
) -> None:
    shown = Shown(Params(brake_ratio=0.1), resolution_m=1e-8, outward=True)
    assert shown.swing(9, shrinks=share**0.5)[-1].stubborn == stubborn


@pytest.mark.parametrize("full_brake", [0.7, 0.002, 0.001, 0.0])
@pytest.mark.parametrize(("after", "pulls"), [(3, False), (4, True)])
def test_damping_pulls_after_four_stubborn_swings_of_a_ring(after: int, pulls: bool, full_brake: float) -> None:
    """Of a brake that cannot be halved, since 0.002 is the least of it, too."""
    shown = Shown(Params(brake_ratio=full_brake))
    shown.swing(2 + after)
    assert shown.state.stubborn == after
    shown.rest(1)
    assert (shown.go(-1e-6) < 0.0) == pulls


def test_brake_and_base_come_to_half_of_mass_over_period_and_the_base_alone_to_nine_twentieths() -> None:
    heaviest = Shown(Params(brake_ratio=0.9)).swing(3, 6)[-1]
    assert heaviest.damping_n_s_per_m == pytest.approx(0.5 * heaviest.felt_mass_kg / DT_S)
    shown = Shown(Params(brake_ratio=0.0, least_brake_ratio=0.0))
    last = shown.swing(45)[-1]
    assert last.base_n_s_per_m == pytest.approx(0.45 * last.felt_mass_kg / DT_S)
    assert last.damping_n_s_per_m == last.base_n_s_per_m
    assert last.leaks <= 1000.0, "so that what is known of it is a number for ever"


def test_a_brake_is_twice_its_ratio_of_the_root_of_stiffness_and_mass() -> None:
    shown = Shown()
    shown.state.first_brake = 0.05
    last = shown.swing(2)[-1]
    assert last.damping_n_s_per_m - last.base_n_s_per_m == pytest.approx(
        2.0 * 0.05 * math.sqrt(WALL_N_PER_M * last.felt_mass_kg)
    )


# Base


def test_from_the_seventh_swing_on_two_large_ones_say_that_more_base_is_due_and_each_adds_three_tenths() -> None:
    leaks = [swing.leaks for swing in Shown(Params(brake_ratio=0.0)).swing(14)]
    assert leaks == pytest.approx([1.0] * 7 + [1.3**more for more in range(1, len(leaks) - 6)])


def test_of_swings_of_two_counts_four_say_it() -> None:
    leaks = [swing.leaks for swing in Shown(resolution_m=1e-5).swing(14, 40, 2e-5)]
    assert leaks == pytest.approx([1.0] * 9 + [1.3**more for more in range(1, len(leaks) - 8)])


@pytest.mark.parametrize("away", [False, True])
def test_where_the_wall_has_softened_or_the_device_was_away_six_swings_say_nothing_again(away: bool) -> None:
    shown = Shown(Params(brake_ratio=0.0), outward=True)
    shown.swing(10)
    if away:
        shown.go(*[1e-6] * 200, -1e-3)
    else:
        shown.stiffness_n_per_m = 0.4 * WALL_N_PER_M
        shown.rest(1)
    before, own = shown.state.leaks, 0
    while shown.state.leaks == before and own < 20:
        own += len(shown.swing(1))
    assert own == 7


def test_of_the_swings_of_a_ring_that_the_surface_cuts_the_first_two_say_nothing_and_the_third_does() -> None:
    shown = Shown(Params(brake_ratio=0.0), outward=True)
    shown.swing(10)
    shown.rest(100)
    shown.go(*(shown.tick.x_m * (1.0 - 0.1 * at) for at in range(1, 11)))
    assert shown.state.swings == 0.0
    said = [shown.state.steady]
    for _ in range(2):  # in and out, a swing each
        shown.go(*(-1e-3 * math.sin(math.pi * at / 16) for at in range(1, 16)), *[0.0] * 10)
        said.append(shown.state.steady)
    assert [after - said[0] for after in said] == [0.0, 0.0, 2.0]


def test_there_is_one_leak_from_the_first_contact_on_whatever_the_wall_is_then() -> None:
    shown = Shown()
    shown.stiffness_n_per_m = 0.0
    shown.rest(1)
    assert shown.state.leaks == 1.0


def test_a_swing_that_shrinks_halves_what_the_others_have_said() -> None:
    shown = Shown(Params(brake_ratio=0.0))
    before = shown.swing(12)[-1]
    after = shown.swing(2, length_m=0.5 * LARGE_M)[-1]
    assert (after.steady, after.leaks) == pytest.approx((0.5 * (before.steady + 1.0), before.leaks * 1.3))


def test_each_swing_of_a_hand_takes_a_tenth_of_the_base_and_its_brake() -> None:
    shown = Shown(before_n_s_per_m=4.0 * LEAK, outward=True)
    swings = shown.swing(5, 60)
    assert [swing.leaks for swing in swings] == pytest.approx([4.0 * 0.9**taken for taken in range(1, len(swings) + 1)])
    assert {swing.brake for swing in swings} == {0.0}


def test_what_a_hand_has_slowed_down_has_one_leak_at_least() -> None:
    shown = Shown(before_n_s_per_m=1.05 * LEAK)
    assert shown.swing(3, 60)[-1].leaks == 1.0


@pytest.mark.parametrize(("stiffness_n_per_m", "share"), [(2e3, 1.0), (1.9e3, 0.5)])
def test_a_wall_that_softens_to_less_than_half_takes_half_of_the_leaks(stiffness_n_per_m: float, share: float) -> None:
    shown = Shown(before_n_s_per_m=4.0 * LEAK)
    shown.rest(5)
    shown.stiffness_n_per_m = stiffness_n_per_m
    shown.rest(1)
    assert shown.state.leaks == pytest.approx(4.0 * share)


def test_a_device_that_has_been_away_for_ninety_milliseconds_takes_half_of_the_leaks() -> None:
    shown = Shown(before_n_s_per_m=4.0 * LEAK)
    shown.go(*(1e-3 * (0.05 * at - 1.0) for at in range(21)))
    assert shown.tick.x_m >= 0.0
    away = 1
    while shown.state.leaks == 4.0 and away < 500:
        shown.rest(1)
        away += 1
    assert away in (91, 92)
    assert shown.state.leaks == 2.0
    shown.rest(300)
    assert shown.state.leaks == 2.0, "once each time"


# Whose swing it is, and of what mass


def test_the_mass_is_that_of_the_half_period_and_what_the_damping_hides_of_it() -> None:
    first, *_ = (swing for swing in Shown().swing(3) if swing.felt_mass_kg > 0.0)
    assert first.felt_mass_kg == pytest.approx(MASS_KG + LEAK * DT_S)


def test_where_no_force_was_given_a_swing_tells_no_mass() -> None:
    shown = Shown(Params(brake_ratio=0.0), outward=True)
    before = shown.swing(4)[-1].felt_mass_kg
    shown.stiffness_n_per_m = 0.0
    shown.swing(1)
    known = shown.state.felt_mass_kg
    assert known == pytest.approx(before, rel=0.05)
    shown.swing(4)
    assert shown.state.felt_mass_kg == known


def test_a_braked_swing_takes_longer_than_a_free_one_and_counts_as_that() -> None:
    shown = Shown(Params(brake_ratio=0.5))
    for _ in range(4):
        before = shown.state.brake
        shown.swing(1)
    assert before == 0.5
    assert shown.state.last_s == pytest.approx(OWN_MS * DT_S * math.sqrt(1.0 - 0.5**2))


@pytest.mark.parametrize(("back_m", "turns"), [(2.9e-5, False), (3.5e-5, True)])
def test_a_way_back_within_three_mean_changes_of_the_move_is_no_turn(back_m: float, turns: bool) -> None:
    shown = Shown()
    shown.go(*(-1e-3 - 1e-6 * at for at in range(20)))
    shown.state.noise_m = 1e-5
    shown.go(shown.tick.x_m + back_m)
    assert shown.state.outward == turns


def test_the_mean_change_of_the_move_takes_a_fiftieth_of_each() -> None:
    shown = Shown()
    for at in range(1, 20):
        shown.go(-1e-3 + 1e-6 * (at % 2))
        change_m = 2e-6 if at > 1 else 1e-6
        assert shown.state.noise_m > 0.0
        before_m = shown.state.noise_m
    shown.go(-1e-3)
    assert shown.state.noise_m - before_m == pytest.approx(0.02 * (change_m - before_m))


def test_of_a_swing_that_the_surface_cuts_ten_sevenths_are_taken_and_of_a_bounce_without_a_turn_half_of_that() -> None:
    shown = Shown(x_m=0.0)
    shown.go(*[-1e-6] * 11)
    shown.go(1e-6)
    assert shown.state.last_s == pytest.approx(0.5 * 1.43 * 11 * DT_S)
    shown = Shown(outward=True)
    shown.go(*(-1e-3 + 1e-4 * at for at in range(11)))
    assert shown.state.last_s == pytest.approx(1.43 * 11 * DT_S)


def test_a_device_that_bounces_four_times_without_a_pause_counts_however_slowly() -> None:
    """In and out of the wall are a swing each, and the fifth is its own."""
    shown = Shown(x_m=0.0)
    felt = []
    for _ in range(4):
        shown.go(*(-1e-3 * math.sin(math.pi * at / 80) for at in range(1, 80)), *[0.0] * 50)
        felt.append(shown.state.felt_mass_kg > 0.0)
    assert felt == [False, False, True, True]


def test_the_mass_of_a_few_counts_near_the_surface_is_that_of_any_swing() -> None:
    shown = Shown(Params(brake_ratio=0.0, least_brake_ratio=0.0), resolution_m=1e-5, x_m=-8e-5)
    shown.state.felt_mass_kg = MASS_KG
    assert [swing.felt_mass_kg for swing in shown.swing(8, length_m=7e-5)] == pytest.approx([MASS_KG] * 8, rel=0.1)


def test_a_swing_turned_by_a_surface_that_slips_as_far_as_the_spring_is_long_tells_no_mass() -> None:
    shown = Shown()
    shown.go(-1.1e-3)
    shown.tick.x_m = 0.0
    shown.go(-5e-4)
    assert (shown.state.outward, shown.state.felt_mass_kg) == (True, 0.0)


def test_another_mass_is_learned_by_three_tenths_of_the_way_and_by_no_more_than_twice_as_much_at_once() -> None:
    for half_ms, seen in ((24, (24 / OWN_MS) ** 2), (31, 2.0)):
        shown = Shown(Params(brake_ratio=0.0))
        before = shown.swing(4)[-1].felt_mass_kg
        shown.swing(1, half_ms)
        after = shown.swing(1, half_ms)[-1].felt_mass_kg
        assert after == pytest.approx(before + 0.3 * (seen * MASS_KG - before), rel=0.01)


@pytest.mark.parametrize(("half_ms", "own"), [(31, True), (33, False)])
def test_what_would_need_more_than_two_and_a_half_times_the_mass_is_driven_from_outside(
    half_ms: int, own: bool
) -> None:
    """And the mass that is known grows by a twentieth, until it explains such a swing."""
    shown = Shown(Params(brake_ratio=0.0))
    before = shown.swing(4)[-1].felt_mass_kg
    shown.swing(1, half_ms)
    after = shown.swing(1, half_ms)[-1].felt_mass_kg
    assert (after == pytest.approx(1.05 * before, rel=0.005)) == (not own)
    assert after > 1.04 * before


@pytest.mark.parametrize(("half_ms", "brakes"), [(44, True), (46, False)])
def test_what_takes_more_than_forty_five_milliseconds_may_be_a_hand(half_ms: int, brakes: bool) -> None:
    assert any(swing.brake > 0.0 for swing in Shown().swing(4, half_ms)) == brakes


# Arrival


def test_an_arrival_is_braked_by_its_time_and_by_the_mean_speed_of_the_last_eighth_of_it() -> None:
    params, shown, slow_m = Params(), Shown(x_m=0.0), 2e-6
    mean_m_per_s = 0.0
    for ago in range(120):  # ticks since the touch
        moved_m = 3.0 * slow_m if ago == 32 else slow_m
        force_n = shown.go(shown.tick.x_m - moved_m)
        brake = 4.0 / math.pi * params.brake_ratio * WALL_N_PER_M * max(0, min(ago, 90 - ago)) * DT_S
        assert shown.state.damping_n_s_per_m == pytest.approx(LEAK + brake)
        mean_m_per_s += 8.0 / max(8, ago) * (-moved_m / DT_S - mean_m_per_s)
        wanted_n = -WALL_N_PER_M * shown.tick.x_m + LEAK * moved_m / DT_S - brake * mean_m_per_s
        assert force_n == pytest.approx(wanted_n)


@pytest.mark.parametrize("speed_m_per_s", [0.002, 0.015, 0.1])
def test_a_hand_that_goes_on_pressing_feels_no_step_as_the_brake_lets_go(speed_m_per_s: float) -> None:
    """At 15 mm/s into 2 kN/m the force fell from 2.5 to 1.4 N in the tick 45 ms after the touch."""
    shown, way_m = Shown(x_m=0.0), speed_m_per_s * DT_S
    forces_n = [shown.go(-way_m * (tick + 1)) for tick in range(150)]
    steps_n = [after - before for before, after in pairwise(forces_n)]
    assert min(steps_n) > 0.0
    assert max(steps_n) < 2.0 * WALL_N_PER_M * way_m


def test_an_arrival_where_the_mass_is_known_meets_its_full_brake_at_most() -> None:
    shown = Shown()
    shown.swing(3)
    shown.go(0.0)
    shown.rest(200)  # away for long enough: what comes then is another arrival
    shown.state.first_brake = 0.7
    full = 2.0 * 0.7 * math.sqrt(WALL_N_PER_M * shown.state.felt_mass_kg)
    dampings = []
    for at in range(1, 40):
        shown.go(-2e-6 * at)
        dampings.append(shown.state.damping_n_s_per_m - shown.state.base_n_s_per_m)
    assert max(dampings) == pytest.approx(full)
    assert dampings[0] < 0.2 * full
