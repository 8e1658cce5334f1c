"""What a law costs, counted and not timed: instructions of the interpreter, on one path that taps, rings and rests."""

from __future__ import annotations

import math
from functools import partial
from types import ModuleType

from hapticd.law import LawSnapshot, LawTick, fresh_state, plain_object, scalar_params
from hapticd.offline.operations import count_operations
from hapticd_controllers import energy_cycle, ring_damping

STIFFNESS_N_PER_M = 12e3
COUNT_M = 1e-5


def path_m() -> list[float]:
    """A device that comes, rings at 35 Hz until it rests, leaves, and comes again; at 1 kHz, in whole counts."""
    found = []
    for at in range(800):
        time_s = 1e-3 * (at % 400)
        ring_m = 8e-4 * math.exp(-time_s / 0.04) * math.cos(math.tau * 35.0 * time_s)
        away_m = max(0.0, time_s - 0.3) * 0.02
        found.append(round((ring_m - 2.5e-4 + away_m) / COUNT_M) * COUNT_M)
    return found


def counts(law: ModuleType) -> tuple[list[int], list[int]]:
    """Instructions of each step inside, and of each outside."""
    state, params = fresh_state(law), plain_object("Params", scalar_params(law.Params()))
    law.start(state, params, LawSnapshot())
    inside: list[int] = []
    outside: list[int] = []
    tick = LawTick(COUNT_M)
    tick.dt_s = 1e-3
    for x_m in path_m():
        tick.moved_m, tick.x_m, tick.in_contact = x_m - tick.x_m, x_m, x_m < 0.0
        tick.velocity_m_per_s = tick.moved_m / tick.dt_s
        tick.spring_n = tick.contact_n = -STIFFNESS_N_PER_M * x_m if tick.in_contact else 0.0
        count = count_operations(partial(law.step, state, params, tick))
        (inside if tick.in_contact else outside).append(count)
        tick.applied_n = tick.applied_contact_n = tick.contact_n
    return inside, outside


def test_ring_damping_costs_less_than_energy_cycle_on_the_mean_and_in_the_worst_tick() -> None:
    (ring, flight), (cycle, apart) = counts(ring_damping), counts(energy_cycle)
    assert len(ring) > 400
    assert len(flight) > 100
    assert sum(ring) <= 0.8 * sum(cycle)
    assert max(ring) <= max(cycle)
    assert sum(flight) <= sum(apart)
    assert max(flight) <= max(apart)
