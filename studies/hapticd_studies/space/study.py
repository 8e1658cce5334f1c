"""The study: what a device holds in every direction, and the verdicts of a thousand random places."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticd_studies.grid.output import as_csv, as_json
from hapticd_studies.space.linear import SpaceLoop, Vector
from hapticd_studies.space.places import KINDS, draw
from hapticd_studies.space.stepping import settles

TURNS, TILTS = 24, 13
"""Directions around, over half a turn, and up from the plane of x and y, over a quarter to both sides."""

Tell = Callable[[int], object]


@dataclass(frozen=True)
class Direction:
    """What a device holds of a surface that faces one way.

    Attributes:
        turn_deg, tilt_deg: of the normal, from x towards y, and up.
        normal: the same as a unit vector.
        exact_n_per_m: where the linear loop loses stability, on a plane without friction.
        estimate_n_per_m: 2 b_n / T.
        passive_n_per_m: 2 / (T n' B^-1 n).
    """

    turn_deg: float
    tilt_deg: float
    normal: Vector
    exact_n_per_m: float
    estimate_n_per_m: float
    passive_n_per_m: float


@dataclass(frozen=True)
class Verdicts:
    """Random places of one kind.

    Attributes:
        kind: of surface.
        places: how many.
        stable: how many of them the eigenvalues call stable.
        agree: in how many stepping says the same.
    """

    kind: str
    places: int
    stable: int
    agree: int


@dataclass(frozen=True)
class SpaceFindings:
    """All that was found.

    Attributes:
        loop: the device.
        directions: turn by turn, tilts inside.
        sticking_n_per_m: what it holds where friction sticks, in whichever direction.
        verdicts: one a kind of surface.
    """

    loop: SpaceLoop
    directions: tuple[Direction, ...]
    sticking_n_per_m: float
    verdicts: tuple[Verdicts, ...]

    @property
    def weakest(self) -> Direction:
        """The direction that holds least."""
        return min(self.directions, key=_held)

    @property
    def strongest(self) -> Direction:
        """The direction that holds most."""
        return max(self.directions, key=_held)

    def json(self) -> bytes:
        """Everything, for programs."""
        loop = self.loop
        found: dict[str, Any] = {
            "mass_kg": loop.mass_kg.tolist(),
            "damping_n_s_per_m": loop.damping_n_s_per_m.tolist(),
            "hand_n_per_m": loop.hand_n_per_m.tolist(),
            "period_s": loop.period_s,
            "delay_samples": loop.delay,
            "sticking_n_per_m": self.sticking_n_per_m,
            "weakest": _plain(self.weakest),
            "strongest": _plain(self.strongest),
            "directions": [_plain(each) for each in self.directions],
            "verdicts": [
                {"kind": each.kind, "places": each.places, "stable": each.stable, "agree": each.agree}
                for each in self.verdicts
            ],
        }
        return as_json(found)

    def csv(self) -> bytes:
        """A line a direction."""
        rows = [_plain(each) for each in self.directions]
        return as_csv(list(rows[0]), [list(row.values()) for row in rows])


def study(loop: SpaceLoop, places: int, seed: int, tell: Tell = lambda _done: None) -> SpaceFindings:
    """Look at every direction of a device, and at random places of random ones.

    Args:
        loop: the device.
        places: how many random places.
        seed: of these.
        tell: hears how many steps are done, of `TURNS` and the number of places.
    """
    directions = []
    for at in range(TURNS):
        for tilt_deg in np.linspace(-90.0, 90.0, TILTS):
            directions.append(look(loop, 180.0 * at / TURNS, float(tilt_deg)))
        tell(at + 1)
    counts = {kind: [0, 0, 0] for kind in KINDS}
    for at in range(places):
        kind = KINDS[at % len(KINDS)]
        pressed = draw(np.random.default_rng((seed, at)), kind)
        stable = pressed.loop.radius(pressed.stiffness_n_per_m * pressed.shape) < 1.0
        counts[kind][0] += 1
        counts[kind][1] += stable
        counts[kind][2] += settles(pressed, at) is stable
        tell(TURNS + at + 1)
    verdicts = tuple(Verdicts(kind, *count) for kind, count in counts.items() if count[0])
    return SpaceFindings(loop, tuple(directions), loop.limit_n_per_m(np.eye(3)), verdicts)


def look(loop: SpaceLoop, turn_deg: float, tilt_deg: float) -> Direction:
    """What a device holds of a plane that faces one way."""
    turn, tilt = np.radians(turn_deg), np.radians(tilt_deg)
    normal = np.array([np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)])
    exact = loop.limit_n_per_m(np.outer(normal, normal))
    return Direction(turn_deg, tilt_deg, normal, exact, loop.estimate_n_per_m(normal), loop.passive_n_per_m(normal))


def _held(direction: Direction) -> float:
    return direction.exact_n_per_m


def _plain(direction: Direction) -> dict[str, float]:
    x, y, z = (float(each) for each in direction.normal)
    return {
        "turn_deg": direction.turn_deg,
        "tilt_deg": direction.tilt_deg,
        "normal_x": x,
        "normal_y": y,
        "normal_z": z,
        "exact_n_per_m": direction.exact_n_per_m,
        "estimate_n_per_m": direction.estimate_n_per_m,
        "passive_n_per_m": direction.passive_n_per_m,
    }
