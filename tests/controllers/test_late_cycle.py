"""`late-cycle`: what the law of ports knows beforehand, learns, forgets, and holds."""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from typing import Any

import pytest

from hapticd.law import LawSnapshot, LawTick, fresh_state, plain_object, scalar_params
from hapticd_controllers import late_cycle, none
from hapticd_controllers.late_cycle import Params

DT_S = 1e-3


class Port:
    """A law on one axis of a port, and the tick that it is shown."""

    def __init__(self, law: Any = late_cycle, params: Any = None) -> None:
        self.law = law
        self.params = plain_object("Params", scalar_params(params or law.Params()))
        self.state = fresh_state(law)
        self.tick = LawTick(1e-5)
        law.start(self.state, self.params, LawSnapshot())

    def go(self, moved_m: float, port_n: float, stiffness_n_per_m: float = 0.0, x_m: float = -1e-15) -> float:
        """A sample later: how far it has moved, and the port's own force; the force of both."""
        tick = self.tick
        tick.moved_m, tick.velocity_m_per_s, tick.x_m = moved_m, moved_m / DT_S, x_m
        tick.in_contact = True
        tick.spring_n, tick.contact_n = -stiffness_n_per_m * x_m, port_n
        force_n: float = self.law.step(self.state, self.params, tick)
        tick.applied_n, tick.applied_contact_n = force_n, port_n
        return force_n

    def leave(self) -> None:
        """Be out of force for two samples."""
        self.tick.in_contact, self.tick.spring_n, self.tick.contact_n, self.tick.moved_m = False, 0.0, 0.0, 0.0
        for _ in range(2):
            assert self.law.step(self.state, self.params, self.tick) == 0.0
            self.tick.applied_n = self.tick.applied_contact_n = 0.0

    @property
    def damping(self) -> float:
        return float(self.state.damping_n_s_per_m)

    def swing(
        self, given_n_s_per_m: float, times: int = 1, stiffness_n_per_m: float = 0.0, half: int = 40
    ) -> list[float]:
        """Swings on a spring of 3 kN/m that gives as a negative damper of so much would; each damping that followed."""
        found = []
        x_m = 0.0
        for at in range(2 * half * times):
            way_m = -1e-4 if half <= 2 * (at % (2 * half)) < 3 * half else 1e-4
            x_m += way_m
            before = self.damping
            self.go(way_m, -3000.0 * x_m + given_n_s_per_m * way_m / DT_S, stiffness_n_per_m, x_m - 5e-6)
            if self.damping != before:
                found.append(self.damping)
        return found


def rests_m(law: Any, stiffness_n_per_m: float, late: int) -> float:
    """The last swing of a device of 0.3 kg and 5 N s/m on a spring whose force comes some ticks late [m]."""
    port = Port(law)
    heard = deque([0.0] * late, maxlen=late)
    x_m = v_m_per_s = 0.0
    path = []
    for _ in range(4000):
        before_m = x_m
        force_n = port.tick.applied_n
        for _ in range(10):
            v_m_per_s += (force_n - 3.0 - 5.0 * v_m_per_s) / 0.3 * DT_S / 10
            x_m += v_m_per_s * DT_S / 10
        port_n = max(-12.0, min(12.0, heard[0]))
        heard.append(-stiffness_n_per_m * x_m)
        port.go(x_m - before_m, port_n)
        path.append(x_m)
    return max(path[-300:]) - min(path[-300:])


def test_a_spring_is_damped_before_anything_has_swung_and_a_force_is_not() -> None:
    for stiffness_n_per_m, base in ((200.0, 3.0), (2000.0, 30.0), (8000.0, 50.0)):
        port = Port()
        port.go(0.0, 0.0, stiffness_n_per_m)
        assert port.damping == pytest.approx(base)
    port = Port()
    port.go(0.0, 3.0)
    assert port.damping == 0.0


GIVEN = 8.0 + 0.5 * 3000.0 * DT_S
"""What a swing that gives 8 N s/m has given, with k dt / 2 of its spring, which is sampled [N s/m]."""


