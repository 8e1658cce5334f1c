"""Claims that one run cannot decide: the same press from many starts, and the share of them that comes to rest.

A start is a distance from which the pressed device falls onto the wall; a quantised loop depends on it chaotically.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticd.config.models import WallConfig
from hapticd.simulation.batch import Point
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.paper.runs import Array, Asked, Runs, law_named
from hapticd_studies.paper.scenarios import LITERAL, NO_WINDOW, PRINTED, TDPA_AS_PUBLISHED

DURATION_S = 6.0
DROP_M = 0.01
"""The highest start above the wall [m]."""

HANDS_N = (-1.0, -3.0, -6.0)
NATIVE_N_PER_M = (6e3, 7e3, 8e3, 9e3, 10e3, 12e3)
HELD_N_PER_M = (12e3, 18e3, 20e3)
NOISES_M = (0.0, 2e-6)
WINDOW_READINGS: dict[str, dict[str, Any]] = {"literal": LITERAL, "spring": {**PRINTED, "cap": "none"}, "shipped": {}}
WINDOW_DEVICES: dict[str, dict[str, Any]] = {
    "omega.7 model": {},
    "lightly damped": {"viscous_n_s_per_m": 2.1, "max_force_n": 0.0},
}
OSCILLATES_M = 2e-4
"""A span that cannot be called residual quantisation [m]."""

MODELS = {"paper-simulation": (-5.0, 3e3), "omega7": (-3.0, 12e3), "hapkit": (-1.0, 6e3)}
"""Device models that differ six times in mass, with a hand [N] and a wall [N/m] that are too much for each alone."""


@dataclass(frozen=True, slots=True)
class Size:
    """How many starts and hands are tried.

    Attributes:
        starts: of every share.
        map_hands, map_starts: of the map over hand force and start.
    """

    starts: int
    map_hands: int
    map_starts: int


FULL = Size(starts=63, map_hands=32, map_starts=41)
QUICK = Size(starts=5, map_hands=3, map_starts=4)


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
        tdpa, tdpa_bounded: at 12, 18, 20 kN/m under 3 N, [stiffness, start].
        window: energy cycles at 12 kN/m under 5 N, [device, reading, noise, without or with window, start].
        models: other devices, energy cycles with the same parameters, then no law, [model, start].
        map_hands_n, map_drops_m: axes of the maps at 12 kN/m.
        maps: law to [hand, start].
    """

    drops_m: Array
    native: Asked
    held: Asked
    tdpa: Asked
    tdpa_bounded: Asked
    window: Asked
    models: Asked
    models_alone: Asked
    map_hands_n: Array
    map_drops_m: Array
    maps: dict[str, Asked]


def ask(runs: Runs, size: Size) -> Shares:
    """Ask for all of them."""
    drops_m = np.linspace(0.0, DROP_M, size.starts)
    hands_n = -np.linspace(0.25, 8.0, size.map_hands)
    map_drops_m = np.linspace(0.0, DROP_M, size.map_starts)
    unbounded = TDPA_AS_PUBLISHED
    windows: Sequence[dict[str, Any]] = (NO_WINDOW, {})
    return Shares(
        drops_m=drops_m,
        native=runs.ask(
            "none", [press(k, hand, drop, law="none") for k in NATIVE_N_PER_M for hand in HANDS_N for drop in drops_m]
        ),
        held=runs.ask(
            "energy-cycle", [press(k, hand, drop) for k in HELD_N_PER_M for hand in HANDS_N for drop in drops_m]
        ),
        tdpa=runs.ask("tdpa", [press(k, -3.0, drop, unbounded, "tdpa") for k in HELD_N_PER_M for drop in drops_m]),
        tdpa_bounded=runs.ask("tdpa", [press(k, -3.0, drop, law="tdpa") for k in HELD_N_PER_M for drop in drops_m]),
        window=runs.ask(
            "energy-cycle",
            [
                press(12e3, -5.0, drop, {**reading, **window}, noise_m=noise, **device)
                for device in WINDOW_DEVICES.values()
                for reading in WINDOW_READINGS.values()
                for noise in NOISES_M
                for window in windows
                for drop in drops_m
            ],
        ),
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
            "TDPA as published": runs.ask(
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
