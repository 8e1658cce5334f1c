"""The results as table, CSV and JSON: who is steady, by law and by what the hand does, and every case that is not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from hapticd.version import __version__
from hapticd_studies.grid.output import as_csv, as_json
from hapticd_studies.space_robustness.cases import DRAWN, DURATION_S, HANDS, WITHIN_REACH, Case
from hapticd_studies.space_robustness.sweep import SpaceRobustnessPlan
from hapticd_studies.space_robustness.verdict import COLUMNS, GROWS, Verdict

_FELT = COLUMNS.index("felt_index")


@dataclass(frozen=True, slots=True)
class Steady:
    """How many of a group of cases are steady."""

    group: str
    steady: int
    cases: int

    @property
    def words(self) -> str:
        """For a table."""
        return f"{100.0 * self.steady / self.cases:.1f}" if self.cases else ""


@dataclass(frozen=True, slots=True)
class SpaceSummary:
    """One law.

    Attributes:
        law: its label.
        groups: all cases within reach, then those by what the hand does, then with and without friction, and beyond.
        by_surface: those within reach, by surface.
        median_felt: of the steady ones whose hand rests, the median felt index.
        not_steady: `seed:index` of those within reach that are not steady.
    """

    law: str
    groups: tuple[Steady, ...]
    by_surface: tuple[Steady, ...]
    median_felt: float | None
    not_steady: tuple[str, ...]


@dataclass(frozen=True)
class SpaceRobustnessReport:
    """A finished study: the plan, its cases, of each law a row a case, and the summary."""

    plan: SpaceRobustnessPlan
    cases: Sequence[Case]
    tables: Sequence[np.ndarray[Any, Any]]
    summaries: Sequence[SpaceSummary]

    def table(self) -> Table:
        """For the terminal: a line a law."""
        shown = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        shown.add_column("steady [%]", no_wrap=True)
        for each in self.summaries[0].groups:
            shown.add_column(each.group, justify="right", no_wrap=True)
        for one in self.summaries:
            shown.add_row(escape(one.law), *(each.words for each in one.groups))
        return shown

    def json(self) -> bytes:
        """For programs; the figures of each run are in the CSV file."""
        return as_json(
            {
                "study": "space-robustness",
                "hapticd": __version__,
                "seed": self.plan.seed,
                "cases": len(self.cases),
                "drawn": DRAWN,
                "duration_s": DURATION_S,
                "within_reach": f"stiffness below {WITHIN_REACH:g} of the damper peak of the lightest direction",
                "criterion": {**self.plan.criterion.declared(), "grows": GROWS, "words": criterion_words(self.plan)},
                "laws": [asdict(one) for one in self.summaries],
            }
        )

    def csv(self) -> bytes:
        """One line a case and law."""
        return as_csv(("law", "case", *self.cases[0].figures(), *COLUMNS), self._rows())

    def _rows(self) -> Iterator[list[Any]]:
        for law, table in zip(self.plan.laws, self.tables, strict=True):
            for case, (verdict, *figures) in zip(self.cases, table.tolist(), strict=True):
                yield [law.label, case.name, *case.figures().values(), Verdict(int(verdict)).words, *figures]


def criterion_words(plan: SpaceRobustnessPlan) -> str:
    """What steady means, in a few sentences."""
    still = plan.criterion
    return (
        f"steady: a hand that rests: over the last {still.window_s:g} s the true position spans at most "
        f"{still.still_m * 1e3:g} mm or {still.still_counts:g} steps of the sensor, and the device is within "
        f"{still.place_share * 100.0:g} % of the depth or {still.place_counts:g} steps of where forces balance; a hand "
        "that glides: the position from 40 Hz up spans no more than that in the last third; one that taps or rubs: it "
        f"spans no more than that, or than {GROWS:g} times what it spans in the third before"
    )


def report(plan: SpaceRobustnessPlan, tables: Sequence[np.ndarray[Any, Any]]) -> SpaceRobustnessReport:
    """Sum up a finished study."""
    cases = plan.cases
    summaries = [_summary(law.label, cases, table) for law, table in zip(plan.laws, tables, strict=True)]
    return SpaceRobustnessReport(plan, cases, tables, summaries)


def _summary(label: str, cases: Sequence[Case], table: np.ndarray[Any, Any]) -> SpaceSummary:
    rows = list(zip(cases, table.tolist(), strict=True))
    reached = [(case, row) for case, row in rows if case.within_reach]
    groups = [_steady("all", reached)]
    groups += [_steady(hand, [one for one in reached if one[0].hand == hand]) for hand in HANDS]
    groups += [
        _steady("smooth", [one for one in reached if not one[0].rough]),
        _steady("rough", [one for one in reached if one[0].rough]),
        _steady("beyond", [one for one in rows if not one[0].within_reach]),
    ]
    kinds = sorted({case.surface.kind for case in cases})
    surfaces = [_steady(kind, [one for one in reached if one[0].surface.kind == kind]) for kind in kinds]
    resting = [row[_FELT] for case, row in reached if case.hand in ("press", "let go") and row[0] == Verdict.STEADY]
    return SpaceSummary(
        label,
        tuple(groups),
        tuple(surfaces),
        float(np.median(resting)) if resting else None,
        tuple(case.name for case, row in reached if row[0] != Verdict.STEADY),
    )


def _steady(group: str, rows: Sequence[tuple[Case, list[float]]]) -> Steady:
    return Steady(group, sum(row[0] == Verdict.STEADY for _, row in rows), len(rows))