def test_what_a_force_has_given_in_a_half_swing_is_added_to_the_damping_and_twice_from_the_second_on() -> None:
    port = Port()
    port.swing(8.0)
    port.swing(-12.0, times=2)
    assert port.state.again == 1.0, "the row has ended"
    port.swing(8.0)
    port.state.again = 1.0
    dampings = [port.damping, *port.swing(8.0, times=4)]
    added = [b - a for a, b in pairwise(dampings)]
    assert len(added) >= 5
    assert added[0] == pytest.approx(GIVEN, rel=0.25)
    assert added[1:] == [pytest.approx(2.0 * GIVEN, rel=0.25)] * (len(added) - 1)


def test_a_spring_lets_two_half_swings_pass_at_its_beginning_and_after_each_that_adds() -> None:
    port = Port()
    base = 0.015 * 300.0
    assert port.swing(8.0, stiffness_n_per_m=300.0, half=20) == [pytest.approx(base)]
    dampings = [base, *port.swing(8.0, times=8, stiffness_n_per_m=300.0, half=20)]
    added = [b - a for a, b in pairwise(dampings)]
    assert len(added) == 6  # of eighteen half swings
    assert added == [pytest.approx(GIVEN, rel=0.25)] * 6


def test_slow_swings_of_a_spring_add_no_more_than_its_base_may_have_and_quick_ones_do() -> None:
    """A body that swings slowly behind a late spring is left to swing by a device that is held faster."""
    slow, quick = Port(), Port()
    assert max(slow.swing(20.0, times=12, stiffness_n_per_m=300.0, half=40)) == Params().most_base_n_s_per_m
    assert max(quick.swing(20.0, times=12, stiffness_n_per_m=300.0, half=20)) > 1.5 * Params().most_base_n_s_per_m
    assert quick.swing(20.0, times=6, stiffness_n_per_m=300.0, half=40) == [], "and slow ones take nothing off"


def test_each_half_swing_that_gives_nothing_takes_off_a_twentieth_down_to_what_was_too_little() -> None:
    port = Port()
    port.swing(8.0, times=3)
    most = port.damping
    dampings = port.swing(-12.0, times=12)[1:]
    falls = [b / a for a, b in pairwise(dampings)]
    assert len(falls) >= 15
    assert falls[0] == pytest.approx(0.95)
    assert falls[-1] == pytest.approx(1.0 - 0.1 * 0.05)
    assert port.damping == port.state.floor_n_s_per_m > 0.5 * most
    kept = Port(params=Params(fall=0.0))
    kept.swing(8.0, times=3)
    assert kept.swing(-12.0, times=6)[2:] == []


def test_a_wall_so_late_that_it_only_pushes_along_is_damped_when_its_force_comes_to_nothing() -> None:
    """The energy only falls, so that no rise ever tells where a swing ends."""
    port = Port()
    for _ in range(3):
        for newton in [4.0] * 30 + [0.0] * 30:
            port.go(1e-4, newton)
    assert port.damping > 10.0


def test_damping_comes_in_ten_milliseconds() -> None:
    """A cycle that ends at 1 m/s would else be a jump of the force by all of it."""
    port = Port()
    port.go(0.0, 3.0)
    port.state.damping_n_s_per_m = port.state.floor_n_s_per_m = 100.0
    dampings = [(3.0 - port.go(1e-3, 3.0)) / port.state.velocity_m_per_s for _ in range(60)]
    assert max(b - a for a, b in pairwise([0.0, *dampings])) < 10.0
    assert dampings[9] == pytest.approx(63.0, abs=3.0)
    assert dampings[-1] > 99.0


def test_a_spring_that_comes_into_force_anew_begins_anew_and_a_force_goes_on() -> None:
    spring, force = Port(), Port()
    spring.swing(20.0, times=9, stiffness_n_per_m=300.0, half=20)
    force.swing(20.0, times=3)
    for port, stiffness_n_per_m in ((spring, 300.0), (force, 0.0)):
        assert port.damping > 50.0
        port.leave()
        port.go(0.0, 0.0, stiffness_n_per_m)
    assert spring.damping == pytest.approx(0.015 * 300.0)
    assert force.damping > 50.0


def test_one_count_of_the_position_kicks_by_half_of_what_it_would() -> None:
    port = Port()
    for _ in range(200):
        port.go(0.0, 0.0, 2000.0)
    assert port.go(1e-5, 0.0, 2000.0) == pytest.approx(-0.5 * 30.0 * 1e-2)


