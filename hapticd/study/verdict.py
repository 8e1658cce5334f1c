"""When a wall that is pressed counts as stable: the device is still, and it is where hand and springs balance.

Stillness alone misleads: a loop may rest millimetres too deep without a tremor. Every study declares the criterion in
its output.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from hapticd.simulation.batch import BatchResult, Point
from hapticd.simulation.options import ConstantForce, RampForce, SimulationOptions, StepForce


class Outcome(IntEnum):
    """What became of one press, from good to bad."""

    SETTLED = 0
    ELSEWHERE = 1
    MOVING = 2
    DIVERGED = 3

    @property
    def words(self) -> str:
        """For people."""
        return ("settled", "still, but out of place", "keeps moving", "diverged")[self]


@dataclass(frozen=True, slots=True)
class Criterion:
    """What still and in place mean.

    Attributes:
        window_s: the end of the run that is judged [s].
        still_m: largest span of the true position that is still [m].
        still_counts: the same in steps of the position sensor, where that is more.
        place_share: largest error of the mean depth, as a share of the depth at which hand and springs balance.
        place_counts: the same in steps of the position sensor, where that is more.
    """

    window_s: float = 0.5
    still_m: float = 5e-5
    still_counts: float = 2.0
    place_share: float = 0.1
    place_counts: float = 3.0

    def words(self) -> str:
        """The criterion in a sentence."""
        return (
            f"settled: over the last {self.window_s:g} s the true position spans at most {self.still_m * 1e3:g} mm or "
            f"{self.still_counts:g} steps of the sensor, and the mean depth is within {self.place_share * 100.0:g} % "
            f"or {self.place_counts:g} steps of where hand force and springs balance, friction allowed for"
        )

    def declared(self) -> dict[str, Any]:
        """The criterion for a file of results."""
        return {"words": self.words(), **asdict(self)}

    def still_limit_m(self, device: SimulationOptions) -> float:
        """Largest span of the position that is still [m]."""
        return max(self.still_m, self.still_counts * device.resolution_m)

    def place_limit_m(self, point: Point) -> float:
        """Largest distance from the balance that is in place [m]: Coulomb friction may hold the device beside it."""
        stiffness = springs_n_per_m(point)
        friction_m = coulomb_n(point.device) / stiffness if stiffness > 0.0 else 0.0
        aim_m = abs(balance_m(point))
        return max(self.place_share * aim_m, self.place_counts * point.device.resolution_m) + friction_m

    def judge(self, points: Sequence[Point], result: BatchResult) -> np.ndarray[Any, Any]:
        """The `Outcome` of each point.

        Args:
            points: the loops; each must have a balance.
            result: what became of them, with a window of `window_s`.
        """
        still_limit_m = np.array([self.still_limit_m(point.device) for point in points])
        place_limit_m = np.array([self.place_limit_m(point) for point in points])
        still = result.peak_to_peak_m <= still_limit_m
        placed = np.abs(misplaced_m(points, result)) <= place_limit_m
        return np.select(
            [~result.finite, ~still, ~placed], [Outcome.DIVERGED, Outcome.MOVING, Outcome.ELSEWHERE], Outcome.SETTLED
        )


def misplaced_m(points: Sequence[Point], result: BatchResult) -> np.ndarray[Any, Any]:
    """How much deeper than the balance each mean position is [m]."""
    depth_m: np.ndarray[Any, Any] = result.mean_depth_m + np.array([balance_m(point) for point in points])
    return depth_m


def balance_m(point: Point) -> float:
    """Where hand force and springs balance at the end, < 0 in the wall [m]; NaN where they do not."""
    force_n = pressing_n(point.device)
    stiffness = springs_n_per_m(point)
    return -force_n / stiffness if force_n > 0.0 and stiffness > 0.0 else math.nan


def pressing_n(device: SimulationOptions) -> float:
    """The force with which the hand presses at the end, > 0 into the wall [N]; NaN when it never comes to an end."""
    force = device.hand.force
    return -force.newton if isinstance(force, ConstantForce | StepForce | RampForce) else math.nan


def springs_n_per_m(point: Point) -> float:
    """Stiffness of wall and hand at the end [N/m]."""
    wall = point.wall.stiffness_n_per_m
    for change in point.wall.changes:
        wall = wall if change.stiffness_n_per_m is None else change.stiffness_n_per_m
    hand = point.device.hand.stiffness_n_per_m
    for device_change in point.device.changes:
        hand = hand if device_change.hand_stiffness_n_per_m is None else device_change.hand_stiffness_n_per_m
    return wall + hand


def coulomb_n(device: SimulationOptions) -> float:
    """Coulomb friction at the end [N]."""
    friction = device.coulomb_n
    for change in device.changes:
        friction = friction if change.coulomb_n is None else change.coulomb_n
    return friction
