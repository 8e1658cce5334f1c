"""The results as tables, JSON and CSV."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from statistics import median

from rich.markup import escape
from rich.table import Table

from hapticd.offline.outcome import Criterion, Outcome
from hapticd.version import __version__
from hapticd_studies.grid.output import as_csv, as_json
from hapticd_studies.remote.network import Network
from hapticd_studies.remote.runs import COLUMNS, Case
from hapticd_studies.remote.sweep import DELAYS_S, KINDS, RATES_HZ, TAMED, RemotePlan
from hapticd_studies.remote.windows import Lost, Row, Window, held, lost, windows

LADDER_WORDS = (
    "the stiffest of a ladder from 50 N/m to 12.8 kN/m that is still and in place, with all below it, at the client's "
    "rate and with so much more on the way there and back; tuned by hand: 50 ms low-pass, 40 N/s, clamp, a fifth of "
    "the force, still wherever it is"
)
RANDOM_WORDS = (
    "holdable: random clients that some law or constant damper keeps still and in place; of them: steady, wherever; "
    "held, in place too; unfelt, with a felt index of at most 1; of all: the largest force, and its largest step from "
    "one tick to the next; drag: what the law took of the device's motion from second 2 to 4, as a damping; leak: the "
    "same of what the client gave; both the median of all"
)
"""What the heads of the tables mean."""


@dataclass(frozen=True, slots=True)
class Shares:
    """What became of the random clients of one kind under one law.

    Attributes:
        kind, law: which.
        holdable: how many of them some constant damper, or a law in the table, keeps steady and in place.
        steady: how many of those the law keeps still.
        held: how many of those it keeps still and in place.
        unfelt: how many of those are held with a felt index of at most 1.
        largest_force_n: of all of the kind [N].
        largest_step_n: of force, from one tick to the next, of all of the kind [N].
        drag_n_s_per_m, leak_n_s_per_m: what the law took and the client gave, as a damping; the median [N s/m].
    """

    kind: str
    law: str
    holdable: int
    steady: int
    held: int
    unfelt: int
    largest_force_n: float
    largest_step_n: float
    drag_n_s_per_m: float
    leak_n_s_per_m: float


@dataclass(frozen=True, slots=True)
class Reach:
    """The stiffest of a ladder that is held, with all below it.

    Attributes:
        kind, law: which.
        rate_hz, delay_s: how the client is heard [Hz, s].
        stiffness_n_per_m: 0 where not even the first is held [N/m].
        shown_n_per_m: what is felt of it, pressing slowly [N/m].
    """

    kind: str
    law: str
    rate_hz: float
    delay_s: float
    stiffness_n_per_m: float
    shown_n_per_m: float


@dataclass(frozen=True, slots=True)
class RemoteReport:
    """A finished study.

    Attributes:
        plan: what was wanted.
        rows: what became of each run, in the order of the plan's cells.
        reaches: of the ladders.
        shares: of the random clients.
        windows: how many of them some constant damper holds, and of those each law.
        lost: those that some constant damper holds and the last law does not.
    """

    plan: RemotePlan
    rows: Sequence[Row]
    reaches: Sequence[Reach]
    shares: Sequence[Shares]
    windows: Sequence[Window]
    lost: Sequence[Lost]

    def ladder(self) -> Table:
        """For the terminal: the stiffness that each rate gets."""
        shown = _table("", *(f"{rate:g} Hz\n+{2e3 * delay:g} ms" for rate in RATES_HZ for delay in DELAYS_S))
        for kind in (*KINDS, TAMED):
            found = [reach for reach in self.reaches if reach.kind == kind]
            for law in dict.fromkeys(reach.law for reach in found):
                name = "tuned by hand" if kind == TAMED else law
                cells = [f"{reach.shown_n_per_m:.0f}" for reach in found if reach.law == law]
                shown.add_row("force" if kind == TAMED else kind, escape(name), *cells)
        return shown

    def random(self) -> Table:
        """For the terminal: the random clients."""
        shown = _table("law", "holdable", "steady", "held", "unfelt", "force [N]", "step [N]", "drag", "leak")
        for one in self.shares:
            label = escape(one.law.replace("damping_n_s_per_m=", ""))
            counts = (one.holdable, one.steady, one.held, one.unfelt)
            values = (one.largest_force_n, one.largest_step_n, one.drag_n_s_per_m, one.leak_n_s_per_m)
            shown.add_row(one.kind, label, *map(str, counts), *(f"{value:.3g}" for value in values))
        return shown

    def json(self) -> bytes:
        """For programs; the runs are in the CSV file."""
        return as_json(
            {
                "study": "remote",
                "hapticd": __version__,
                "seed": self.plan.seed,
                "clients_of_each_kind": self.plan.count,
                "hand": self.plan.hand,
                "come_in_s": self.plan.come_in_s,
                "criterion": Criterion().declared(),
                "ladder": [asdict(one) for one in self.reaches],
                "random": [asdict(one) for one in self.shares],
                "window_n_s_per_m": [law.values.get("damping_n_s_per_m", 0.0) for law in self.plan.window],
                "windows": [asdict(one) for one in self.windows],
                "lost": [asdict(one) for one in self.lost],
            }
        )

    def csv(self) -> bytes:
        """One line a run."""
        network = [field.name for field in fields(Network)]
        names = ("client", "kind", "law", "stiffness_n_per_m", *network, *COLUMNS)
        lines = []
        for (case, law), row in zip(self.plan.cells, self.rows, strict=True):
            heard = [getattr(case.network, name) for name in network]
            lines.append([case.name, case.kind, law.label, case.stiffness_n_per_m, *heard, *map(row.get, COLUMNS)])
        return as_csv(names, lines)


def report(plan: RemotePlan, rows: Sequence[Row]) -> RemoteReport:
    """Sum up a finished study."""
    rungs = len(plan.rungs)
    size = len(plan.all_laws) + len(plan.window)
    each = [rows[at : at + size] for at in range(rungs, len(rows), size)]
    return RemoteReport(
        plan, rows, _reaches(plan, rows[:rungs]), _shares(plan, each), windows(plan, each), lost(plan, each)
    )


def _reaches(plan: RemotePlan, rows: Sequence[Row]) -> list[Reach]:
    found: dict[tuple[str, str, float, float], list[tuple[Case, bool]]] = {}
    for (case, law), row in zip(plan.rungs, rows, strict=True):
        key = (case.kind, law.label, case.network.rate_hz, case.network.delay_s)
        steady = row["outcome"] in (Outcome.SETTLED, Outcome.ELSEWHERE) if case.kind == TAMED else held(row)
        found.setdefault(key, []).append((case, steady))
    reaches = []
    for (kind, label, rate_hz, delay_s), ladder in found.items():
        best: Case | None = None
        for case, steady in ladder:
            if not steady:
                break
            best = case
        share = 0.2 if kind == TAMED else 1.0
        stiffness = best.stiffness_n_per_m if best else 0.0
        shown = share * best.client().stiffness_n_per_m if best else 0.0
        reaches.append(Reach(kind, label, rate_hz, delay_s, stiffness, shown))
    return reaches


def _shares(plan: RemotePlan, rows: Sequence[Sequence[Row]]) -> list[Shares]:
    laws = plan.all_laws
    each = [dict(zip([law.label for law in laws], found, strict=False)) for found in rows]
    shares = []
    for at, kind in enumerate(KINDS):
        mine = each[at * plan.count : (at + 1) * plan.count]
        holdable = [found for found in mine if any(held(row) for row in found.values())]
        for law in laws:
            of_law = [found[law.label] for found in holdable]
            shares.append(
                Shares(
                    kind,
                    law.label,
                    len(holdable),
                    sum(row["outcome"] in (Outcome.SETTLED, Outcome.ELSEWHERE) for row in of_law),
                    sum(map(held, of_law)),
                    sum(held(row) and row["felt"] <= 1.0 for row in of_law),
                    max((found[law.label]["peak_force_n"] for found in mine), default=0.0),
                    max((found[law.label]["largest_step_n"] for found in mine), default=0.0),
                    median(found[law.label]["drag_n_s_per_m"] for found in mine),
                    median(found[law.label]["leak_n_s_per_m"] for found in mine),
                )
            )
    return shares


def _table(*heads: str) -> Table:
    shown = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    shown.add_column("client", no_wrap=True)
    for head in heads:
        shown.add_column(head, justify="left" if head in ("", "law") else "right")
    return shown
