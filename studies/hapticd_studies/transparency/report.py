"""The results as tables, CSV and JSON: what each law holds, what it costs a hand that moves, and what is felt."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from rich.markup import escape
from rich.table import Table

from hapticd.offline.outcome import Outcome
from hapticd.version import __version__
from hapticd_studies.grid.output import as_csv, as_json
from hapticd_studies.transparency import references
from hapticd_studies.transparency.devices import DRAWN, OUT_OF_SAMPLE, PARTS, Held
from hapticd_studies.transparency.hands import KINDS
from hapticd_studies.transparency.runs import COLUMNS
from hapticd_studies.transparency.summary import LawSummary, summary
from hapticd_studies.transparency.sweep import TransparencyPlan

Array = npt.NDArray[np.float64]

AT_REST_WORDS = (
    "held [%]: still and in place after a hard and a gentle arrival, without delay and late by one or two samples; "
    "still [%]: wherever; unfelt [%]: held with a felt index of at most 1; of those held, after the gentle one: felt, "
    "the median of that index; chatter of the force [N]; hard, gentle: settling time over that of the best constant "
    "damper; rate: rate-hardness over k"
)
MOVING_WORDS = (
    "need: damping weighted by its work over max(1.5 times the least constant damper, kT/2); base [%]: at most that "
    "after the hand; work: of the law over (k/2) sum dx^2; in, hold, out: force error [%]; pulls [%]: exits with a "
    "pull of more than 7 % of the push; leave: time to leave over that without a law, on walls that need none; k [%]: "
    "shown at 2 Hz"
)
"""What the heads of the tables mean."""

GROUPS = ("all", "no delay", "late", "below own limit")
"""Of the devices that some constant damper holds; `below own limit`: the wall needs no law at all. Out of sample, each
of `PARTS` is a group too."""


@dataclass(frozen=True, slots=True)
class TransparencyReport:
    """A finished study.

    Attributes:
        plan: what was wanted.
        devices: all of them.
        dampers: what constant dampers do, a row a device.
        tables: of each law a row a device.
        summaries: of each group one a law.
    """

    plan: TransparencyPlan
    devices: Sequence[Held]
    dampers: Array
    tables: Sequence[Array]
    summaries: dict[str, list[LawSummary]]

    def at_rest(self) -> Table:
        """For the terminal: what becomes of hands that come to stay."""
        shown = _table("held", "late", "still", "unfelt", "felt", "chatter", "hard", "gentle", "rate")
        for one, prompt, late in self._lines("no delay", "late"):
            shown.add_row(
                _label(one.law),
                *(_number(100.0 * value) for value in (prompt.held, late.held, one.still, one.unfelt)),
                *(_number(value) for value in (one.felt, one.chatter_n)),
                *(_number(value) for value in (one.settles_hard, one.settles_gentle, one.hardness)),
            )
        return shown

    def moving(self) -> Table:
        """For the terminal: what hands that move are given."""
        shown = _table("need", "base", "work", "in", "hold", "out", "pulls", "leave", "k")
        for one in self.summaries["all"]:
            shown.add_row(
                _label(one.law),
                _number(one.over_need["all"]),
                _number(100.0 * one.base_fits),
                _number(one.work_over_leak),
                *(_number(100.0 * value) for value in (*one.error, one.exits_felt)),
                _number(one.leaving),
                _number(100.0 * one.shown[0]),
            )
        return shown

    def parts(self) -> Table:
        """For the terminal: what is held out of sample, by what a device has that no law was made for."""
        shown = _table(*(f"held, {part}" for part in PARTS), *(f"unfelt, {part}" for part in PARTS))
        for _, *each in self._lines(*PARTS):
            values = [one.held for one in each] + [one.unfelt for one in each]
            shown.add_row(_label(each[0].law), *(_number(100.0 * value) for value in values))
        return shown

    def json(self) -> bytes:
        """For programs; the figures of each device are in the CSV file."""
        return as_json(
            {
                "study": "transparency",
                "hapticd": __version__,
                "seed": self.plan.seed,
                "devices": len(self.devices),
                "held_by_some_damper": int(np.isfinite(self.dampers[:, 0]).sum()),
                "hands": list(KINDS),
                "duration_s": self.plan.duration_s,
                "drawn": OUT_OF_SAMPLE if self.plan.out_of_sample else DRAWN,
                "criterion": self.plan.criterion.declared(),
                "groups": {name: [one.declared() for one in found] for name, found in self.summaries.items()},
            }
        )

    def csv(self) -> bytes:
        """One line a law and device."""
        first = self.devices[0].figures()
        return as_csv(("law", "device", *first, *references.COLUMNS, *COLUMNS), self._rows())

    def _rows(self) -> Iterator[list[Any]]:
        for law, table in zip(self.plan.laws, self.tables, strict=True):
            for device, dampers, row in zip(self.devices, self.dampers.tolist(), table.tolist(), strict=True):
                yield [law.label, device.name, *device.figures().values(), *dampers, *row]

    def _lines(self, *groups: str) -> Iterator[tuple[LawSummary, ...]]:
        return zip(self.summaries["all"], *(self.summaries[name] for name in groups), strict=True)


def report(plan: TransparencyPlan, tables: Sequence[Array]) -> TransparencyReport:
    """Sum up a finished study.

    Args:
        plan: what was wanted.
        tables: that of the constant dampers first, then one a law.
    """
    devices, dampers = plan.devices, tables[0]
    holdable = np.isfinite(dampers[:, references.COLUMNS.index("least_n_s_per_m")])
    late = np.array([device.late for device in devices])
    easy = np.array([device.own_share < 1.0 for device in devices])
    chosen = dict(zip(GROUPS, (holdable, holdable & ~late, holdable & late, holdable & easy), strict=True))
    if plan.out_of_sample:
        chosen |= {part: holdable & np.array([device.part == part for device in devices]) for part in PARTS}
    undamped = next((table for law, table in zip(plan.laws, tables[1:], strict=True) if law.label == "none"), None)
    summaries = {
        name: [
            summary(law.label, devices, dampers, table, undamped, group)
            for law, table in zip(plan.laws, tables[1:], strict=True)
        ]
        for name, group in chosen.items()
    }
    return TransparencyReport(plan, devices, dampers, tables[1:], summaries)


def figures_of(row: Sequence[float]) -> dict[str, str]:
    """A row for people, by column."""
    shown = {}
    for name, value in zip(COLUMNS, row, strict=True):
        text = Outcome(int(value)).words if name.endswith("_outcome") else f"{value:.4g}"
        shown[name] = "" if text == "nan" else text
    return shown


def _table(*heads: str) -> Table:
    shown = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    shown.add_column("law", no_wrap=True)
    for head in heads:
        shown.add_column(head, justify="right", min_width=5)
    return shown


def _label(law: str) -> str:
    return escape(law.replace("damping_n_s_per_m=", ""))


def _number(value: float) -> str:
    if not math.isfinite(value):
        return "" if math.isnan(value) else "never"
    size = abs(value)
    return f"{value:.0f}" if size >= 99.95 else f"{value:.1f}" if size >= 9.995 else f"{value:.2f}"
