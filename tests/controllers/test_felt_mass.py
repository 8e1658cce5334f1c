"""Mass and delay are what a weighted fit of a plane says, by numpy's least squares and not by sums."""

from __future__ import annotations

import random
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd_controllers.felt_mass import FELT_SAMPLES, FeltFields, believe, feel, know_nothing
from tests.examples import examples

RESOLUTION_M = 1e-7
PERIOD_S = 1e-3
LEAST_PUSH, LEAST_EXCITATION = 0.005, 1e-4


@dataclass(frozen=True)
class Moved:
    """A tick, as a law is shown it."""

    applied_n: float
    moved_m: float
    dt_s: float
    resolution_m: float = RESOLUTION_M


def ride(seed: int, mass_kg: float, viscous: float, late: bool, ticks: int, hand_n: float = 0.3) -> list[Moved]:
    """A mass under forces that change at random; each acts until the next, perhaps one sample late.

    From move to move m w = u - b s + hand dt, to the last bit that can be had.
    """
    rng = random.Random(seed)
    forces, path = [0.0, 0.0, 0.0], [Moved(0.0, 0.0, PERIOD_S)]
    for number in range(ticks):
        last, dt_s = path[-1], PERIOD_S * rng.uniform(0.8, 1.3)
        newer_n, older_n = (forces[-2], forces[-3]) if late else (forces[-1], forces[-2])
        u = 0.5 * (newer_n * dt_s + older_n * last.dt_s) + hand_n * PERIOD_S
        half = 0.5 * viscous / mass_kg
        moved_m = (last.moved_m * (1.0 / last.dt_s - half) + u / mass_kg) / (1.0 / dt_s + half)
        path.append(Moved(forces[-1], moved_m, dt_s))
        forces.append(0.0 if number % 37 > 32 else 2.0 * rng.uniform(-1.0, 1.0) - 20.0 * moved_m / dt_s)
    return path


def felt(path: list[Moved], keep: float, late: bool = False) -> Any:
    state: Any = SimpleNamespace()
    know_nothing(state, late)
    state.period_s = PERIOD_S
    for tick in path:
        feel(state, tick, keep)
    return state


def fitted(path: list[Moved], keep: float, late: bool, find_delay: bool) -> tuple[float, bool]:
    """The same from all samples at once: m w = u - b s + hand, weighted by how long they are past."""
    rows: list[list[float]] = []
    for at, now in enumerate(path):
        if _seen(path, at):
            last = path[at - 1]
            w = now.moved_m / now.dt_s - last.moved_m / last.dt_s
            u = 0.5 * (now.applied_n * now.dt_s + last.applied_n * last.dt_s)
            late_u = 0.5 * (last.applied_n * now.dt_s + path[at - 2].applied_n * last.dt_s)
            rows.append([w, 0.5 * (now.moved_m + last.moved_m), u, late_u])
    w, s, u, late_u = np.array(rows).T
    root = np.sqrt(keep ** np.arange(len(rows) - 1.0, -1.0, -1.0))
    explained, slope = {}, {}
    for name, push in ((False, u), (True, late_u)):
        plain = np.stack([s, np.ones_like(s)], axis=1) * root[:, None]
        rest = root * push - plain @ np.linalg.lstsq(plain, root * push, rcond=None)[0]
        plane = np.stack([push, s, np.ones_like(s)], axis=1) * root[:, None]
        (per_kg, along, _), *_ = np.linalg.lstsq(plane, root * w, rcond=None)
        varies = rest @ rest > LEAST_EXCITATION * (root * push) @ (root * push)
        slope[name] = per_kg
        explained[name] = per_kg * per_kg * (rest @ rest) if varies and per_kg > 0.0 else 0.0
        if not name:
            pushed = along * PERIOD_S > LEAST_PUSH
    if find_delay and (explained[False] or explained[True]):
        late = bool(explained[True] > explained[False] or pushed)
    return (1.0 / slope[late] if explained[late] else 0.0), late


def _seen(path: list[Moved], at: int) -> bool:
    recent = [each.applied_n for each in path[max(0, at - 2) : at + 1]]
    return len(recent) == 3 and all(recent) and abs(path[at].moved_m) > 2.0 * path[at].resolution_m


