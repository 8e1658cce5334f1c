"""Claims that one run cannot decide: the same press from many starts, and the share of them that comes to rest.

A start is a distance from which the pressed device falls onto the wall; a quantised loop depends on it chaotically.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticd.config.walls import WallConfig
from hapticd.simulation.batch import Point
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.paper.runs import Array, Asked, Runs, law_named
from hapticd_studies.paper.scenarios import (
    LITERAL,
    NO_WINDOW,
    PRINTED,
    PRINTED_OBSERVER,
    TDPA_AS_PUBLISHED,
    TO_THE_LETTER,
)

DURATION_S = 6.0
DROP_M = 0.01
"""The highest start above the wall [m]."""

HANDS_N = (-1.0, -3.0, -6.0)
NATIVE_N_PER_M = (5e3, 6e3, 7e3, 8e3, 9e3, 10e3, 12e3)
HELD_N_PER_M = (12e3, 18e3, 20e3)
BEYOND_N_PER_M = (25e3, 30e3)
"""Stiffer than the paper reports."""

WINDOWS = (2, 3, 4, 6, 8, 12)
"""Sizes of the time window, on either side."""

WINDOWS_N_PER_M = (12e3, 20e3)

WINDOW_HANDS_N = tuple(-0.5 * half for half in range(1, 13))
NOISES_M = (0.0, 1e-6, 2e-6, 4e-6)
WINDOW_N_PER_M = 12e3
WINDOW_READINGS: dict[str, dict[str, Any]] = {
    "literal": LITERAL,
    "spring": {**PRINTED, "cap": "none"},
    "shipped": {},
    "letter": TO_THE_LETTER,
}
WINDOW_DEVICES: dict[str, dict[str, Any]] = {
    "omega.7 model": {},
    "lightly damped": {"viscous_n_s_per_m": 2.1, "max_force_n": 0.0},
}
MODELS = {"paper-simulation": (-5.0, 3e3), "omega7": (-3.0, 12e3), "hapkit": (-1.0, 6e3)}
"""Device models that differ six times in mass, with a hand [N] and a wall [N/m] that are too much for each alone."""


@dataclass(frozen=True, slots=True)
class Size:
    """How many starts and hands are tried.

    Attributes:
        starts: of every share but the window's.
        window_starts: of each hand and noise.
        map_hands, map_starts: of the map over hand force and start.
    """

    starts: int
    window_starts: int
    map_hands: int
    map_starts: int


FULL = Size(starts=63, window_starts=9, map_hands=32, map_starts=41)
QUICK = Size(starts=5, window_starts=2, map_hands=3, map_starts=4)


def press(
    stiffness_n_per_m: float,
    hand_n: float,
    drop_m: float,
    params: dict[str, Any] | None = None,
    law: str = "energy-cycle",
    **device: Any,
) -> Point:
    """A device that is pressed onto a wall from some distance, with what it can as the limit of force."""
    keys = {"initial_position_m": drop_m, "hand": {"force": {"profile": "constant", "newton": hand_n}}, **device}
    options = SimulationOptions.model_validate(keys)
    wall = WallConfig(stiffness_n_per_m=stiffness_n_per_m)
    law_params = law_named(law).Params.model_validate(params or {})
    return Point(options, wall, law_params, max_force_n=options.max_force_n or np.inf)


@dataclass(frozen=True, slots=True)
class Shares:
    """Everything that is asked from many starts; each array is indexed as its field says.

    Attributes:
        drops_m: the starts [m].
        native: no law, [stiffness, hand, start].
        held: energy cycles, [stiffness, hand, start].
        beyond: the same on stiffer walls than the paper's.
        tdpa, tdpa_printed, tdpa_bounded: at 12, 18, 20 kN/m under 3 N, [stiffness, start]: unbounded with the exact
            observer, unbounded with that of eq. 2 as printed, bounded.
        window: energy cycles at 12 kN/m, [device, reading, noise, without or with window, hand, start].
        window_drops_m: its starts [m].
        windows: energy cycles, [stiffness, size of the window, hand, start].
        models: other devices, energy cycles with the same parameters, then no law, [model, start].
        map_hands_n, map_drops_m: axes of the maps at 12 kN/m.
        maps: law to [hand, start].
    """

    drops_m: Array
    native: Asked
    held: Asked
    beyond: Asked
    tdpa: Asked
    tdpa_printed: Asked
    tdpa_bounded: Asked
    window: Asked
    window_drops_m: Array
    windows: Asked
    models: Asked
    models_alone: Asked
    map_hands_n: Array
    map_drops_m: Array
    maps: dict[str, Asked]


def native(runs: Runs, drops_m: Array, **device: Any) -> Asked:
    """No law on each wall of `NATIVE_N_PER_M`, under each hand, from each start."""
    walls = [(k, hand, drop) for k in NATIVE_N_PER_M for hand in HANDS_N for drop in drops_m]
    return runs.ask("none", [press(k, hand, drop, law="none", **device) for k, hand, drop in walls])


def by_window(runs: Runs, drops_m: Array) -> Asked:
    """Energy cycles on `WINDOWS_N_PER_M` with each size of the window, under each hand, from each start."""
    walls = [(k, size, hand, drop) for k in WINDOWS_N_PER_M for size in WINDOWS for hand in HANDS_N for drop in drops_m]
    return runs.ask("energy-cycle", [press(k, hand, drop, {"window": size}) for k, size, hand, drop in walls])


def ask(runs: Runs, size: Size) -> Shares:
    """Ask for all of them."""
    drops_m = np.linspace(0.0, DROP_M, size.starts)
    hands_n = -np.linspace(0.25, 8.0, size.map_hands)
    map_drops_m = np.linspace(0.0, DROP_M, size.map_starts)
    window_drops_m = np.linspace(0.0, DROP_M, size.window_starts)
    unbounded = TDPA_AS_PUBLISHED
    windows: Sequence[dict[str, Any]] = (NO_WINDOW, {})

    def tdpa(params: dict[str, Any]) -> Asked:
        return runs.ask("tdpa", [press(k, -3.0, drop, params, "tdpa") for k in HELD_N_PER_M for drop in drops_m])

    def cycles(walls_n_per_m: Sequence[float]) -> Asked:
        return runs.ask(
            "energy-cycle", [press(k, hand, drop) for k in walls_n_per_m for hand in HANDS_N for drop in drops_m]
        )

    return Shares(
        drops_m=drops_m,
        native=native(runs, drops_m),
        held=cycles(HELD_N_PER_M),
        beyond=cycles(BEYOND_N_PER_M),
        tdpa=tdpa(unbounded),
        tdpa_printed=tdpa(PRINTED_OBSERVER),
        tdpa_bounded=tdpa({}),
        window=runs.ask(
            "energy-cycle",
            [
                press(WINDOW_N_PER_M, hand, drop, {**reading, **window}, noise_m=noise, **device)
                for device in WINDOW_DEVICES.values()
                for reading in WINDOW_READINGS.values()
                for noise in NOISES_M
                for window in windows
                for hand in WINDOW_HANDS_N
                for drop in window_drops_m
            ],
        ),
        window_drops_m=window_drops_m,
        windows=by_window(runs, drops_m),
        models=runs.ask(
            "energy-cycle",
            [press(k, hand, drop, model=model) for model, (hand, k) in MODELS.items() for drop in drops_m],
        ),
        models_alone=runs.ask(
            "none",
            [press(k, hand, drop, law="none", model=model) for model, (hand, k) in MODELS.items() for drop in drops_m],
        ),
        map_hands_n=hands_n,
        map_drops_m=map_drops_m,
        maps={
            "TDPA, unbounded, exact": runs.ask(
                "tdpa", [press(12e3, hand, drop, unbounded, "tdpa") for hand in hands_n for drop in map_drops_m]
            ),
            "TDPA, bounded": runs.ask(
                "tdpa", [press(12e3, hand, drop, law="tdpa") for hand in hands_n for drop in map_drops_m]
            ),
            "energy cycles": runs.ask(
                "energy-cycle", [press(12e3, hand, drop) for hand in hands_n for drop in map_drops_m]
            ),
        },
    )
