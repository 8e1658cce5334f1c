"""One run of a configuration offline: every tick, and what became of it."""

from __future__ import annotations

import contextlib
import html
import math
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from hapticd.config.models import Config
from hapticd.errors import HapticdError
from hapticd.offline.column import Column
from hapticd.offline.outcome import Balance, Criterion, Outcome, balance, comes_to_rest
from hapticd.offline.space_row import MEASURED, POSITION, length
from hapticd.simulation.options import SimulationOptions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hapticd.figures.curves import Curves


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
        armed: 1 while forces are let through, 0 while a fault has them ramped out, and after.
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
    armed: int


@dataclass(frozen=True, repr=False, eq=False)
class Run:
    """One run: a column a quantity, an element a tick, and what became of it.

    Spans, means and stiffness are of the last half second, which is what the outcome is judged by.

    Attributes:
        name: of the configuration, usually its path.
        config: what was run.
        options: the device that was run.
        columns: every column by its name, as `array.array`; a run whose rows were taken keeps the last half second.
        ticks: how many were run.
        left_place_tick: the last tick in which the device was not in the place where it should rest; -1: none.
        peak_force_n: largest force that was applied, magnitude, whole run [N].
        stiffness_n_per_m: of the first wall at the end, as commanded; NaN without a wall.
        generated_j, dissipated_j: the books of all walls at the end [J].
        fault: why the daemon would have stopped; None when it would not.
        diverged: whether the model left all bounds, whatever stopped the daemon before.
    """

    name: str
    config: Config
    options: SimulationOptions
    columns: Mapping[str, array[Any]]
    ticks: int
    left_place_tick: int
    peak_force_n: float
    stiffness_n_per_m: float
    generated_j: float
    dissipated_j: float
    fault: str | None
    diverged: bool

    t_s = Column("time since the first tick [s]")
    x_m = Column("true position, relative to the first wall and < 0 inside it [m]")
    v_m_per_s = Column("true velocity [m/s]")
    x_measured_m = Column("position as the device reports it [m]")
    force_n = Column("force applied from this tick to the next, > 0 pushes out [N]")
    force_requested_n = Column("what wall and law asked for [N]")
    energy_j = Column("energy that has flowed into all walls [J]")
    cycle = Column("completed energy cycles of the first wall")
    damping_n_s_per_m = Column("damping of the law on the first wall; 0 when it has none [N s/m]")
    in_contact = Column("whether the device is inside the first wall")
    armed = Column("whether forces are let through: not from a fault on")

    @property
    def period_s(self) -> float:
        """Time between ticks [s]."""
        return self.config.loop.period_s

    @property
    def window(self) -> slice:
        """The last half second, or all of a shorter run."""
        return slice(-min(self.ticks, window_ticks(self.period_s)), None)

    @property
    def window_s(self) -> float:
        """How long that is [s]."""
        return min(self.ticks, window_ticks(self.period_s)) * self.period_s

    @property
    def in_space(self) -> bool:
        """Whether the device has several axes, and the run a column for each."""
        return self.options.axes > 1

    @cached_property
    def balance(self) -> Balance:
        """Where hand and springs balance at the end."""
        return balance(self.options, self.config.scene.walls)

    @cached_property
    def outcome(self) -> Outcome:
        """What became of it."""
        if self.diverged:
            return Outcome.DIVERGED
        if self.fault is not None:
            return Outcome.STOPPED
        if self.in_space and comes_to_rest(self.options):  # where is what it pushes back that decides
            still = self.peak_to_peak_m <= Criterion().still_limit_m(self.options)
            return Outcome.SETTLED if still else Outcome.MOVING
        if math.isnan(self.balance.x_m):
            return Outcome.RUNS
        return Criterion().outcome(self.options, self.balance, self.peak_to_peak_m, self.mean_m)

    @property
    def settled(self) -> bool:
        """Whether the device came to rest in its place."""
        return self.outcome is Outcome.SETTLED

    @property
    def settled_tick(self) -> int | None:
        """The first tick from which on it stayed where it should rest; None when it does not or has no such place."""
        stayed = self.fault is None and self.left_place_tick < self.ticks - 1
        return self.left_place_tick + 1 if stayed else None

    @property
    def settled_s(self) -> float:
        """The settling time: that of `settled_tick`; NaN when there is none [s]."""
        return math.nan if self.settled_tick is None else self.settled_tick * self.period_s

    @cached_property
    def peak_to_peak_m(self) -> float:
        """Span of the true position at the end; in space the length of the spans along all axes [m]."""
        if self.in_space:
            return length([_span(self._last(name)) for name in POSITION])
        return _span(self._last("x_m"))

    @cached_property
    def measured_peak_to_peak_m(self) -> float:
        """Span of the measured position at the end; in space as that of the true one [m]."""
        if self.in_space:
            return length([_span(self._last(name)) for name in MEASURED])
        return _span(self._last("x_measured_m"))

    @cached_property
    def mean_m(self) -> float:
        """Mean of the true position at the end [m]."""
        last: array[float] = self._last("x_m")
        return sum(last) / len(last)

    @cached_property
    def displayed_stiffness_n_per_m(self) -> float:
        """Mean force over mean true depth in contact, at the end; NaN without contact [N/m]."""
        return self._displayed("x_m")

    @cached_property
    def measured_stiffness_n_per_m(self) -> float:
        """The same over the measured depth, which is what the law sees [N/m]."""
        return self._displayed("x_measured_m")

    @cached_property
    def force_chatter_n(self) -> float:
        """Span of the applied force at the end [N]."""
        return _span(self._last("force_n"))

    @cached_property
    def felt_index(self) -> float:
        """How many times the threshold of a hand the true position vibrates at the end.

        NaN where a hand never comes to rest, with several axes, after a fault, or without numpy.
        """
        if self.in_space or self.outcome not in (Outcome.SETTLED, Outcome.ELSEWHERE, Outcome.MOVING):
            return math.nan
        try:
            import numpy as np

            from hapticd.offline.felt import felt_index
        except ModuleNotFoundError:
            return math.nan
        return felt_index(np.array(self._last("x_m")), self.period_s)

    @property
    def summary(self) -> dict[str, Any]:
        """What became of it in numbers; None for what a run does not have."""
        return {
            "ticks": self.ticks,
            "outcome": self.outcome.words,
            "settled_s": _known(self.settled_s),
            "window_s": self.window_s,
            "peak_to_peak_m": self.peak_to_peak_m,
            "measured_peak_to_peak_m": self.measured_peak_to_peak_m,
            "mean_depth_m": -self.mean_m,
            "felt_index": _known(self.felt_index),
            "force_chatter_n": self.force_chatter_n,
            "displayed_stiffness_n_per_m": _known(self.displayed_stiffness_n_per_m),
            "measured_stiffness_n_per_m": _known(self.measured_stiffness_n_per_m),
            "commanded_stiffness_n_per_m": _known(self.stiffness_n_per_m),
            "cycles": self.columns["cycle"][-1],
            "damping_n_s_per_m": self.columns["damping_n_s_per_m"][-1],
            "peak_force_n": self.peak_force_n,
            "energy_j": self.columns["energy_j"][-1],
            "generated_j": self.generated_j,
            "dissipated_j": self.dissipated_j,
            "fault": self.fault,
        }

    @property
    def words(self) -> list[str]:
        """What became of it in some lines."""
        settled = "" if math.isnan(self.settled_s) else f" after {self.settled_s:.3g} s"
        outcome = f"settled{settled}" if self.outcome is Outcome.SETTLED else self.outcome.words
        felt = "" if math.isnan(self.felt_index) else f", felt {self.felt_index:.2g} times the threshold"
        lines = [
            f"{outcome}: {self.fault}" if self.fault else outcome,
            f"last {self.window_s:g} s: {self.peak_to_peak_m * 1e3:.4g} mm peak to peak, "
            f"mean depth {-self.mean_m * 1e3:.4g} mm{felt}, force chatter {self.force_chatter_n:.3g} N",
        ]
        if not math.isnan(self.displayed_stiffness_n_per_m):
            shown = f"{self.displayed_stiffness_n_per_m:.5g} N/m of {self.stiffness_n_per_m:g} N/m"
            lines.append(f"displayed stiffness {shown}")
        lines.append(
            f"{self.columns['cycle'][-1]} cycles, damping {self.columns['damping_n_s_per_m'][-1]:.4g} N s/m, "
            f"peak force {self.peak_force_n:.4g} N, energy made by the wall {self.generated_j * 1e3:.4g} mJ"
        )
        return lines

    @property
    def curves(self) -> Curves:
        """The run as `hapticd.figures` draws it, to be drawn with others.

        Raises:
            HapticdError: matplotlib is not installed.
        """
        with _matplotlib_needed():
            from hapticd.figures.curves import Curves

            return Curves(self._title, self.columns, self.stiffness_n_per_m, self.balance.x_m)

    def plot(self, figure: str = "run") -> Figure:
        """A figure of this run.

        Args:
            figure: "run" (position, force, energy with the ends of its cycles, and damping), one of those alone,
                "stiffness", "loop", or "fig9" after the paper's Fig. 9.

        Raises:
            ConfigError: there is no such figure.
            HapticdError: matplotlib is not installed.
        """
        with _matplotlib_needed():
            from hapticd.figures.sheets import draw

            return draw(figure, [self.curves], self._title)

    def position_error_m(self, exact: Run) -> float:
        """Largest distance of the true position from another run [m]; infinite when this one ends early."""
        return _largest(self.columns["x_m"], exact.columns["x_m"])

    def energy_error_j(self, exact: Run) -> float:
        """Largest difference of the energy [J]; infinite when this one ends early."""
        return _largest(self.columns["energy_j"], exact.columns["energy_j"])

    def __len__(self) -> int:
        return self.ticks

    def __repr__(self) -> str:
        return f"<Run of {self._title}, {self.ticks * self.period_s:g} s: {'; '.join(self.words)}>"

    def _repr_html_(self) -> str:
        """What a notebook shows: a small plot where matplotlib is installed, and the outcome."""
        text = html.escape("\n".join([self._title, *self.words]))
        try:
            drawn = self.plot()
            from hapticd.figures.picture import inline_image

            return f"{inline_image(drawn, 'run')}<pre>{text}</pre>"
        except HapticdError:
            return f"<pre>{text}</pre>"

    @property
    def _title(self) -> str:
        return f"{Path(self.name).name} with {self.config.controller.law}"

    def _last(self, name: str) -> array[Any]:
        return self.columns[name][self.window]

    def _displayed(self, name: str) -> float:
        inside = self._last("in_contact")
        depth_m = -sum([x_m for x_m, touched in zip(self._last(name), inside, strict=True) if touched])
        force_n = sum([one_n for one_n, touched in zip(self._last("force_n"), inside, strict=True) if touched])
        return force_n / depth_m if depth_m > 0.0 else math.nan


@contextlib.contextmanager
def _matplotlib_needed() -> Iterator[None]:
    try:
        yield
    except ModuleNotFoundError:
        raise HapticdError("a plot needs matplotlib: pip install 'hapticd[study]'") from None


def window_ticks(period_s: float) -> int:
    """How many ticks the end of a run is that it is judged by."""
    return max(1, round(Criterion().window_s / period_s))


def _span(values: array[float]) -> float:
    return max(values) - min(values)


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _largest(values: array[float], exact: array[float]) -> float:
    if len(values) < len(exact):
        return math.inf
    return max((abs(value - true) for value, true in zip(values, exact, strict=False)), default=0.0)
