"""The books: what flows into a wall, what it stores, what it makes, and where one press and release ends."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.tick.energy import EnergyLedger, cycle_ended

# Few levels, so that equal samples, falls and rises of every length come up.
LEVELS = st.lists(st.tuples(st.integers(-3, 3).map(float), st.sampled_from([True, True, True, False])), max_size=80)


def fresh() -> SimpleNamespace:
    return SimpleNamespace(window_energy_j=0.0, window_minimum_j=0.0, window_falls=0, window_rises=0)


def literal_cycles(samples: list[tuple[float, bool]], past: int, future: int) -> list[tuple[int, float]]:
    """Eq. (10) word by word on the samples that differ from the one before; when, and the energy at the minimum.

    Rises that a lost contact cuts off count as if they had come.
    """
    found: list[tuple[int, float]] = []
    seen = [0.0]
    told = False  # whether this fall and rise has been found already
    for at, (energy_j, in_contact) in enumerate(samples):
        new = energy_j != seen[-1]
        if new:
            if len(seen) > 1 and energy_j < seen[-1] and seen[-1] > seen[-2]:
                told = False
            seen.append(energy_j)
        ended = False
        for rises in range(future + 1) if not in_contact else [future] if new else []:
            lowest = len(seen) - 1 - rises
            falls = range(lowest - past, lowest)
            if falls.start < 0 or told:
                continue
            if all(seen[i] > seen[i + 1] for i in falls) and all(
                seen[i] < seen[i + 1] for i in range(lowest, len(seen) - 1)
            ):
                found.append((at, seen[lowest]))
                ended = True
                break
        told = told or ended
        if not in_contact:
            seen = [energy_j]
            told = False
    return found


@given(samples=LEVELS, past=st.integers(1, 4), future=st.integers(1, 4))
def test_the_detector_finds_what_a_literal_reading_of_the_window_finds(
    samples: list[tuple[float, bool]], past: int, future: int
) -> None:
    state = fresh()
    found = []
    for at, (energy_j, in_contact) in enumerate(samples):
        if cycle_ended(state, energy_j, in_contact, past, future):
            found.append((at, state.window_minimum_j))
    assert found == literal_cycles(samples, past, future)


def run(energies_j: list[float], in_contact: bool = True) -> list[int]:
    state = fresh()
    return [at for at, energy_j in enumerate(energies_j) if cycle_ended(state, energy_j, in_contact, 2, 2)]


def test_the_verdict_comes_with_the_second_rise() -> None:
    assert run([3.0, 2.0, 1.0, 2.0, 3.0, 4.0]) == [4]


def test_equal_samples_neither_end_a_fall_nor_a_rise() -> None:
    """A quantised position stands still for several samples at every turn, and the energy with it."""
    assert run([3.0, 2.0, 2.0, 2.0, 1.0, 1.0, 1.0, 2.0, 2.0, 3.0]) == [9]


def test_one_fall_or_one_rise_is_noise() -> None:
    assert run([3.0, 2.0, 3.0, 4.0, 5.0]) == []
    assert run([3.0, 2.0, 1.0, 2.0, 1.5, 1.0, 1.5]) == []


def test_a_cycle_is_found_once() -> None:
    assert run([3.0, 2.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) == [4]


def test_a_cycle_that_has_been_found_is_not_found_again_where_contact_ends() -> None:
    state = fresh()
    found = [cycle_ended(state, energy_j, True, 2, 2) for energy_j in (3.0, 2.0, 1.0, 2.0, 3.0)]
    assert found == [False, False, False, False, True]
    assert not cycle_ended(state, 3.0, False, 2, 2)


def test_contact_loss_ends_a_cycle() -> None:
    """Outside the wall the energy is flat, so a strictly rising window would never see the minimum (eq. 10)."""
    state = fresh()
    for energy_j in (3.0, 2.0, 1.0):
        assert not cycle_ended(state, energy_j, True, 2, 2)
    assert cycle_ended(state, 0.5, False, 2, 2)
    assert state.window_minimum_j == 0.5
    assert not cycle_ended(state, 0.5, False, 2, 2)


def test_contact_lost_one_sample_into_the_rise_ends_the_cycle_at_its_minimum() -> None:
    """A damper pulls in the last sample inside, so E has risen once when contact ends."""
    state = fresh()
    for energy_j in (3.0, 2.0, 1.0):
        assert not cycle_ended(state, energy_j, True, 2, 2)
    assert cycle_ended(state, 1.25, False, 2, 2)
    assert state.window_minimum_j == 1.0


def test_a_tap_that_fell_only_once_is_no_cycle() -> None:
    state = fresh()
    assert not cycle_ended(state, 3.0, True, 2, 2)
    assert not cycle_ended(state, 2.0, False, 2, 2)


class Spring:
    """A spring against which positions are played, with its ledger."""

    def __init__(self, stiffness_n_per_m: float, limit_n: float = math.inf) -> None:
        self.ledger = EnergyLedger()
        self.stiffness = stiffness_n_per_m
        self.limit_n = limit_n
        self.x_m = 0.0
        self.force_n = self.spring_n = 0.0

    def move(self, x_m: float, extra_n: float = 0.0, dt_s: float = 1e-3) -> float:
        """One tick at x; `extra_n` is what law, ramps and wall damping add; returns the energy that flowed in."""
        moved_m = x_m - self.x_m
        taken_j = -self.force_n * moved_m
        depth_m = max(0.0, -x_m)
        knee_m = min(depth_m, self.limit_n / self.stiffness) if self.stiffness else depth_m
        stored_j = 0.5 * self.stiffness * knee_m * knee_m
        if depth_m > knee_m:
            stored_j += self.limit_n * (depth_m - knee_m)
        self.ledger.update(moved_m, self.force_n, self.spring_n, stored_j, x_m < 0.0, 7.0, dt_s)
        self.x_m = x_m
        self.spring_n = min(self.stiffness * depth_m, self.limit_n)
        self.force_n = self.spring_n + extra_n if x_m < 0.0 else 0.0
        return taken_j


DEPTHS_M = st.lists(st.floats(-5e-3, 2e-3), max_size=60)


@given(
    depths_m=DEPTHS_M,
    extras_n=st.lists(st.floats(-20.0, 20.0), min_size=60, max_size=60),
    stiffnesses=st.lists(st.sampled_from([0.0, 2000.0, 12000.0]), min_size=60, max_size=60),
    limit_n=st.sampled_from([1.0, 12.0, math.inf]),
)
def test_energy_is_stored_plus_dissipated_minus_generated_whatever_happens(
    depths_m: list[float], extras_n: list[float], stiffnesses: list[float], limit_n: float
) -> None:
    """Eq. (6), to rounding: with saturation, active damping, ramps and walls that change under the hand."""
    world = Spring(2000.0, limit_n)
    ledger = world.ledger
    taken = [0.0]
    generated_j = 0.0
    for x_m, extra_n, stiffness in zip(depths_m, extras_n, stiffnesses, strict=False):
        world.stiffness = stiffness
        taken.append(world.move(x_m, extra_n))
        assert ledger.energy_j == pytest.approx(math.fsum(taken), abs=1e-12)
        assert ledger.energy_j == pytest.approx(ledger.stored_j + ledger.dissipated_j - ledger.generated_j, abs=1e-12)
        assert ledger.generated_j >= generated_j
        generated_j = ledger.generated_j


@given(depths_m=st.lists(st.floats(-5e-3, -1e-9), min_size=1, max_size=60))
def test_a_held_spring_generates_half_k_dx_squared_at_every_step(depths_m: list[float]) -> None:
    """From the first touch on: a step in from outside makes k/2 times what of it is inside."""
    world = Spring(12000.0)
    expected_j = []
    before_m = 0.0
    for x_m in depths_m:
        world.move(x_m)
        expected_j.append(0.5 * 12000.0 * (x_m - before_m) ** 2)
        before_m = x_m
        assert world.ledger.generated_j == pytest.approx(math.fsum(expected_j), abs=1e-14)
        assert world.ledger.dissipated_j == pytest.approx(0.0, abs=1e-12)


@given(depths_m=DEPTHS_M, limit_n=st.sampled_from([5.0, math.inf]))
def test_a_spring_alone_dissipates_nothing_also_where_the_limit_flattens_it(
    depths_m: list[float], limit_n: float
) -> None:
    world = Spring(12000.0, limit_n)
    for x_m in depths_m:
        world.move(x_m)
    assert world.ledger.dissipated_j == pytest.approx(0.0, abs=1e-12)


def test_a_damper_dissipates_and_an_active_one_gives() -> None:
    for damping in (5.0, -5.0):
        world = Spring(0.0)
        for count in range(1, 50):
            world.move(-1e-4 * count, extra_n=damping * 0.1)  # F = -b v at v = -0.1 m/s
        assert math.copysign(1.0, world.ledger.dissipated_j) == math.copysign(1.0, damping)
        assert world.ledger.dissipated_j == pytest.approx(damping * 0.1 * 48e-4)
        assert world.ledger.generated_j == 0.0


def test_a_pressed_wall_that_vanishes_dissipates_what_it_held() -> None:
    world = Spring(12000.0)
    world.move(-1e-3)
    world.stiffness = 0.0
    world.move(-1e-3)
    assert world.ledger.stored_j == 0.0
    assert world.ledger.dissipated_j == pytest.approx(0.5 * 12000.0 * 1e-6)


def test_debt_is_what_a_contact_gave_beyond_what_it_took_and_ends_with_the_contact() -> None:
    world = Spring(12000.0)
    for x_m in (-1e-3, -2e-3, -1e-3, -1e-6):
        world.move(x_m)
        assert world.ledger.debt_j == pytest.approx(max(0.0, -world.ledger.energy_j))
    assert world.ledger.debt_j > 0.0
    world.move(1e-3)
    assert world.ledger.debt_j > 0.0  # the last force has acted up to here
    world.move(1e-3)
    assert world.ledger.debt_j == 0.0


def test_a_credit_is_no_debt() -> None:
    world = Spring(12000.0)
    world.move(-1e-3)
    world.move(-2e-3)
    assert world.ledger.energy_j > 0.0
    assert world.ledger.debt_j == 0.0


def test_a_completed_cycle_is_entered_with_energy_generation_damping_and_duration() -> None:
    world = Spring(12000.0)
    path = [-1e-3, -2e-3, -3e-3, -2e-3, -1e-3, 1e-3]
    for _ in range(100):
        world.move(5e-3)  # time outside belongs to no cycle
    for x_m in path:
        world.move(x_m)
    ledger = world.ledger
    assert ledger.cycle == 1
    assert ledger.cycle_energy_j == pytest.approx(ledger.energy_j)
    assert ledger.cycle_generated_j == pytest.approx(-ledger.energy_j)
    assert ledger.cycle_damping_n_s_per_m == 7.0
    assert ledger.cycle_duration_s == pytest.approx(6e-3)


def test_the_second_cycle_of_a_touch_lasts_from_the_end_of_the_first() -> None:
    world = Spring(12000.0)
    durations_s = []
    for x_m in [-1e-3, -2e-3, -3e-3, -2e-3, -1e-3, -2e-3, -3e-3, -2e-3, -1e-3, 1e-3]:
        before = world.ledger.cycle
        world.move(x_m)
        if world.ledger.cycle > before:
            durations_s.append(world.ledger.cycle_duration_s)
    assert sum(durations_s) == pytest.approx(10e-3)
    assert len(durations_s) == 2


def test_where_a_ledger_begins_is_no_fall() -> None:
    """It falls once and rises twice from its first sample on, which is inside: that is no cycle."""
    ledger = EnergyLedger()
    for taken_j in (0.0, -1e-3, 1e-3, 1e-3):
        ledger.update(taken_j, -1.0, 0.0, 0.0, True, 0.0, 1e-3)
    assert ledger.cycle == 0


def test_the_generated_energy_of_cycles_adds_up_to_the_energy_at_the_last_minimum() -> None:
    world = Spring(9000.0)
    made_j = []
    for count in range(2000):
        before = world.ledger.cycle
        world.move(-2e-3 + 1.5e-3 * math.sin(0.31 * count))
        if world.ledger.cycle > before:
            made_j.append(world.ledger.cycle_generated_j)
            assert world.ledger.cycle_energy_j == pytest.approx(-math.fsum(made_j), abs=1e-12)
    assert len(made_j) == pytest.approx(2000 * 0.31 / (2.0 * math.pi), abs=1)


def test_cycles_are_still_found_after_a_day_of_large_totals() -> None:
    """A rise of a count at rest is 1e-8 J; the detector must not look for it in a sum of many joules."""
    young, old = Spring(12000.0), Spring(12000.0)
    old.ledger.energy_j = 3.3e5
    old.ledger.generated_j = 2.2e5
    old.ledger.dissipated_j = old.ledger.energy_j + old.ledger.generated_j
    for count in range(5000):
        x_m = -5e-4 + 1e-5 * round(3.0 * math.sin(0.2 * count))
        young.move(x_m)
        old.move(x_m)
    assert young.ledger.cycle > 100
    assert old.ledger.cycle == young.ledger.cycle
    assert old.ledger.energy_j - 3.3e5 == pytest.approx(young.ledger.energy_j, abs=1e-8)
    assert old.ledger.generated_j - 2.2e5 == pytest.approx(young.ledger.generated_j, abs=1e-8)


def test_a_day_of_ticks_adds_up_to_less_than_a_microjoule_of_rounding() -> None:
    """24 h at 1 kHz: 8.64e7 additions, one after the other as the ledger does them, against whole-number arithmetic.

    Every increment is a multiple of 2^-50 J, so that its sum is known exactly. One thousand seconds of a 2 Hz press
    and release against 12 kN/m with noise is played 86 times and a bit.
    """
    unit_j = 2.0**-50
    ticks = 1_000_000
    at_s = np.arange(ticks) * 1e-3
    x_m = -1e-3 + 1.2e-3 * np.sin(2.0 * np.pi * 2.0 * at_s) + np.random.default_rng(7).normal(0.0, 5e-6, ticks)
    force_n = np.maximum(0.0, -12000.0 * x_m)
    moved_m = np.diff(x_m, append=x_m[0])
    taken = np.rint(-force_n * moved_m / unit_j).astype(np.int64)
    made = np.rint(0.5 * 12000.0 * moved_m**2 * (x_m < 0.0) / unit_j).astype(np.int64)
    for increments in (taken, made, np.abs(taken)):  # what oscillates, what only grows, and the worst of both
        exact = 0
        total_j = 0.0
        for start in range(0, 86_400_000, ticks):
            part = increments[: min(ticks, 86_400_000 - start)]
            exact += int(part.sum())
            total_j = float(np.add.accumulate(np.concatenate(([total_j], part * unit_j)))[-1])
        assert abs(total_j - exact * unit_j) < 1e-6
        assert total_j == pytest.approx(exact * unit_j, rel=1e-9)


def test_a_ledger_that_begins_inside_the_wall_has_a_spring_that_nobody_pressed() -> None:
    """T7: what it holds was made: a hand that is let out gets it, and the books still balance."""
    ledger = EnergyLedger()
    ledger.update(0.0, 0.0, 0.0, 0.5, True, 0.0, 1e-3)
    assert (ledger.energy_j, ledger.stored_j, ledger.generated_j, ledger.dissipated_j) == (0.0, 0.5, 0.5, 0.0)
    ledger.update(1e-3, 500.0, 500.0, 0.0, False, 0.0, 1e-3)
    assert ledger.energy_j == pytest.approx(-0.5)
    assert ledger.energy_j == pytest.approx(ledger.stored_j + ledger.dissipated_j - ledger.generated_j)
    assert ledger.debt_j == pytest.approx(0.5)


def test_a_cycle_that_begins_inside_the_wall_lasts_from_the_first_entry() -> None:
    ledger = EnergyLedger()
    for energy_j in (3.0, 2.0, 1.0, 2.0, 3.0):
        ledger.update(-(energy_j - ledger.energy_j), 1.0, 0.0, 0.0, True, 4.0, 1e-3)
    assert ledger.cycle == 1
    assert ledger.cycle_duration_s == pytest.approx(5e-3)
    assert ledger.cycle_energy_j == pytest.approx(1.0)


def test_the_debt_of_a_new_touch_counts_from_nothing() -> None:
    """Neither what an earlier one took nor what it gave is left, also where nothing was given in between."""
    for earlier_n in (2.0, -2.0):
        ledger = EnergyLedger()
        ledger.update(-0.1, earlier_n, 0.0, 0.0, True, 0.0, 1e-3)
        for _ in range(3):
            ledger.update(0.1, 0.0, 0.0, 0.0, False, 0.0, 1e-3)
        assert ledger.debt_j == 0.0
        ledger.update(-0.1, 0.0, 0.0, 0.0, True, 0.0, 1e-3)
        ledger.update(0.1, 3.0, 0.0, 0.0, True, 0.0, 1e-3)
        assert ledger.debt_j == pytest.approx(0.3)
