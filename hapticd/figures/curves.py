"""What is drawn of one run: its columns, read as lines, marks and a stretch of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hapticd.errors import HapticdError

Array = npt.NDArray[np.float64]

MOST_POINTS = 6000
"""More points of a line than this are drawn as the least and the largest of each stretch: no spike is lost."""

_LARGEST = 1e15  # of any quantity in SI units; a float has room for its squares
_LONGEST_RISE = 8  # ticks from the minimum that ends a cycle to the tick that counts it, by the widest window


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """One run as it is drawn.

    Attributes:
        name: what the run is called in a legend.
        columns: by name, as `Run.columns` has them, all of one length; t_s, x_m and force_n at least, t_s rising.
            Known besides: x_measured_m, force_requested_n, energy_j, cycle, damping_n_s_per_m, in_contact, late_us,
            armed, whether forces were let through.
        stiffness_n_per_m: of the wall, as commanded; NaN where it is not known [N/m].
        rest_m: where the device should rest; NaN where it is not known [m].
        faults_s: when a fault took the force away [s].

    Raises:
        HapticdError: a column is missing, of another length or not finite, there is no tick, or times do not rise.
    """

    name: str
    columns: Mapping[str, Sequence[Any] | npt.NDArray[Any]]
    stiffness_n_per_m: float = float("nan")
    rest_m: float = float("nan")
    faults_s: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        missing = [name for name in ("t_s", "x_m", "force_n") if name not in self.columns]
        if missing:
            raise HapticdError(f"{self.name}: has no column {', '.join(missing)}: it is no run of a device")
        if not len(self.columns["t_s"]):
            raise HapticdError(f"{self.name}: holds no tick")
        odd = [name for name, column in self.columns.items() if len(column) != len(self.columns["t_s"])]
        if odd:
            raise HapticdError(f"{self.name}: column {odd[0]} is not as long as t_s")
        for name in self.columns:
            wild = np.flatnonzero(~(np.abs(self[name]) <= _LARGEST))
            if len(wild):
                raise HapticdError(f"{self.name}: {name} is {self[name][wild[0]]:g} in row {wild[0]}: nothing to draw")
        if len(self["t_s"]) > 1 and not np.median(np.diff(self["t_s"])) > 0.0:
            raise HapticdError(f"{self.name}: its times do not rise")

    def __contains__(self, column: str) -> bool:
        return column in self.columns

    def __getitem__(self, column: str) -> Array:
        """A column as floats."""
        return np.asarray(self.columns[column], np.float64)

    @property
    def period_s(self) -> float:
        """Time between ticks, as it mostly is; 1 ms for a single tick [s]."""
        steps = np.diff(self["t_s"])
        return float(np.median(steps)) if len(steps) else 1e-3

    @property
    def inside(self) -> npt.NDArray[np.bool_]:
        """Whether the device is inside the wall, tick by tick."""
        return self["in_contact"] != 0.0 if "in_contact" in self else self["x_m"] < 0.0

    @property
    def held(self) -> npt.NDArray[np.bool_]:
        """Whether the wall had the device: inside it, with forces let through."""
        return self.inside & (self["armed"] != 0.0) if "armed" in self else self.inside

    def line(self, column: str, factor: float = 1.0) -> tuple[Array, Array]:
        """Times and values of a column, to be drawn as a line.

        Where ticks are missing the line is broken. A long one is thinned out as `MOST_POINTS` says.

        Args:
            column: its name.
            factor: into the unit of the axis.
        """
        return self.drawn(self[column] * factor)

    def drawn(self, values: Array) -> tuple[Array, Array]:
        """Times and values to draw of values that belong to every tick."""
        time_s = self["t_s"]
        broken = np.flatnonzero(np.diff(time_s) > 1.5 * self.period_s) + 1
        time_s, values = np.insert(time_s, broken, time_s[broken]), np.insert(values, broken, np.nan)
        if len(values) <= MOST_POINTS:
            return time_s, values
        chosen = _extremes(values, -(-3 * len(values) // MOST_POINTS))
        return time_s[chosen], values[chosen]

    def cycle_ends(self) -> npt.NDArray[np.int64]:
        """The ticks at which cycles end: the minimum of the energy before the tick that counts each."""
        counted = np.flatnonzero(np.diff(self["cycle"]) > 0.0) + 1
        energy_j = self["energy_j"]
        ends = []
        for at in counted.tolist():
            end = at
            while end > max(0, at - _LONGEST_RISE) and energy_j[end - 1] <= energy_j[end]:
                end -= 1
            ends.append(end)
        return np.asarray(ends, np.int64)

    def between(self, start_s: float, end_s: float) -> Curves:
        """The same run, from one time up to another.

        Raises:
            HapticdError: it has no tick there.
        """
        time_s = self["t_s"]
        chosen = (time_s >= start_s) & (time_s < end_s)
        if not chosen.any():
            raise HapticdError(
                f"{self.name}: has no tick from {start_s:g} to {end_s:g} s; it has them from {time_s[0]:g} "
                f"to {time_s[-1]:g} s"
            )
        return replace(self, columns={name: np.asarray(column)[chosen] for name, column in self.columns.items()})

    def from_contact(self) -> Curves:
        """The same run with time counted from where the wall is first met, or from the first tick if it is inside.

        Raises:
            HapticdError: it never touches its wall.
        """
        inside = self.inside
        if not inside.any():
            raise HapticdError(f"{self.name}: never touches its wall")
        time_s = self["t_s"]
        arrivals = np.flatnonzero(inside[1:] & ~inside[:-1]) + 1
        first = int(arrivals[0]) if len(arrivals) else 0
        return replace(self, columns={**self.columns, "t_s": time_s - time_s[first]})


def _extremes(values: Array, stretch: int) -> npt.NDArray[np.int64]:
    """Of each stretch of so many values the first, the least and the largest, and every break of the line."""
    kept: list[npt.NDArray[np.int64]] = [np.flatnonzero(np.isnan(values)), np.arange(0, len(values), stretch)]
    whole = len(values) // stretch * stretch
    for fill, find in ((np.inf, np.argmin), (-np.inf, np.argmax)):
        known = np.where(np.isnan(values), fill, values)
        kept.append(np.arange(0, whole, stretch) + find(known[:whole].reshape(-1, stretch), axis=1))
        if whole < len(values):
            kept.append(np.array([whole + find(known[whole:])]))
    return np.unique(np.concatenate(kept))
