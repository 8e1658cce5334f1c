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
from hapticd.study.verdict import Balance, Criterion, Outcome, balance

MakeDevice = Callable[[SimulationOptions, float], SimulatedDevice]

SETTLING_BAND = 0.05
"""A device has settled once it stays within this share of the distance from start to rest."""


@dataclass(frozen=True)
class Played:
    """One run, an element a tick.

    Attributes:
        options: the device that was run.
        period_s: time between ticks [s].
        balance: where hand and springs balance.
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
    balance: Balance
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
        if math.isnan(self.balance.x_m):
            return "runs"
        return Criterion().outcome(self.options, self.balance, self.peak_to_peak_m, self.mean_m).words

    @cached_property
    def settled_s(self) -> float:
        """From when on it stayed near the place where it rests; NaN when it does not rest [s]."""
        if self.verdict not in (Outcome.SETTLED.words, Outcome.ELSEWHERE.words):
            return math.nan
        x = np.asarray(self.x_m)
        still_m = Criterion().still_limit_m(self.options)
        band = max(SETTLING_BAND * abs(float(x[0]) - self.mean_m), SETTLING_BAND * abs(self.mean_m), still_m)
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
    return Played(
        options=model.options,
        period_s=rehearsal.period_s,
        balance=balance(model.options, loaded.config.scene.walls),
        x_m=x,
        v_m_per_s=v,
        measured_m=seen,
        force_n=force,
        energy_j=energy,
        inside=inside,
        fault=rehearsal.fault,
    )


def _largest(values: array[float], exact: array[float]) -> float:
    if len(values) < len(exact):
        return math.inf
    return float(np.max(np.abs(np.asarray(values)[: len(exact)] - np.asarray(exact)), initial=0.0))
