"""The window of each random client: which constant dampers hold it, and what the default law makes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich.table import Table

from hapticd.offline.outcome import Outcome
from hapticd_studies.remote.runs import Case
from hapticd_studies.remote.sweep import KINDS, RemotePlan

Row = dict[str, float]

NARROW = 3
"""Fewer dampers than this are a narrow window: from one to the next is 15 %."""

THROWN_M = 2e-4
"""What moves by more, four times what is still, swings; what moves by less may be kicked by lost messages [m]."""

WINDOW_WORDS = (
    "window: none and 42 constant dampers, 2 to 616 N s/m, each 15 % above the one before; held by a damper: clients "
    "that one of them at least keeps still and in place; wide: of those, by 3 at least; not held: by the law, of all "
    "and of the wide; and within 0.2 mm: of the wide, not still, and within that"
)
"""What the heads of the table mean."""


@dataclass(frozen=True, slots=True)
class Window:
    """How many clients of a kind some constant damper holds, and what a law makes of those.

    Attributes:
        kind, law: which.
        held_by_dampers: clients that at least one damper holds.
        wide: of them those that `NARROW` dampers hold at least.
        not_held: of all of them what the law does not hold.
        wide_not_held: of the wide.
        wide_within: of the last those that end within `THROWN_M`.
    """

    kind: str
    law: str
    held_by_dampers: int
    wide: int
    not_held: int
    wide_not_held: int
    wide_within: int


@dataclass(frozen=True, slots=True)
class Lost:
    """A client that some constant damper holds and the last law does not.

    Attributes:
        client: KIND:SEED:INDEX, for `--replay`.
        stiffness_n_per_m: of the coupling or the wall [N/m].
        rate_hz: of the client [Hz].
        late_s: from a position to the force that answers it, on average [s].
        loss: share of its messages that are lost.
        lowest_n_s_per_m, highest_n_s_per_m: of the dampers that hold it [N s/m].
        dampers: how many of them do.
        span_m: how far it moves at the end under the law; infinite where it has left all bounds [m].
        outcome: of the law.
    """

    client: str
    stiffness_n_per_m: float
    rate_hz: float
    late_s: float
    loss: float
    lowest_n_s_per_m: float
    highest_n_s_per_m: float
    dampers: int
    span_m: float
    outcome: str


def held(row: Row) -> bool:
    """Still and in place at the end."""
    return row["outcome"] == Outcome.SETTLED


def windows(plan: RemotePlan, rows: Sequence[Sequence[Row]]) -> list[Window]:
    """A row a kind and law.

    Args:
        plan: of the study.
        rows: of each random client under all laws, dampers and those of the window.
    """
    found = []
    for at, law in enumerate(plan.laws):
        for kind in KINDS if plan.window else ():
            each = [
                (len(_values(plan, of)), of[at])
                for case, of in zip(plan.random, rows, strict=True)
                if case.kind == kind
            ]
            lost_ones = [(count, row) for count, row in each if count and not held(row)]
            wide = [row for count, row in lost_ones if count >= NARROW]
            found.append(
                Window(
                    kind,
                    law.label,
                    sum(count > 0 for count, _ in each),
                    sum(count >= NARROW for count, _ in each),
                    len(lost_ones),
                    len(wide),
                    sum(row["span_m"] <= THROWN_M for row in wide),
                )
            )
    return found


def lost(plan: RemotePlan, rows: Sequence[Sequence[Row]]) -> list[Lost]:
    """Each client that some damper holds and the last of the plan's laws does not.

    Args:
        plan: of the study.
        rows: of each random client under all laws, dampers and those of the window.
    """
    found = []
    for case, of in zip(plan.random, rows, strict=True):
        values, row = _values(plan, of), of[len(plan.laws) - 1]
        if values and not held(row):
            found.append(_lost(case, values, row))
    return found


def windows_table(found: Sequence[Window]) -> Table:
    """For the terminal."""
    shown = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    for head in ("client", "law", "held by a damper", "wide", "not held", "wide", "and within 0.2 mm"):
        shown.add_column(head, justify="left" if head in ("client", "law") else "right")
    for one in found:
        counts = (one.held_by_dampers, one.wide, one.not_held, one.wide_not_held, one.wide_within)
        shown.add_row(one.kind, one.law, *map(str, counts))
    return shown


def lost_table(found: Sequence[Lost]) -> Table:
    """For the terminal: those that end beyond `THROWN_M`, or out of place."""
    shown = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    heads = ("client", "k [N/m]", "rate [Hz]", "late [ms]", "loss [%]", "dampers [N s/m]", "of 43", "moves by [mm]")
    for head in heads:
        shown.add_column(head, justify="left" if head == "client" else "right")
    for one in found:
        if one.span_m > THROWN_M or one.outcome != Outcome.MOVING.words:
            shown.add_row(
                one.client,
                f"{one.stiffness_n_per_m:.0f}",
                f"{one.rate_hz:.0f}",
                f"{1e3 * one.late_s:.0f}",
                f"{1e2 * one.loss:.0f}",
                f"{one.lowest_n_s_per_m:.3g} to {one.highest_n_s_per_m:.3g}",
                str(one.dampers),
                f"{1e3 * one.span_m:.2g}",
            )
    return shown


def _values(plan: RemotePlan, rows: Sequence[Row]) -> list[float]:
    """The dampers of the window that hold a client [N s/m]."""
    first = len(plan.all_laws)
    laws = zip(plan.window, rows[first:], strict=True)
    return [float(dict(law.values).get("damping_n_s_per_m", 0.0)) for law, row in laws if held(row)]


def _lost(case: Case, values: Sequence[float], row: Row) -> Lost:
    network = case.network
    return Lost(
        f"{case.kind}:{case.name}",
        case.stiffness_n_per_m,
        network.rate_hz,
        network.late_s,
        network.loss,
        min(values),
        max(values),
        len(values),
        row["span_m"],
        Outcome(int(row["outcome"])).words,
    )
