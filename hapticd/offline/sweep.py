"""What becomes of a configuration when one of its values goes through a row of others, under one or several laws."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from hapticd.config.loading import LoadedConfig, load
from hapticd.errors import ConfigError, PluginError
from hapticd.offline.column import Column
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.offline.rehearsal import ticks_in
from hapticd.offline.run import Run
from hapticd.offline.simulate import simulate

FEW_TICKS = 400_000
"""A law's share of a sweep that is run interpreted: machine code for a law takes as long to make."""

_SCORES = (
    "settled_s",
    "peak_to_peak_m",
    "mean_depth_m",
    "peak_force_n",
    "damping_n_s_per_m",
    "cycles",
    "generated_j",
)


@dataclass(frozen=True, repr=False, eq=False)
class Grid:
    """What became of each run of a sweep: of every score a row a law, a column a value.

    Where a run ended early there is no settling time, span or depth, but NaN.

    Attributes:
        key: what was swept.
        values: what it was set to.
        laws: under which laws.
        duration_s: simulated time of each run [s].
        outcomes: of each law the outcome at each value.
        columns: every score by its name, as nested lists.
    """

    key: str
    values: tuple[Any, ...]
    laws: tuple[str, ...]
    duration_s: float
    outcomes: Mapping[str, tuple[Outcome, ...]]
    columns: Mapping[str, list[list[float]]]

    settled_s = Column("settling time [s]")
    peak_to_peak_m = Column("span of the true position at the end [m]")
    mean_depth_m = Column("mean depth of the true position at the end [m]")
    peak_force_n = Column("largest force that was applied, magnitude [N]")
    damping_n_s_per_m = Column("damping of the law at the end [N s/m]")
    cycles = Column("completed energy cycles")
    generated_j = Column("energy that the wall made [J]")

    def __repr__(self) -> str:
        rows = [[self.key, *self.laws]]
        for at, value in enumerate(self.values):
            rows.append([_shown(value), *(self.outcomes[law][at].words for law in self.laws)])
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
        return "\n".join([*lines, f"{len(self.values) * len(self.laws)} runs of {self.duration_s:g} s"])


def sweep(
    config: LoadedConfig | Path | str,
    key: str,
    values: Sequence[Any],
    laws: Sequence[str] | None = None,
    *,
    duration_s: float = 2.0,
    progress: Callable[[int], object] | None = None,
) -> Grid:
    """Run a configuration with each of some values, under each of some laws.

    Many runs of a press on one wall go as machine code where numba is installed. The numbers are the same, but for the
    rounding of where a wall stands that is not at 0.

    Args:
        config: a configuration, its file, or its text.
        key: what to set, such as `scene.walls[0].stiffness_n_per_m`.
        values: what to set it to.
        laws: names of laws; the configuration's own keeps its parameters, another has its defaults. None: its own only.
        duration_s: simulated time of each run [s].
        progress: hears now and then how many runs are done.

    Raises:
        ConfigError: a value, a law or the duration cannot be used, or the device is not simulated.
        DriverError: a device cannot be stepped at this rate.
    """
    loaded = config if isinstance(config, LoadedConfig) else load(config)
    names = tuple(dict.fromkeys(laws)) if laws is not None else (loaded.config.controller.law,)
    if not names or len(values) == 0:
        raise ConfigError(f"{loaded.path}: {key}: a sweep needs at least one value and one law")
    outcomes: dict[str, tuple[Outcome, ...]] = {}
    columns: dict[str, list[list[float]]] = {name: [] for name in _SCORES}
    for done, law in enumerate(names):
        configs = [loaded.with_values({"controller.law": law, key: value}) for value in values]
        tell = partial(_tell, progress, done * len(configs))
        found = _compiled(configs, duration_s, tell) or _interpreted(configs, duration_s, tell)
        outcomes[law] = tuple(outcome for outcome, _ in found)
        for at, name in enumerate(_SCORES):
            columns[name].append([scores[at] for _, scores in found])
    return Grid(key, tuple(values), names, duration_s, outcomes, columns)


Found = list[tuple[Outcome, tuple[float, ...]]]


def _interpreted(configs: Sequence[LoadedConfig], duration_s: float, tell: Callable[[int], None]) -> Found:
    found = []
    for done, loaded in enumerate(configs, 1):
        run = simulate(loaded, duration_s)
        found.append((run.outcome, _scores(run)))
        tell(done)
    return found


def _scores(run: Run) -> tuple[float, ...]:
    ended = run.fault is not None
    return (
        run.settled_s,
        math.nan if ended else run.peak_to_peak_m,
        math.nan if ended else -run.mean_m,
        run.peak_force_n,
        run.columns["damping_n_s_per_m"][-1],
        run.columns["cycle"][-1],
        run.generated_j,
    )


def _compiled(configs: Sequence[LoadedConfig], duration_s: float, tell: Callable[[int], None]) -> Found | None:
    """The same as machine code; None where that is not worth it, or cannot be."""
    ticks = sum(ticks_in(loaded, duration_s) for loaded in configs)
    if ticks <= FEW_TICKS or importlib.util.find_spec("numba") is None:
        return None
    from hapticd.offline.presses import aimed, judge, point_of
    from hapticd.simulation.batch import Batch

    criterion = Criterion()
    try:
        if any(getattr(loaded.options, "accuracy", None) is not None for loaded in configs):
            return None
        points = [aimed(point_of(loaded), criterion) for loaded in configs]
        done = 0

        def advance(more: int) -> None:
            nonlocal done
            done += more
            tell(done)

        result = Batch(configs[0].law, points, duration_s, criterion.window_s).run(progress=advance)
    except (ConfigError, PluginError):  # no press that the engine can repeat, or a law that is no machine code
        return None
    outcomes = [Outcome(int(outcome)) for outcome in judge(criterion, points, result)]
    return list(zip(outcomes, zip(*(getattr(result, name).tolist() for name in _SCORES), strict=True), strict=True))


def _tell(progress: Callable[[int], object] | None, before: int, done: int) -> None:
    if progress is not None:
        progress(before + done)


def _shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
