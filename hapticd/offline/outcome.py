"""What became of a run: settled means that the device is still, and that it is where hand and springs balance.

Stillness alone misleads: a loop may rest millimetres too deep without a tremor. Every study declares the criterion in
its output.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import IntEnum
from typing import Any

from hapticd.config.walls import WallConfig
from hapticd.simulation.options import ConstantForce, RampForce, SimulationOptions, StepForce
from hapticd.simulation.space_options import ConstantPush, HoldPath, LetGoPush, PressPush


class Outcome(IntEnum):
    """What became of a run.

    The first four, from good to bad, are those of a press that the daemon would run to its end. `STOPPED`: the daemon
    would have stopped for a fault. `RUNS`: the hand never comes to rest, so there is no place to judge by.
    """

    SETTLED = 0
    ELSEWHERE = 1
    MOVING = 2
    DIVERGED = 3
    STOPPED = 4
    RUNS = 5

    @property
    def words(self) -> str:
        """For people."""
        return ("settled", "still, but out of place", "keeps moving", "diverged", "stopped", "runs")[self]

    def __str__(self) -> str:
        return self.words


PRESSED = (Outcome.SETTLED, Outcome.ELSEWHERE, Outcome.MOVING, Outcome.DIVERGED)
"""What a press can come to, from good to bad."""


@dataclass(frozen=True, slots=True)
class Balance:
    """Where hand force and springs balance at the end.

    Attributes:
        x_m: on the first wall's normal, < 0 inside; NaN where they do not [m].
        springs_n_per_m: stiffness there, walls and hand [N/m].
    """

    x_m: float
    springs_n_per_m: float


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
            f"or {self.place_counts:g} steps of where hand force and springs balance, friction allowed for; the "
            "settling time is when the position came that close to stay"
        )

    def declared(self) -> dict[str, Any]:
        """The criterion for a file of results."""
        return {"words": self.words(), **asdict(self)}

    def still_limit_m(self, device: SimulationOptions) -> float:
        """Largest span of the position that is still [m]."""
        return max(self.still_m, self.still_counts * device.resolution_m)

    def place_limit_m(self, device: SimulationOptions, at: Balance) -> float:
        """Largest distance from the balance that is in place, and the band of the settling time [m]."""
        # Coulomb friction may hold the device beside the balance.
        friction_m = coulomb_n(device) / at.springs_n_per_m if at.springs_n_per_m > 0.0 else 0.0
        return max(self.place_share * abs(at.x_m), self.place_counts * device.resolution_m) + friction_m

    def outcome(self, device: SimulationOptions, at: Balance, span_m: float, mean_m: float) -> Outcome:
        """What became of a press that did not diverge.

        Args:
            device: the device.
            at: where it should rest.
            span_m: of the true position over the last `window_s` [m].
            mean_m: mean of that position [m].
        """
        if not span_m <= self.still_limit_m(device):
            return Outcome.MOVING
        placed = abs(mean_m - at.x_m) <= self.place_limit_m(device, at)
        return Outcome.SETTLED if placed else Outcome.ELSEWHERE


def balance(device: SimulationOptions, walls: Sequence[WallConfig]) -> Balance:
    """Where a hand that comes to rest and all springs balance at the end.

    Every wall that is parallel to the first one and faces the same way adds its spring where it is deeper than its
    plane; the balance is found wall by wall, from the outermost one on.
    """
    force_n = pressing_n(device)
    if device.axes > 1 or not force_n > 0.0 or not walls or any(wall.free_side != walls[0].free_side for wall in walls):
        return Balance(math.nan, 0.0)
    outward = 1.0 if walls[0].free_side == "positive" else -1.0
    planes = []
    for wall in walls:
        stiffness = wall.stiffness_n_per_m
        for later in wall.changes:
            stiffness = stiffness if later.stiffness_n_per_m is None else later.stiffness_n_per_m
        planes.append((outward * (wall.position_m - walls[0].position_m), stiffness))
    reaches = hand_share(device)
    force_n *= reaches
    total, moment = reaches * _last(device, "hand_stiffness_n_per_m", device.hand.stiffness_n_per_m), 0.0
    x_m = math.nan
    for plane_m, stiffness in sorted(planes, reverse=True):
        if total > 0.0 and (moment - force_n) / total > plane_m:
            break
        total += stiffness
        moment += stiffness * plane_m
        x_m = (moment - force_n) / total if total > 0.0 else math.nan
    return Balance(x_m, total)


def comes_to_rest(device: SimulationOptions) -> bool:
    """Whether the hand of a device with several axes comes to an end of all that it does."""
    hand = device.space.hand
    return isinstance(hand.force, ConstantPush | PressPush | LetGoPush) and isinstance(hand.aim, HoldPath | None)


def pressing_n(device: SimulationOptions) -> float:
    """The force with which the hand presses at the end, > 0 into the wall [N]; NaN when it never comes to an end."""
    force = device.hand.force
    return -force.newton if isinstance(force, ConstantForce | StepForce | RampForce) else math.nan


def coulomb_n(device: SimulationOptions) -> float:
    """Coulomb friction at the end [N]."""
    return _last(device, "coulomb_n", device.coulomb_n)


def hand_share(device: SimulationOptions) -> float:
    """What of the force and of the spring of the hand is left at rest where the sensor is.

    Less than 1 where the hand's spring and that of a flexible device are in series: the hand's yields at the handle.
    """
    if device.flexible is None or device.flexible.sensor == "handle":
        return 1.0
    spring, _ = device.flexible.spring(_last(device, "mass_kg", device.mass_kg))
    return spring / (spring + _last(device, "hand_stiffness_n_per_m", device.hand.stiffness_n_per_m))


def _last(device: SimulationOptions, key: str, value: float) -> float:
    """A value of `Change` at the end."""
    for change in device.changes:
        value = change.values().get(key, value)
    return value
