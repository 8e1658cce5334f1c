"""The results as tables and JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from rich.markup import escape
from rich.table import Table

from hapticd.version import __version__
from hapticd_studies.grid.output import as_json
from hapticd_studies.targets.missed import Missed
from hapticd_studies.targets.plan import TargetsPlan
from hapticd_studies.targets.table import Reached, reached
from hapticd_studies.transparency.devices import draw
from hapticd_studies.transparency.summary import summary

Array = npt.NDArray[np.float64]

FEW = 500
"""Shares of fewer random devices stand with their interval."""


@dataclass(frozen=True, slots=True)
class Traded:
    """Where a law stands, of the devices that some constant damper holds, medians but for shares.

    Attributes:
        law: its label.
        held: share that is still and in place after both arrivals.
        settles_hard, settles_gentle: settling over the best constant damper's.
        over_need: damping weighted by its work over need.
        taps: the same under taps.
        pulls_percent: mean share of the exits with a pull of more than 7 % of the push.
    """

    law: str
    held: float
    settles_hard: float
    settles_gentle: float
    over_need: float
    taps: float
    pulls_percent: float


def targets_of(plan: TargetsPlan, tables: Sequence[dict[str, Array]]) -> dict[str, list[Reached]]:
    """Every target of every law."""
    return {law.label: reached(plan, tables[0], at, tables[1 + at]) for at, law in enumerate(plan.laws)}


def front_of(plan: TargetsPlan, tables: Sequence[dict[str, Array]]) -> list[Traded]:
    """Where each law stands."""
    devices, dampers = [draw(plan.seed, index) for index in range(plan.size.moved)], tables[0]["moved"]
    group = np.isfinite(dampers[:, 0])
    found = []
    for law, own in zip(plan.laws, tables[1:], strict=True):
        one = summary(law.label, devices, dampers, own["moved"], None, group)
        found.append(
            Traded(
                law.label,
                one.held,
                one.settles_hard,
                one.settles_gentle,
                one.over_need["all"],
                one.over_need["tap"],
                100.0 * one.exits_felt,
            )
        )
    return found


def table(plan: TargetsPlan, found: dict[str, list[Reached]]) -> Table:
    """For the terminal; * is a target that is reached."""
    shown = Table(box=None, pad_edge=False)
    shown.add_column("target")
    shown.add_column("asked", justify="right")
    shown.add_column("of", justify="right")
    for law in plan.laws:
        shown.add_column(escape(law.label), justify="right")
    for row in zip(*found.values(), strict=True):
        first = row[0]
        asked = f"{'>=' if first.at_least else '<='} {first.asked:g}"
        cells = (f"{one.reached:.4g}{'*' if one.met else ' '}" for one in row)
        shown.add_row(escape(first.what), asked, str(first.of), *cells)
    return shown


def markdown(plan: TargetsPlan, found: dict[str, list[Reached]]) -> str:
    """The same as a table of a page, with the 95 % intervals of shares of fewer than `FEW` random devices."""
    lines = [
        f"| target | asked | of | {' | '.join(f'`{law.label}`' for law in plan.laws)} |",
        f"|---|---|---|{'---|' * len(plan.laws)}",
    ]
    for row in zip(*found.values(), strict=True):
        first = row[0]
        asked = f"{'at least' if first.at_least else 'at most'} {first.asked:g}"
        lines.append(f"| {first.what} | {asked} | {first.of} | {' | '.join(_cell(one) for one in row)} |")
    return "\n".join(lines) + "\n"


def _cell(one: Reached) -> str:
    value = "-" if math.isnan(one.reached) else f"{one.reached:.3g}"
    if one.of < FEW and not math.isnan(one.low):
        value += f" ({one.low:.3g}-{one.high:.3g})"
    return f"**{value}**" if one.met else value


def front_table(points: Sequence[Traded]) -> Table:
    """For the terminal."""
    shown = Table(box=None, pad_edge=False)
    for head in ("law", "held [%]", "hard", "gentle", "need", "taps", "pulls [%]"):
        shown.add_column(head, justify="left" if head == "law" else "right")
    for one in points:
        numbers = (100.0 * one.held, one.settles_hard, one.settles_gentle, one.over_need, one.taps, one.pulls_percent)
        shown.add_row(escape(one.law), *(f"{value:.3g}" for value in numbers))
    return shown


def json_of(plan: TargetsPlan, found: dict[str, list[Reached]] | list[Traded], against: Sequence[Missed] = ()) -> bytes:
    """For programs; `against`: what stands against the targets that the first law misses."""
    content: Any = (
        [asdict(one) for one in found]
        if isinstance(found, list)
        else {law: [one.declared() for one in rows] for law, rows in found.items()}
    )
    more = {"missed": [one.declared() for one in against]} if against else {}
    head = {"study": "targets", "hapticd": __version__, "seed": plan.seed, "size": asdict(plan.size)}
    return as_json({**head, "criterion": plan.criterion.declared(), "laws": content, **more})
