"""Every cell of a map pressed and judged, by grid or by bisection, block by block."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from hapticd.config.loading import parse
from hapticd.offline.felt import WINDOW_S
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.offline.presses import balance_m, judge, misplaced_m
from hapticd.simulation.batch import Batch, Point
from hapticd_studies.felt_ends import felt_ends
from hapticd_studies.grid.job import Job, block_cells, block_sizes, in_order
from hapticd_studies.grid.journal import Row
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.zwidth.plane import MapAxis, axis_of
from hapticd_studies.zwidth.scenario import PressScenario, scenario_of

GRID_COLUMNS = (
    "outcome",
    "settled_starts",
    "peak_to_peak_m",
    "misplaced_m",
    "settled_s",
    "damping_n_s_per_m",
    "felt_mass_kg",
    "misplaced_share",
    "felt_index",
    "force_chatter_n",
)
"""Of each cell: the worst outcome of its starts, how many settled, and the largest of each figure among them."""

EDGE_COLUMNS = ("settles_at_low_end", "settles_at_high_end", "edge_low", "edge_high")
"""Of each line: whether its ends settle, and the bracket that holds the edge between them; NaN when there is none."""

STARTS_SPREAD_M = 0.01
_TICKS_PER_BLOCK = 4e6


@dataclass(frozen=True, slots=True)
class ZwidthPlan:
    """A map that is wanted.

    Attributes:
        text: configuration of the press, TOML.
        name: what to call it in errors.
        readings: the laws.
        x, y: the axes.
        method: grid: every cell; bisect: along x the one edge of each line.
        duration_s: simulated time of a press [s].
        starts: presses of a cell, from its own start to 10 mm higher, evenly spread.
        criterion: what settled means.
    """

    text: str
    name: str
    readings: Sequence[LawSpec]
    x: MapAxis
    y: MapAxis
    method: str
    duration_s: float
    starts: int
    criterion: Criterion

    @property
    def cells(self) -> int:
        """Cells of one law; with bisection, lines."""
        return len(self.y.values) * (len(self.x.values) if self.method == "grid" else 1)

    def job(self) -> Job:
        """The map cut into blocks, as many for each law."""
        return Job(_block, self._spec(), self._sizes() * len(self.readings), tuple(r.name for r in self.readings))

    def tables(self, blocks: Sequence[list[Row]]) -> list[np.ndarray[Any, Any]]:
        """Of each law a table of rows, in the order of its cells: x varies fastest."""
        sizes = self._sizes()
        each = [blocks[at : at + len(sizes)] for at in range(0, len(blocks), len(sizes))]
        return [np.array(in_order(sizes, found)) for found in each]

    def _sizes(self) -> tuple[int, ...]:
        scenario = scenario_of(parse(self.text, self.name))
        periods_s = [
            self.x.quantity.put(self.y.quantity.put(scenario, y), x).period_s
            for x in (self.x.values[0], self.x.values[-1])
            for y in (self.y.values[0], self.y.values[-1])
        ]
        ticks = self.starts * self.duration_s / min(periods_s)
        if self.method == "bisect":
            ticks *= _halvings(self.x)
        return block_sizes(self.cells, max(1, min(1000, int(_TICKS_PER_BLOCK / ticks))))

    def _spec(self) -> dict[str, Any]:
        return {
            "text": self.text,
            "name": self.name,
            "laws": [{"label": r.label, "name": r.name, "values": dict(r.values)} for r in self.readings],
            "x": self.x.declared(),
            "y": self.y.declared(),
            "method": self.method,
            "duration_s": self.duration_s,
            "starts": self.starts,
            "criterion": asdict(self.criterion),
            "sizes": self._sizes(),
        }


def _block(spec: dict[str, Any], block: int, threads: int | None) -> list[Row]:
    """The rows of one block."""
    sizes = spec["sizes"]
    press = _Press(spec, block // len(sizes), threads)
    cells = block_cells(sizes, block % len(sizes))
    return press.grid(cells) if spec["method"] == "grid" else press.edges(cells)


class _Press:
    """One law in the scenario of a map."""

    def __init__(self, spec: dict[str, Any], law: int, threads: int | None) -> None:
        reading = LawSpec(**spec["laws"][law])
        self._law, self._params = reading.law, reading.params
        self._scenario = _scenario(spec["text"], spec["name"])
        self._x, self._y = axis_of(spec["x"]), axis_of(spec["y"])
        self._criterion = Criterion(**spec["criterion"])
        self._duration_s, self._starts, self._threads = spec["duration_s"], spec["starts"], threads

    def grid(self, cells: Sequence[int]) -> list[Row]:
        """The rows of cells."""
        columns = len(self._x.values)
        places = [(self._x.values[cell % columns], self._y.values[cell // columns]) for cell in cells]
        points = self._points_of(places)
        batch = Batch(
            self._law,
            points,
            self._duration_s,
            self._criterion.window_s,
            trace_every=1,
            ledger=False,
            trace_last_s=WINDOW_S,
        )
        result = batch.run(self._threads)
        outcomes = judge(self._criterion, points, result)
        misplaced = np.abs(misplaced_m(points, result))
        table = np.array(
            [
                outcomes,
                outcomes == Outcome.SETTLED,
                result.peak_to_peak_m,
                misplaced,
                result.settled_s,
                result.damping_n_s_per_m,
                result.felt_mass_kg,
                misplaced / np.abs([balance_m(point) for point in points]),
                *felt_ends(points, result),
            ]
        ).reshape(len(GRID_COLUMNS), len(places), self._starts)
        rows = table.max(axis=2)
        rows[1] = table[1].sum(axis=1)
        found: list[Row] = rows.T.tolist()
        return found

    def edges(self, lines: Sequence[int]) -> list[Row]:
        """The rows of lines, all halved in step."""
        ys = [self._y.values[line] for line in lines]
        low, high = self._x.values[0], self._x.values[-1]
        at_low, at_high = self._settles([(low, y) for y in ys]), self._settles([(high, y) for y in ys])
        brackets = [[low, high] for _ in ys]
        for _ in range(_halvings(self._x)):
            middles = [self._x.between(*bracket) for bracket in brackets]
            settles = self._settles(list(zip(middles, ys, strict=True)))
            for bracket, middle, settled, settled_at_low in zip(brackets, middles, settles, at_low, strict=True):
                bracket[0 if settled == settled_at_low else 1] = middle
        rows: list[Row] = []
        for bracket, first, last in zip(brackets, at_low, at_high, strict=True):
            edge = bracket if first != last else [math.nan, math.nan]
            rows.append([int(first), int(last), *edge])
        return rows

    def _settles(self, places: Sequence[tuple[float, float]]) -> list[bool]:
        """Whether all starts of each place settle."""
        points = self._points_of(places)
        result = Batch(self._law, points, self._duration_s, self._criterion.window_s, ledger=False).run(self._threads)
        settled = judge(self._criterion, points, result) == Outcome.SETTLED
        found: list[bool] = settled.reshape(len(places), self._starts).all(axis=1).tolist()
        return found

    def _points_of(self, places: Sequence[tuple[float, float]]) -> list[Point]:
        return [point for x, y in places for point in self._points(x, y)]

    def _points(self, x: float, y: float) -> list[Point]:
        scenario = self._x.quantity.put(self._y.quantity.put(self._scenario, y), x)
        from_m = scenario.device.initial_position_m
        points = []
        for start in range(self._starts):
            drop_m = from_m + STARTS_SPREAD_M * start / max(1, self._starts - 1)
            device = scenario.device.model_copy(update={"initial_position_m": drop_m})
            points.append(replace(scenario, device=device).point(self._params, self._criterion))
        return points


def _halvings(axis: MapAxis) -> int:
    """How often to halve so that the bracket is no wider than a cell would be."""
    return max(1, math.ceil(math.log2(max(2, len(axis.values)))))


@lru_cache(maxsize=4)
def _scenario(text: str, name: str) -> PressScenario:
    return scenario_of(parse(text, name))