def rest_m(mass_kg: float, damping_n_s_per_m: float, stiffness_n_per_m: float, period_s: float, late: int = 0) -> float:
    """How far a device moves in the last 50 of 4 s, pushed with 1 N against a spring whose forces come samples late."""
    port = Port()
    tick = port.tick
    tick.dt_s, tick.in_contact = period_s, True
    x_m = v_m_per_s = 0.0
    path, asked_n = [], [0.0] * (1 + late)
    for _ in range(round(4.0 / period_s)):
        before_m = x_m
        for _ in range(50):
            pushed_n = asked_n[-1 - late] + 1.0 - damping_n_s_per_m * v_m_per_s
            v_m_per_s += pushed_n / mass_kg * period_s / 50
            x_m += v_m_per_s * period_s / 50
        path.append(x_m)
        tick.moved_m, tick.velocity_m_per_s, tick.x_m = x_m - before_m, (x_m - before_m) / period_s, x_m
        tick.spring_n = tick.contact_n = tick.applied_contact_n = -stiffness_n_per_m * x_m
        tick.applied_n = max(-6.0, min(6.0, late_cycle.step(port.state, port.params, tick)))
        asked_n.append(tick.applied_n)
    return max(path[-50:]) - min(path[-50:])


@pytest.mark.parametrize(("period_s", "stiffness_n_per_m"), [(0.01, 1500.0), (0.005, 4000.0)])
def test_a_velocity_of_slow_samples_is_smoothed_for_no_longer_than_one_of_quick_ones(
    period_s: float, stiffness_n_per_m: float
) -> None:
    assert rest_m(0.25, 4.4, stiffness_n_per_m, period_s) < 1e-5


@pytest.mark.parametrize(
    ("mass_kg", "stiffness_n_per_m", "late"), [(0.03, 2000.0, 1), (0.075, 3500.0, 1), (0.02, 4e3, 0)]
)
def test_the_base_of_a_spring_is_no_more_than_a_light_device_bears(
    mass_kg: float, stiffness_n_per_m: float, late: int
) -> None:
    """It shook from limit to limit."""
    assert rest_m(mass_kg, 0.3, stiffness_n_per_m, 1e-3, late) < 1e-4


def test_there_is_an_end_to_damping_whatever_mass_is_felt() -> None:
    port = Port()
    port.go(0.0, 0.0)
    port.state.felt_mass_kg = 50.0
    port.state.damping_n_s_per_m = 1e6
    port.go(0.0, 0.0)
    assert port.damping == 300.0


def test_a_damping_is_at_most_the_felt_mass_over_a_period_and_less_where_forces_come_late() -> None:
    """A sampled damper shakes by itself from twice that on, and from 0.83 times where forces come a sample late."""
    for late, most in ((0, 200.0), (1, 70.0)):
        port = Port()
        port.go(0.0, 0.0)
        port.state.felt_mass_kg, port.state.forces_late = 0.2, bool(late)
        port.state.damping_n_s_per_m = 1e6
        port.go(0.0, 0.0)
        assert port.damping == pytest.approx(most)


def test_damping_that_is_taken_over_is_in_force_at_once_and_after_silence_comes_anew() -> None:
    taken = Port()
    late_cycle.start(taken.state, taken.params, LawSnapshot(applied_n=3.0, damping_n_s_per_m=80.0))
    assert taken.go(1e-4, 3.0) == pytest.approx(3.0 - 80.0 * 0.5 * 0.1)
    taken.leave()
    assert taken.go(1e-4, 3.0) == pytest.approx(3.0 - 80.0 / 11.0 * 0.5 * 0.1)


def test_damping_that_is_taken_over_out_of_reach_comes_in_with_the_first_touch() -> None:
    """No step outside comes between: a port without a client is not asked."""
    taken = Port()
    late_cycle.start(taken.state, taken.params, LawSnapshot(damping_n_s_per_m=80.0))
    assert taken.go(1e-4, 3.0) == pytest.approx(3.0 - 80.0 / 11.0 * 0.5 * 0.1)


@pytest.mark.parametrize("late", [10, 40, 80])
def test_a_spring_that_comes_late_is_held(late: int) -> None:
    """Without a law it swings by centimetres from (5 N s/m) / delay on; here it has four times that."""
    stiffness_n_per_m = 4.0 * 5.0 / (late * DT_S)
    assert rests_m(none, stiffness_n_per_m, late) > 5e-3
    assert rests_m(late_cycle, stiffness_n_per_m, late) < 5e-5
