"""The results in a few lines, and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hapticd.offline.outcome import Criterion
from hapticd.version import __version__
from hapticd_studies.extremes.case import DRAWN, LAWS, draw
from hapticd_studies.extremes.ceilings import Break
from hapticd_studies.extremes.findings import ExtremesFinding, findings
from hapticd_studies.extremes.long_run import LongRun
from hapticd_studies.extremes.step_map import DIGITS
from hapticd_studies.extremes.sweep import BALANCE_SHARE, COLUMNS, TICKS, VALUE_SHARE, ExtremesPlan
from hapticd_studies.extremes.verdict import MARGIN, Verdict
from hapticd_studies.grid.output import as_json

_MOST_KEPT = 10_000


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the summary.

    Attributes:
        name: of what was looked at.
        text: what came out.
        holds: whether it is as it must be.
    """

    name: str
    text: str
    holds: bool


@dataclass(frozen=True, slots=True)
class ExtremesReport:
    """A finished study.

    Attributes:
        plan: what was wanted.
        table: a row a place, by `COLUMNS`.
        found: by the index of its place, whatever does not agree to the letter.
        days: the long runs; empty when they were not wanted.
    """

    plan: ExtremesPlan
    table: np.ndarray[Any, Any]
    found: dict[int, list[ExtremesFinding]]
    days: Sequence[LongRun]

    def column(self, name: str) -> np.ndarray[Any, Any]:
        """One column of the table."""
        values: np.ndarray[Any, Any] = self.table[:, COLUMNS.index(name)]
        return values

    @property
    def disagreements(self) -> list[tuple[int, ExtremesFinding]]:
        """What no limit of double precision explains: index of the place, and what."""
        return [(index, one) for index, listed in self.found.items() for one in listed if not one.explained]

    @property
    def holds(self) -> bool:
        """Whether everything is as it must be."""
        return all(line.holds for line in self.lines())

    def command(self, index: int) -> str:
        """What runs one place alone."""
        return f"hapticd study extremes --point {self.plan.seed}:{index}"

    def lines(self) -> list[Line]:
        """The summary."""
        return [self._verdicts(), self._books(), self._ledger(), self._laws(), self._range(), self._refusals()] + [
            _day(day) for day in self.days
        ]

    def json(self) -> bytes:
        """For programs."""
        return as_json(
            {
                "study": "extremes",
                "hapticd": __version__,
                "seed": self.plan.seed,
                "places": self.plan.count,
                "drawn": DRAWN,
                "ticks": TICKS,
                "marginal": f"spectral radius within {MARGIN:g} of 1",
                "criterion": Criterion().declared(),
                "holds": self.holds,
                "summary": [asdict(line) for line in self.lines()],
                "counts": {
                    "refused": int(np.sum(self.column("refused") > 0.0)),
                    **{one.words: int(np.sum(self.column("exact") == one)) for one in Verdict},
                    "left_range": int(np.sum(self.column("left_range") == 1.0)),
                    "same_radius": int(np.sum(self.column("same_radius") == 1.0)),
                },
                "laws": self.law_counts(),
                "disagreements": self._listed(explained=False),
                "explained": self._listed(explained=True),
                "days": [asdict(day) for day in self.days],
            }
        )

    def law_counts(self) -> dict[str, dict[str, int]]:
        """Of each law: in how many stable loops its damping, held, would make what of them."""
        laws = np.array([draw(self.plan.seed, index).law for index in range(self.plan.count)])
        breaks = self.column("law_break")
        return {law: {one.words: int(np.sum((laws == law) & (breaks == one))) for one in Break} for law in LAWS}

    def _listed(self, explained: bool) -> list[dict[str, Any]]:
        rows = [
            {"point": f"{self.plan.seed}:{index}", **asdict(one), "command": self.command(index)}
            for index, listed in self.found.items()
            for one in listed
            if bool(one.explained) is explained
        ]
        return rows[:_MOST_KEPT]

    def _of(self, *kinds: str) -> tuple[int, int]:
        """How many findings of these kinds are explained, and how many are not."""
        chosen = [one for listed in self.found.values() for one in listed if one.kind in kinds]
        explained = sum(bool(one.explained) for one in chosen)
        return explained, len(chosen) - explained

    def _verdicts(self) -> Line:
        exact = self.column("exact")
        judged = int(np.sum(~np.isnan(exact)))
        explained, wrong = self._of("verdict", "radius", "not a number")
        counts = ", ".join(f"{np.sum(exact == one)} {one.words}" for one in Verdict)
        beside = f", {explained} beside an edge by less than rounding" if explained else ""
        squared = int(np.sum(self.column("in_decimals")))
        if squared:
            beside += f", {squared} squared with {DIGITS} digits"
        text = f"{judged - explained - wrong} of {judged} as the exact eigenvalues{beside}; {counts}"
        return Line("linear loop", f"{text}; every radius to {VALUE_SHARE:g}", wrong == 0)

    def _books(self) -> Line:
        runs = int(np.sum(~np.isnan(self.column("balance"))))
        explained, wrong = self._of("books", "books of the wall")
        text = f"{runs - explained - wrong} of {runs} runs of {TICKS} ticks balance to {BALANCE_SHARE:g}"
        if explained:
            text += f", {explained} to a bound of their own rounding"
        return Line("energy books", text, wrong == 0)

    def _ledger(self) -> Line:
        worst = float(np.nanmax(self.column("ledger"), initial=0.0))
        _, wrong = self._of("ledger")
        return Line(
            "ledger", f"energy, generated, dissipated: at most {worst:.1g} from the independent sums", wrong == 0
        )

    def _laws(self) -> Line:
        breaks = self.column("law_break")
        stable = int(np.sum(~np.isnan(breaks)))
        damped = int(np.sum(~np.isnan(breaks) & (self.column("damping_n_s_per_m") > 0.0)))
        beyond, held = int(np.sum(breaks == Break.CEILING)), int(np.sum(breaks == Break.HELD))
        _, wrong = self._of("law")
        text = (
            f"to {damped} of {stable} stable loops the law brought damping; with the most of it held {beyond} would be "
            f"unstable beyond a published ceiling, {held} on a spring, for which there is none, {wrong} otherwise"
        )
        return Line("laws", text, wrong == 0)

    def _range(self) -> Line:
        left = int(np.sum(self.column("left_range") == 1.0))
        _, wrong = self._of("range", "not a number")
        return Line("range", f"{left} runs ended beyond 1e6 m or 1e6 m/s, as the exact step does; no NaN", wrong == 0)

    def _refusals(self) -> Line:
        refused = int(np.sum(self.column("refused") == 1.0))
        _, wrong = self._of("refusal")
        return Line("refusals", f"{refused} places, each by a parameter and a limit that it is beyond", wrong == 0)


def report(plan: ExtremesPlan, table: np.ndarray[Any, Any], days: Sequence[LongRun]) -> ExtremesReport:
    """Sum up a finished study."""
    found = {}
    for index, values in enumerate(table.tolist()):
        listed = findings(draw(plan.seed, index), dict(zip(COLUMNS, values, strict=True)))
        if listed:
            found[index] = listed
    return ExtremesReport(plan, table, found, days)


def _day(day: LongRun) -> Line:
    worst = max(day.errors.values())
    text = (
        f"{day.ticks:.4g} ticks, {day.hand}: sums to {worst:.1g}; {day.cycles_at_first} cycles in the first tenth, "
        f"{day.cycles_at_last} in the last; then on a stiffer wall {day.kept_outcome.words} with the "
        f"{day.damping_n_s_per_m:.3g} N s/m of that day ({day.kept_n_s_per_m:.3g} at the end; felt {day.felt[0]:.2g}, "
        f"force spans {day.chatter_n[0]:.2g} N), and after these were set to 0 {day.outcome.words} with "
        f"{day.adapted_n_s_per_m:.3g} (felt {day.felt[1]:.2g}, force spans {day.chatter_n[1]:.2g} N)"
    )
    return Line("a day", text, day.holds)
