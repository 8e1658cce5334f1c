"""The study in two parts: what stiffness each rate gets on a ladder, and random clients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hapticd_studies.grid.job import Job, block_cells, block_sizes, in_order
from hapticd_studies.grid.journal import Row
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.remote.network import Network
from hapticd_studies.remote.runs import COLUMNS, Case, draw, run

LAWS = "none,tdpa,ring-damping,energy-cycle,late-cycle"
"""The laws that are compared, the default of ports last."""

DAMPERS = tuple(f"damper:damping_n_s_per_m={value}" for value in (5, 10, 20, 50, 100))
"""Constant dampers that the laws are held against: what none of them keeps still, no law has to."""

KINDS = ("tool", "force")
RATES_HZ = (60.0, 200.0, 500.0, 1000.0)
DELAYS_S = (0.0, 0.01)
LADDER_N_PER_M = tuple(round(50.0 * 2.0 ** (at / 2.0), 1) for at in range(17))
"""Stiffnesses of the ladder: 50 N/m to 12.8 kN/m."""

_MOST_CELLS = 8


@dataclass(frozen=True, slots=True)
class RemotePlan:
    """What is wanted.

    Attributes:
        seed: of the random clients.
        count: how many of each kind.
        laws: those that are compared.
        dampers: the constant ones that they are held against.
        ladder: whether the ladder is climbed.
        hand: what the hand does to the random clients.
    """

    seed: int
    count: int
    laws: Sequence[LawSpec]
    dampers: Sequence[LawSpec]
    ladder: bool
    hand: str = "press"

    @property
    def all_laws(self) -> list[LawSpec]:
        """The laws, then the constant dampers."""
        return [*self.laws, *self.dampers]

    @property
    def random(self) -> list[Case]:
        """The random clients, kind by kind."""
        return [draw(self.seed, index, kind, self.hand) for kind in KINDS for index in range(self.count)]

    @property
    def rungs(self) -> list[tuple[Case, LawSpec]]:
        """Every rung of every ladder; the hand-tuned wall climbs without a law."""
        if not self.ladder:
            return []
        found = [(case, law) for kind in KINDS for case in _ladder(kind) for law in self.laws]
        return found + [(case, law) for case in _ladder("tamed") for law in self.laws if law.name == "none"]

    @property
    def cells(self) -> list[tuple[Case, LawSpec]]:
        """Every run."""
        return [*self.rungs, *((case, law) for case in self.random for law in self.all_laws)]

    def job(self) -> Job:
        """Cut into blocks."""
        spec = {
            "seed": self.seed,
            "count": self.count,
            "laws": [_plain(law) for law in self.laws],
            "dampers": [_plain(law) for law in self.dampers],
            "ladder": self.ladder,
            "hand": self.hand,
        }
        names = tuple(sorted({law.name for law in self.all_laws}))
        return Job(_block, spec, block_sizes(len(self.cells), _MOST_CELLS), names, interpreted=True)

    def table(self, blocks: Sequence[list[Row]]) -> list[dict[str, float]]:
        """What became of each run, in the order of `cells`."""
        sizes = block_sizes(len(self.cells), _MOST_CELLS)
        return [dict(zip(COLUMNS, row, strict=True)) for row in in_order(sizes, blocks)]


def _ladder(kind: str) -> list[Case]:
    return [
        Case(f"{kind} {rate_hz:g} Hz {delay_s * 1e3:g} ms", kind, stiffness, Network(rate_hz, delay_s))
        for rate_hz in RATES_HZ
        for delay_s in DELAYS_S
        for stiffness in LADDER_N_PER_M
    ]


def _plain(law: LawSpec) -> dict[str, Any]:
    return {"label": law.label, "name": law.name, "values": dict(law.values)}


def _block(spec: dict[str, Any], block: int, threads: int | None) -> list[Row]:
    laws, dampers = ([LawSpec(**each) for each in spec[name]] for name in ("laws", "dampers"))
    cells = RemotePlan(spec["seed"], spec["count"], laws, dampers, spec["ladder"], spec["hand"]).cells
    return [run(*cells[cell]) for cell in block_cells(block_sizes(len(cells), _MOST_CELLS), block)]