@examples(40)
@given(
    seed=st.integers(0, 2**32),
    mass_kg=st.floats(0.02, 2.0),
    viscous=st.floats(-3.0, 8.0),
    late=st.booleans(),
    keep=st.sampled_from([0.9, 0.98, 0.998, 1.0]),
    find_delay=st.booleans(),
    ticks=st.integers(40, 250),
)
def test_it_believes_what_a_fit_of_all_samples_says(
    seed: int, mass_kg: float, viscous: float, late: bool, keep: float, find_delay: bool, ticks: int
) -> None:
    path = ride(seed, mass_kg, viscous, late, ticks)
    known_late = not late if find_delay else late
    state = felt(path, keep, known_late)
    believe(state, find_delay)
    expected_kg, expected_late = fitted(path, keep, known_late, find_delay)
    assert state.forces_late == expected_late
    assert state.felt_mass_kg == pytest.approx(expected_kg, rel=1e-5)


@pytest.mark.parametrize("late", [False, True])
def test_the_true_mass_and_the_true_delay_come_out(late: bool) -> None:
    state = felt(ride(5, 0.25, 2.0, late, 400), 1.0, not late)
    believe(state, True)
    assert state.forces_late == late
    assert state.felt_mass_kg == pytest.approx(0.25, rel=1e-6)


@pytest.mark.parametrize(("seed", "mass_kg"), [(3, 0.134), (4, 0.3), (9, 1.2)])
def test_a_device_that_seems_to_push_by_itself_is_one_sample_late(seed: int, mass_kg: float) -> None:
    """No friction is below zero; a force that comes late looks as if it were. Half a percent of m/dt is rounding."""
    for share, late in ((0.1, False), (-0.0049, False), (-0.0051, True), (-0.1, True)):
        state = felt(ride(seed, mass_kg, share * mass_kg / PERIOD_S, False, 90), 1.0, False)
        believe(state, True)
        assert state.forces_late == late, share


@pytest.mark.parametrize("late", [False, True])
def test_a_force_that_hardly_varies_or_brakes_tells_no_mass(late: bool) -> None:
    """What was believed before stays."""
    flat = [Moved(3.0 + 1e-3 * (number % 2), 1e-5 + 1e-7 * (number % 3), PERIOD_S) for number in range(80)]
    against = [Moved(-each.applied_n, each.moved_m, each.dt_s) for each in ride(3, 0.2, 1.0, late, 200)]
    for path in (flat, against):
        state = felt(path, 1.0, late)
        state.felt_mass_kg = 0.7
        assert state.count >= FELT_SAMPLES
        believe(state, True)
        assert (state.felt_mass_kg, state.forces_late) == (0.7, late)


@examples(20)
@given(seed=st.integers(0, 2**32), known_late=st.booleans())
def test_where_nothing_goes_with_the_speed_no_friction_is_seen(seed: int, known_late: bool) -> None:
    """A shake to and fro by the same way: the mean move is always 0, and so is what viscous friction brakes."""
    rng = random.Random(seed)
    path = [Moved(rng.uniform(0.5, 2.0), 1e-5 * (-1.0) ** number, PERIOD_S) for number in range(60)]
    state = felt(path, 1.0, known_late)
    believe(state, True)
    expected_kg, expected_late = fitted(path, 1.0, known_late, True)
    assert state.forces_late == expected_late
    assert state.felt_mass_kg == pytest.approx(expected_kg, rel=1e-5)


@given(resolution=st.floats(1e-6, 1e-4), share=st.floats(0.5, 1.5))
def test_a_move_of_less_than_two_counts_is_no_evidence(resolution: float, share: float) -> None:
    moved_m = share * 2.0 * resolution
    state = felt([Moved(1.0, moved_m, PERIOD_S, resolution)] * 10, 1.0)
    assert state.count == (8.0 if moved_m > 2.0 * resolution else 0.0)


def test_to_know_nothing_leaves_nothing_of_before() -> None:
    state = felt(ride(1, 0.3, 1.0, False, 100), 0.99)
    believe(state, True)
    assert state.felt_mass_kg > 0.0
    for late in (False, True):
        know_nothing(state, late)
        fresh = SimpleNamespace()
        know_nothing(fresh, late)
        assert vars(state) == vars(fresh)
        assert set(FeltFields.__annotations__) == vars(fresh).keys()
        assert all(value == 0.0 for name, value in vars(fresh).items() if name != "forces_late")
