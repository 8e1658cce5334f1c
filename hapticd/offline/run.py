"""A rehearsed configuration as rows, and a summary of them."""

from __future__ import annotations

import math
from array import array
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hapticd.config.loading import LoadedConfig
from hapticd.errors import ConfigError, DriverError
from hapticd.offline.model_choice import fitted
from hapticd.offline.rehearsal import Rehearsal
from hapticd.offline.verdict import Balance, Criterion, Outcome, balance
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd.tick.contact import Contact
from hapticd.tick.tick import ControlTick

WINDOW_S = 0.5
"""The end of a run that its summary looks at [s]."""

PROGRESS_TICKS = 2000
"""How often progress is told."""

_LONGEST_S = 1e9


class Row(NamedTuple):
    """One tick: x is relative to the first wall and positive outside, a positive force pushes out.

    Attributes:
        t_s: time since the first tick [s].
        x_m, v_m_per_s: true position and velocity of the device.
        x_measured_m: position as the device reports it [m].
        force_n: force applied from this tick to the next [N].
        force_requested_n: what wall and law asked for [N].
        energy_j: energy that has flowed into all walls [J].
        cycle: completed energy cycles of the first wall.
        damping_n_s_per_m: damping of the law on the first wall; 0 when it has none.
        in_contact: 1 inside the first wall, else 0.
    """

    t_s: float
    x_m: float
    v_m_per_s: float
    x_measured_m: float
    force_n: float
    force_requested_n: float
    energy_j: float
    cycle: int
    damping_n_s_per_m: float
    in_contact: int


@dataclass(frozen=True, slots=True)
class Summary:
    """What became of a run; means and spans are of its last `window_s` seconds.

    Attributes:
        ticks: ticks that were run.
        window_s: the end of the run that is looked at [s].
        peak_to_peak_m, measured_peak_to_peak_m: span of the true and of the measured position [m].
        mean_depth_m: mean depth in the first wall, true position, negative outside [m].
        displayed_stiffness_n_per_m: mean force over mean true depth while in contact; None without contact.
        measured_stiffness_n_per_m: the same over the measured depth, which is what the law sees.
        commanded_stiffness_n_per_m: stiffness of the first wall at the end; None without a wall.
        cycles: completed energy cycles of the first wall.
        damping_n_s_per_m: damping of the law at the end.
        peak_force_n: largest force that was applied, magnitude, whole run [N].
        energy_j, generated_j, dissipated_j: the books of all walls at the end [J].
        fault: why the daemon would have stopped; None when it would not.
    """

    ticks: int
    window_s: float
    peak_to_peak_m: float
    measured_peak_to_peak_m: float
    mean_depth_m: float
    displayed_stiffness_n_per_m: float | None
    measured_stiffness_n_per_m: float | None
    commanded_stiffness_n_per_m: float | None
    cycles: int
    damping_n_s_per_m: float
    peak_force_n: float
    energy_j: float
    generated_j: float
    dissipated_j: float
    fault: str | None


class OfflineRun:
    """One run of a configuration.

    Args:
        loaded: the configuration.
        duration_s: simulated time [s].

    Attributes:
        ticks: how many ticks that takes.

    Raises:
        ConfigError: the duration makes no sense, or the configuration is not one for a simulated device.
    """

    def __init__(self, loaded: LoadedConfig, duration_s: float) -> None:
        self._period_ns = loaded.config.loop.period_ns
        self.period_s = loaded.config.loop.period_s
        if not self.period_s <= duration_s <= _LONGEST_S:
            raise ConfigError(
                f"duration = {duration_s:g} s: must be at least one period, {self.period_s:g} s, "
                f"and at most {_LONGEST_S:g} s"
            )
        self.ticks = round(duration_s / self.period_s)
        self._rehearsal = Rehearsal(fitted(loaded))
        self._tick = self._rehearsal.tick

    @property
    def fault(self) -> str | None:
        """Why the daemon would have stopped, once it is known; None as long as it would not."""
        return self._rehearsal.fault

    def run(self, take: Callable[[Row], object], progress: Callable[[int], None] | None = None) -> Summary:
        """Run from the first tick to the last, or to where the model has diverged.

        Args:
            take: is given every row.
            progress: is told now and then how many ticks are done.

        Raises:
            DriverError: there was not even a first tick.
        """
        window = _Window(max(1, round(WINDOW_S / self.period_s)))
        for row in self._rows():
            take(row)
            window.enter(row)
            if progress is not None and window.ticks % PROGRESS_TICKS == 0:
                progress(window.ticks)
        if not window.ticks:
            raise DriverError(self.fault or "the device gave no sample")
        return window.summary(self._tick, self.period_s, self.fault)

    def _rows(self) -> Iterator[Row]:
        tick, model, period_ns = self._tick, self._rehearsal.model, self._period_ns
        first: Contact | None = tick.contacts[0] if tick.contacts else None
        axis = first.wall.axis if first else 0
        outward = first.wall.outward if first else 1.0
        ledgers = [contact.ledger for contact in tick.contacts]
        for count in self._rehearsal.run(self.ticks):
            yield Row(
                count * period_ns / 1e9,
                model.x_m,
                model.v_m_per_s,
                first.x_m if first else tick.motion.position_m[0],
                outward * tick.force_n[axis],
                outward * tick.requested_n[axis],
                sum([ledger.energy_j for ledger in ledgers]),
                first.ledger.cycle if first else 0,
                first.damping_n_s_per_m if first else 0.0,
                int(first.in_contact) if first else 0,
            )


class _Window:
    """The last rows, whenever the run ends."""

    def __init__(self, length: int) -> None:
        self.ticks = 0
        self._rows: deque[Row] = deque(maxlen=length)
        self._peak_n = 0.0

    def enter(self, row: Row) -> None:
        self.ticks += 1
        self._rows.append(row)
        if not -self._peak_n <= row.force_n <= self._peak_n:
            self._peak_n = abs(row.force_n)

    def summary(self, tick: ControlTick, period_s: float, fault: str | None) -> Summary:
        true_m = [row.x_m for row in self._rows]
        measured_m = [row.x_measured_m for row in self._rows]
        inside = [row for row in self._rows if row.in_contact]
        ledgers = [contact.ledger for contact in tick.contacts]
        last = self._rows[-1]
        return Summary(
            ticks=self.ticks,
            window_s=len(self._rows) * period_s,
            peak_to_peak_m=max(true_m) - min(true_m),
            measured_peak_to_peak_m=max(measured_m) - min(measured_m),
            mean_depth_m=-sum(true_m) / len(true_m),
            displayed_stiffness_n_per_m=_stiffness(inside, [row.x_m for row in inside]),
            measured_stiffness_n_per_m=_stiffness(inside, [row.x_measured_m for row in inside]),
            commanded_stiffness_n_per_m=tick.contacts[0].wall.stiffness_n_per_m if tick.contacts else None,
            cycles=last.cycle,
            damping_n_s_per_m=last.damping_n_s_per_m,
            peak_force_n=self._peak_n,
            energy_j=sum(ledger.energy_j for ledger in ledgers),
            generated_j=sum(ledger.generated_j for ledger in ledgers),
            dissipated_j=sum(ledger.dissipated_j for ledger in ledgers),
            fault=fault,
        )


def _stiffness(rows: list[Row], x_m: list[float]) -> float | None:
    """Mean force over mean depth; None where there is no depth."""
    depth_m = -sum(x_m)
    return sum(row.force_n for row in rows) / depth_m if depth_m > 0.0 else None


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
