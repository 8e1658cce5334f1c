"""The linear loop as the model steps it: its one-tick map from unit states, and how fast powers of it grow.

A wall that also pulls makes the loop linear. Each unit state goes through one period of the plant's own code; the
columns that come out are the map. Squared again and again it shows its spectral radius, whatever the period of an
oscillation is and however slowly it grows: no run waits for it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import MAX_EMAX, MIN_EMIN, Decimal, localcontext
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit

from hapticd.simulation.batch.fields import hints, plain, records
from hapticd.simulation.compiler.compile import OPTIONS, compiled, on_stack
from hapticd.simulation.compiler.specialise import specialise
from hapticd.simulation.compiler.threads import in_threads
from hapticd.simulation.options import SimulationOptions
from hapticd.simulation.plant import Buffers, PlantParams, PlantState, epochs, move, start_state, terms
from hapticd_studies.extremes.case import LoopCase

SQUARINGS = 44
"""2^44 ticks: what an oscillation is larger at its crest than in the mean then weighs nothing."""

DIGITS = 60
"""Digits of a squaring in decimals."""

LEAST = 3
"""States of a loop without delay: position, velocity, and the position one tick ago."""


def step_map(
    plant: Any, params: Any, line: Any, stiffness: float, damping: float, force_unit_n: float, columns: Any
) -> None:
    """Send each unit state through one period.

    Args:
        plant: state of the device, of which position, velocity and `line_at` are used.
        params: of the device.
        line: the delay line, one longer than the delay.
        stiffness: of the wall [N/m].
        damping: of the wall [N s/m].
        force_unit_n: what counts as one in the delay line [N]; lengths count in metres, speeds in metres a period.
        columns: (states, states), filled.
    """
    size = len(columns)
    delay = size - 3
    buffers = Buffers(line, line, line)
    for unit in range(size):
        plant.x_m = 1.0 if unit == 0 else 0.0
        plant.v_m_per_s = 1.0 / params.period_s if unit == 1 else 0.0
        last_m = 1.0 if unit == 2 else 0.0
        for at in range(delay + 1):
            line[at] = 0.0
        if unit > 2:
            line[unit - 2] = force_unit_n
        plant.line_at = 0
        x_m = plant.x_m
        move(plant, params, buffers, -stiffness * x_m - damping * ((x_m - last_m) / params.period_s))
        columns[0, unit] = plant.x_m
        columns[1, unit] = plant.v_m_per_s * params.period_s
        columns[2, unit] = x_m
        for at in range(delay):
            columns[3 + at, unit] = line[(plant.line_at + 1 + at) % (delay + 1)] / force_unit_n


def log_growth(power: Any, square: Any) -> float:
    """The natural logarithm of the spectral radius of `power`; both arrays are used up. NaN: not a finite map."""
    size = len(power)
    taken = 0.0
    share = 1.0  # of a tick that the logarithm of this power weighs
    for squaring in range(SQUARINGS + 1):
        largest = 0.0
        for i in range(size):
            for j in range(size):
                entry = abs(power[i, j])
                if not entry < math.inf:
                    return math.nan
                if entry > largest:
                    largest = entry
        if largest == 0.0:
            return -math.inf
        taken += share * math.log(largest)
        if squaring == SQUARINGS:
            break
        for i in range(size):
            for j in range(size):
                power[i, j] = power[i, j] / largest
        for i in range(size):
            for j in range(size):
                square[i, j] = 0.0
            for k in range(size):
                entry = power[i, k]
                if entry != 0.0:
                    for j in range(size):
                        square[i, j] += entry * power[k, j]
        for i in range(size):
            for j in range(size):
                power[i, j] = square[i, j]
        share *= 0.5
    return taken


def log_growth_in_decimals(columns: np.ndarray[Any, Any]) -> float:
    """The same without the rounding of the squaring, for a map with close eigenvalues, whose powers cancel."""
    with localcontext() as context:
        context.prec = DIGITS
        context.Emax, context.Emin = MAX_EMAX, MIN_EMIN
        power = np.array([[Decimal(entry) for entry in row] for row in columns.tolist()], dtype=object)
        taken, share = Decimal(0), Decimal(1)
        for _ in range(SQUARINGS):
            largest = max(abs(entry) for entry in power.flat)
            if not largest:
                return -math.inf
            taken += share * largest.ln()
            power = power / largest
            power = power @ power
            share /= 2
        largest = max(abs(entry) for entry in power.flat)
        return float(taken + share * largest.ln()) if largest else -math.inf


def growths(places: Sequence[LoopCase], options: Sequence[SimulationOptions]) -> np.ndarray[Any, Any]:
    """The natural logarithm of the spectral radius of each place, as machine code on all threads.

    Args:
        places: the loops.
        options: the device of each, linear.
    """
    found = np.empty(len(places))
    plants, params, walls, units = _arrays(places, options)
    delays = np.array([place.force_delay_samples for place in places])
    in_threads(_machine_code(), len(places), plants, params, walls, units, delays, found)
    return found


def stepped_map(place: LoopCase) -> np.ndarray[Any, Any]:
    """The one-tick map of a place, interpreted: (states, states); forces count in `force_unit_n`."""
    plants, params, walls, units = _arrays([place], [place.options(linear=True)])
    size = LEAST + place.force_delay_samples
    columns = np.zeros((size, size))
    fields = {name: params[name][0].item() for name in params.dtype.names}
    state = plain({name: plants[name][0].item() for name in plants.dtype.names})
    line = [0.0] * (place.force_delay_samples + 1)
    _stepper()(state, plain(fields), line, *map(float, walls[0]), float(units[0]), columns)
    return columns


def _arrays(places: Sequence[LoopCase], options: Sequence[SimulationOptions]) -> tuple[Any, Any, Any, Any]:
    params = [epochs(one, place.period_s)[0][1] for place, one in zip(places, options, strict=True)]
    return (
        records([start_state(one) for one in options], hints(PlantState)),
        records(params, hints(PlantParams)),
        np.array([(place.stiffness_n_per_m, place.wall_damping_n_s_per_m) for place in places]),
        np.array([1.0 / float(fields["x_per_f"]) for fields in params]),
    )


@lru_cache(maxsize=1)
def _stepper() -> Any:
    linear = dict.fromkeys(terms(SimulationOptions()), False) | {"DELAY": True, "SPRING": True}
    return specialise(step_map, linear, {"move": specialise(move, linear)})


@lru_cache(maxsize=1)
def _machine_code() -> Any:
    step, grow = compiled(_stepper()), compiled(log_growth)

    @njit(**OPTIONS)  # type: ignore[untyped-decorator]  # numba publishes no types
    def sweep(first: Any, stop: Any, plants: Any, params: Any, walls: Any, units: Any, delays: Any, found: Any) -> None:
        for at in range(first, stop):
            size = delays[at] + 3
            columns = np.empty((size, size))
            plant = on_stack(plants[at])
            step(plant, on_stack(params[at]), np.zeros(size - 2), walls[at, 0], walls[at, 1], units[at], columns)
            found[at] = grow(columns, np.empty((size, size)))

    return sweep
