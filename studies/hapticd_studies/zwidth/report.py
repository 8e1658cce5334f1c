"""The results of a map as table, CSV and JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from hapticd.config.loading import parse
from hapticd.offline.felt import JUST_FELT
from hapticd.offline.outcome import PRESSED, Outcome
from hapticd.version import __version__
from hapticd_studies.boundaries import BOUNDARIES
from hapticd_studies.grid.output import as_csv, as_json
from hapticd_studies.zwidth.curves import Curve, curves, limits
from hapticd_studies.zwidth.scenario import scenario_of
from hapticd_studies.zwidth.sweep import EDGE_COLUMNS, GRID_COLUMNS, ZwidthPlan


@dataclass(frozen=True, slots=True)
class ZwidthSummary:
    """One law in a map.

    Attributes:
        law: what the user called it.
        settled: cells that settled; with bisection, lines whose low end did.
        cells: all of them.
        settled_share: their share.
        lowest_edge, median_edge: where lines change; None without any edge.
        as_linear: share of cells whose verdict is the one of the exact linear limit; None where that says nothing.
        not_felt: of the cells that settled, the share whose rest is below the threshold of touch; None without any.
        without_edge: how many lines have no edge because all or none of them settles.
    """

    law: str
    settled: int
    cells: int
    settled_share: float
    lowest_edge: float | None
    median_edge: float | None
    as_linear: float | None
    not_felt: float | None = None
    without_edge: tuple[tuple[int, str], ...] = ()


@dataclass(frozen=True, slots=True)
class ZwidthReport:
    """A finished map.

    Attributes:
        plan: what was wanted.
        tables: of each law its rows.
        curves: the analytic limits.
        summaries: of each law.
    """

    plan: ZwidthPlan
    tables: Sequence[np.ndarray[Any, Any]]
    curves: Sequence[Curve]
    summaries: Sequence[ZwidthSummary]

    def table(self) -> Table:
        """For the terminal."""
        plan = self.plan
        cells = plan.method == "grid"
        shown = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        shown.add_column("law", overflow="fold")
        heads = (
            ["settled cells", "share", "not felt", "as the linear limit"]
            if cells
            else ["lines", "lowest edge", "median edge", "without an edge"]
        )
        for head in heads:
            shown.add_column(head, justify="right")
        unit = f" {plan.x.quantity.unit}"
        for one in self.summaries:
            if cells:
                linear = "" if one.as_linear is None else f"{100.0 * one.as_linear:.1f} %"
                not_felt = "" if one.not_felt is None else f"{100.0 * one.not_felt:.1f} %"
                row = [f"{one.settled} / {one.cells}", f"{100.0 * one.settled_share:.1f} %", not_felt, linear]
            else:
                edges = (one.lowest_edge, one.median_edge)
                row = [str(one.cells), *("" if edge is None else f"{edge:.5g}{unit}" for edge in edges)]
                row.append(", ".join(f"{count} {word} settle" for count, word in one.without_edge if count))
            shown.add_row(escape(one.law), *row)
        return shown

    def json(self) -> bytes:
        """For programs; the figures of each cell are in the CSV file."""
        plan = self.plan
        return as_json(
            {
                "study": "zwidth",
                "hapticd": __version__,
                "press": plan.text,
                "method": plan.method,
                "duration_s": plan.duration_s,
                "starts": plan.starts,
                "criterion": plan.criterion.declared(),
                "x": plan.x.declared(),
                "y": plan.y.declared(),
                "outcomes": {str(int(outcome)): outcome.words for outcome in PRESSED},
                "laws": [
                    {
                        "law": one.law,
                        "settled": one.settled,
                        "cells": one.cells,
                        "settled_share": one.settled_share,
                        "not_felt_share_of_settled": one.not_felt,
                        "lowest_edge": one.lowest_edge,
                        "median_edge": one.median_edge,
                        "same_verdict_as_linear_limit": one.as_linear,
                        "map": self._map(table),
                    }
                    for one, table in zip(self.summaries, self.tables, strict=True)
                ],
                "boundaries": [{"key": curve.key, "label": curve.label, "lines": curve.lines} for curve in self.curves],
            }
        )

    def csv(self) -> bytes:
        """One line a cell; with bisection, a line a line."""
        plan = self.plan
        if plan.method == "grid":
            return as_csv(("law", plan.x.quantity.column, plan.y.quantity.column, *GRID_COLUMNS), self._cells())
        columns = (
            "law",
            plan.y.quantity.column,
            *(name.replace("edge", plan.x.quantity.column) for name in EDGE_COLUMNS),
        )
        return as_csv(columns, self._lines())

    def _cells(self) -> Iterator[list[Any]]:
        plan = self.plan
        for reading, table in zip(plan.readings, self.tables, strict=True):
            places = ((x, y) for y in plan.y.values for x in plan.x.values)
            for (x, y), (outcome, settled, *figures) in zip(places, table.tolist(), strict=True):
                yield [reading.label, x, y, Outcome(int(outcome)).name.lower(), int(settled), *figures]

    def _lines(self) -> Iterator[list[Any]]:
        for reading, table in zip(self.plan.readings, self.tables, strict=True):
            for y, (at_low, at_high, *edge) in zip(self.plan.y.values, table.tolist(), strict=True):
                yield [reading.label, y, int(at_low), int(at_high), *edge]

    def _map(self, table: np.ndarray[Any, Any]) -> list[Any]:
        if self.plan.method == "grid":
            rows: list[Any] = table[:, 0].astype(int).reshape(len(self.plan.y.values), -1).tolist()
            return rows
        edges: list[Any] = table[:, 2:4].tolist()
        return edges


def report(plan: ZwidthPlan, tables: Sequence[np.ndarray[Any, Any]]) -> ZwidthReport:
    """Sum up a finished map."""
    scenario = scenario_of(parse(plan.text, plan.name))
    stable = limits(BOUNDARIES[0], scenario, plan.x, plan.y) if plan.method == "grid" else None
    summaries = [
        _cells_summary(reading.label, table, stable) if stable is not None else _edge_summary(reading.label, table)
        for reading, table in zip(plan.readings, tables, strict=True)
    ]
    return ZwidthReport(plan, tables, curves(scenario, plan.x, plan.y), summaries)


def _cells_summary(law: str, table: np.ndarray[Any, Any], stable: np.ndarray[Any, Any]) -> ZwidthSummary:
    settled = table[:, 0] == Outcome.SETTLED
    known = ~np.isnan(stable).ravel()
    same = settled[known] == (stable.ravel()[known] > 1.0)
    linear = float(same.mean()) if law == "none" and known.any() else None
    felt = table[settled, GRID_COLUMNS.index("felt_index")]
    not_felt = float((felt <= JUST_FELT).mean()) if len(felt) else None
    return ZwidthSummary(law, int(settled.sum()), len(table), float(settled.mean()), None, None, linear, not_felt)


def _edge_summary(law: str, table: np.ndarray[Any, Any]) -> ZwidthSummary:
    edges = table[:, 2][~np.isnan(table[:, 2])]
    some = len(edges) > 0
    return ZwidthSummary(
        law,
        int(table[:, 0].sum()),
        len(table),
        float(np.mean(table[:, 0])),
        float(edges.min()) if some else None,
        float(np.median(edges)) if some else None,
        None,
        without_edge=tuple(
            (int(np.sum((table[:, 0] == at) & (table[:, 1] == at))), word) for at, word in ((1, "all"), (0, "none"))
        ),
    )
