"""A configuration played through offline, tick by tick, and what came of it: the answers that a model is judged by."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hapticd.config.loading import LoadedConfig
from hapticd.contracts.errors import DriverError
from hapticd.control.rehearsal import Rehearsal
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd.study.verdict import Criterion, coulomb_n, pressing_n

MakeDevice = Callable[[SimulationOptions, float], SimulatedDevice]

SETTLING_BAND = 0.05
"""A device has settled once it stays within this share of the distance from start to rest."""


@dataclass(frozen=True)
class Played:
    """One run, an element a tick.

    Attributes:
        options: the device that was run.
        period_s: time between ticks [s].
        target_m: where hand and springs balance on the first wall's normal, < 0 inside; NaN where they do not [m].
        place_m: how far from it a device may rest [m].
        still_m: largest span that is still [m].
        x_m: true position [m].
        v_m_per_s: true velocity [m/s].
        measured_m: position that the loop saw [m].
        force_n: what the loop wrote, along the first wall's normal [N].
        energy_j: energy into all walls [J].
        inside: 1 in contact with the first wall, else 0.
        fault: why the daemon would have stopped; None when it would not.
    """

    options: SimulationOptions
    period_s: float
    target_m: float
    place_m: float
    still_m: float
    x_m: array[float]
    v_m_per_s: array[float]
    measured_m: array[float]
    force_n: array[float]
    energy_j: array[float]
    inside: array[int]
    fault: str | None

    @property
    def window(self) -> slice:
        """The last half second."""
        return slice(-max(1, round(Criterion().window_s / self.period_s)), None)

    @cached_property
    def peak_to_peak_m(self) -> float:
        """Span of the true position at the end [m]."""
        last = self.x_m[self.window]
        return max(last) - min(last)

    @cached_property
    def mean_m(self) -> float:
        """Mean of the true position at the end [m]."""
        return float(np.mean(self.x_m[self.window]))

    @cached_property
    def verdict(self) -> str:
        """What became of it, in the words of every study; a hand that never rests leaves only whether it ran."""
        if self.fault is not None:
            return "diverged" if "diverged" in self.fault else "stopped"
        if math.isnan(self.target_m):
            return "runs"
        if self.peak_to_peak_m > self.still_m:
            return "keeps moving"
        return "settled" if abs(self.mean_m - self.target_m) <= self.place_m else "still, but out of place"

    @cached_property
    def settled_s(self) -> float:
        """From when on it stayed near the place where it rests; NaN when it does not rest [s]."""
        if self.verdict not in ("settled", "still, but out of place"):
            return math.nan
        x = np.asarray(self.x_m)
        band = max(SETTLING_BAND * abs(float(x[0]) - self.mean_m), SETTLING_BAND * abs(self.mean_m), self.still_m)
        outside = np.flatnonzero(np.abs(x - self.mean_m) > band)
        return float((outside[-1] + 1) if len(outside) else 0) * self.period_s

    @cached_property
    def displayed_n_per_m(self) -> float:
        """Mean force over mean true depth in contact, at the end; NaN without contact [N/m]."""
        inside = np.asarray(self.inside[self.window]) > 0
        depth = -float(np.sum(np.asarray(self.x_m[self.window])[inside]))
        return float(np.sum(np.asarray(self.force_n[self.window])[inside])) / depth if depth > 0.0 else math.nan

    @cached_property
    def peak_n(self) -> float:
        """Largest force, magnitude [N]."""
        return float(np.max(np.abs(self.force_n)))

    def position_error_m(self, exact: Played) -> float:
        """Largest distance of the true position from another run [m]; infinite when this one ends early."""
        return _largest(self.x_m, exact.x_m)

    def energy_error_j(self, exact: Played) -> float:
        """Largest difference of the energy [J]; infinite when this one ends early."""
        return _largest(self.energy_j, exact.energy_j)

    def force_error(self, exact: Played) -> float:
        """Root mean square of the difference in force over that of the other run; infinite when this one ends early."""
        if len(self.force_n) < len(exact.force_n):
            return math.inf
        wanted = np.asarray(exact.force_n)
        off = float(np.sqrt(np.mean((np.asarray(self.force_n)[: len(wanted)] - wanted) ** 2)))
        size = float(np.sqrt(np.mean(wanted**2)))
        return off / size if size > 0.0 else (0.0 if off == 0.0 else math.inf)


def play(
    loaded: LoadedConfig,
    duration_s: float,
    options: SimulationOptions | None = None,
    make_device: MakeDevice | None = None,
) -> Played:
    """Play a configuration.

    Args:
        loaded: the configuration.
        duration_s: simulated time [s].
        options: of its device; None: the configuration's own.
        make_device: makes the device model; None: the usual one.

    Raises:
        ConfigError: the configuration is not one for a simulated device.
        DriverError: the device cannot be stepped at this rate, or gave not even one sample.
    """
    rehearsal = Rehearsal(loaded, options, make_device)
    model, tick = rehearsal.model, rehearsal.tick
    first = tick.contacts[0] if tick.contacts else None
    axis = first.wall.axis if first else 0
    outward = first.wall.outward if first else 1.0
    x, v, seen, force, energy = (array("d") for _ in range(5))
    inside = array("b")
    ledgers = [contact.ledger for contact in tick.contacts]
    for _ in rehearsal.run(max(1, round(duration_s / rehearsal.period_s))):
        x.append(model.x_m)
        v.append(model.v_m_per_s)
        seen.append(model.measured_m)
        force.append(outward * tick.force_n[axis])
        energy.append(sum([ledger.energy_j for ledger in ledgers]))
        inside.append(first.in_contact if first else 0)
    if not x:
        raise DriverError(rehearsal.fault or "the device gave no sample")
    device, criterion = model.options, Criterion()
    target_m, springs_n_per_m = _balance(loaded, device)
    friction_m = coulomb_n(device) / springs_n_per_m if springs_n_per_m > 0.0 else 0.0
    return Played(
        options=device,
        period_s=rehearsal.period_s,
        target_m=target_m,
        place_m=max(criterion.place_share * abs(target_m), criterion.place_counts * device.resolution_m) + friction_m,
        still_m=criterion.still_limit_m(device),
        x_m=x,
        v_m_per_s=v,
        measured_m=seen,
        force_n=force,
        energy_j=energy,
        inside=inside,
        fault=rehearsal.fault,
    )


def _balance(loaded: LoadedConfig, options: SimulationOptions) -> tuple[float, float]:
    """Where a resting hand and all springs balance at the end, and the stiffness there [m], [N/m].

    Every wall that is parallel to the first one and faces the same way adds its spring where it is deeper than its
    plane; the balance is found wall by wall, from the outermost one on.
    """
    force_n = pressing_n(options)
    walls = loaded.config.scene.walls
    hand = options.hand.stiffness_n_per_m
    for change in options.changes:
        hand = hand if change.hand_stiffness_n_per_m is None else change.hand_stiffness_n_per_m
    if not force_n > 0.0 or not walls or any(wall.free_side != walls[0].free_side for wall in walls):
        return math.nan, 0.0
    outward = 1.0 if walls[0].free_side == "positive" else -1.0
    planes = []
    for wall in walls:
        stiffness = wall.stiffness_n_per_m
        for later in wall.changes:
            stiffness = stiffness if later.stiffness_n_per_m is None else later.stiffness_n_per_m
        planes.append((outward * (wall.position_m - walls[0].position_m), stiffness))
    total, moment = hand, 0.0
    x_m = math.nan
    for plane_m, stiffness in sorted(planes, reverse=True):
        if total > 0.0 and (moment - force_n) / total > plane_m:
            break
        total += stiffness
        moment += stiffness * plane_m
        x_m = (moment - force_n) / total if total > 0.0 else math.nan
    return x_m, total


def _largest(values: array[float], exact: array[float]) -> float:
    if len(values) < len(exact):
        return math.inf
    return float(np.max(np.abs(np.asarray(values)[: len(exact)] - np.asarray(exact)), initial=0.0))
