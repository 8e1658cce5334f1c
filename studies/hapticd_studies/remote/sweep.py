"""The study in two parts: what stiffness each rate gets on a ladder, and random clients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

from hapticd.config.remote import COME_IN_S
from hapticd_studies.grid.job import Job, block_cells, block_sizes, in_order
from hapticd_studies.grid.journal import Row
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.remote.compiled import CompiledCase
from hapticd_studies.remote.network import Network
from hapticd_studies.remote.runs import COLUMNS, Case, draw, run

LAWS = "none,tdpa,ring-damping,energy-cycle,late-cycle"
"""The laws that are compared, the default of ports last."""

DAMPERS = tuple(f"damper:damping_n_s_per_m={value}" for value in (5, 10, 20, 50, 100))
"""Constant dampers that the laws are held against: what none of them keeps still, no law has to."""

WINDOW = tuple(round(2.0 * 1.15**at, 1) for at in range(42))
"""Constant dampers that tell the window of each random client, beside none: 2 to 616 N s/m [N s/m]."""

KINDS = ("tool", "force")
TAMED = "tamed"
RATES_HZ = (60.0, 200.0, 500.0, 1000.0)
DELAYS_S = (0.0, 0.01)
LADDER_N_PER_M = tuple(round(50.0 * 2.0 ** (at / 2.0), 1) for at in range(17))
"""Stiffnesses of the ladder: 50 N/m to 12.8 kN/m."""

_MOST_CASES = 8


@dataclass(frozen=True, slots=True)
class RemotePlan:
    """What is wanted.

    Attributes:
        seed: of the random clients.
        count: how many of each kind.
        laws: those that are compared.
        dampers: the constant ones that they are held against.
        window: constant dampers more that tell each client's window; none tells no window.
        ladder: whether the ladder is climbed.
        hand: what the hand does to the random clients.
        come_in_s: in which all couplings come to their stiffness, under laws and dampers alike [s].
    """

    seed: int
    count: int
    laws: Sequence[LawSpec]
    dampers: Sequence[LawSpec]
    window: Sequence[LawSpec]
    ladder: bool
    hand: str = "press"
    come_in_s: float = COME_IN_S

    @property
    def all_laws(self) -> list[LawSpec]:
        """The laws, then the constant dampers."""
        return [*self.laws, *self.dampers]

    @property
    def random(self) -> list[Case]:
        """The random clients, kind by kind."""
        each = [(kind, index) for kind in KINDS for index in range(self.count)]
        return [draw(self.seed, index, kind, self.hand, self.come_in_s) for kind, index in each]

    @property
    def work(self) -> list[tuple[Case, list[LawSpec]]]:
        """Every client with the laws that it is run under."""
        return self._climbed + [(case, [*self.all_laws, *self.window]) for case in self.random]

    @property
    def rungs(self) -> list[tuple[Case, LawSpec]]:
        """Every rung of every ladder under every law; the hand-tuned wall climbs without one."""
        return [(case, law) for case, laws in self._climbed for law in laws]

    @property
    def cells(self) -> list[tuple[Case, LawSpec]]:
        """Every run."""
        return [(case, law) for case, laws in self.work for law in laws]

    @property
    def runs(self) -> int:
        """How many there are."""
        return sum(len(laws) for _, laws in self.work)

    @property
    def _climbed(self) -> list[tuple[Case, list[LawSpec]]]:
        if not self.ladder:
            return []
        none = [law for law in self.laws if law.name == "none"]
        found = [(case, list(self.laws)) for kind in KINDS for case in _ladder(kind, self.come_in_s)]
        return found + [(case, none) for case in _ladder(TAMED, self.come_in_s) if none]

    def job(self) -> Job:
        """Cut into blocks."""
        spec = {
            "seed": self.seed,
            "count": self.count,
            "laws": [_plain(law) for law in self.laws],
            "dampers": [_plain(law) for law in self.dampers],
            "window": [_plain(law) for law in self.window],
            "ladder": self.ladder,
            "hand": self.hand,
            "come_in_s": self.come_in_s,
        }
        names = tuple(sorted({law.name for law in self.all_laws}))
        return Job(_block, spec, block_sizes(len(self.work), _MOST_CASES), names, interpreted=True)

    def table(self, blocks: Sequence[list[Row]]) -> list[dict[str, float]]:
        """What became of each run, in the order of `cells`."""
        numbers = list(chain.from_iterable(in_order(block_sizes(len(self.work), _MOST_CASES), blocks)))
        size = len(COLUMNS)
        rows = [numbers[at : at + size] for at in range(0, len(numbers), size)]
        return [dict(zip(COLUMNS, row, strict=True)) for row in rows]


def _ladder(kind: str, come_in_s: float) -> list[Case]:
    return [
        Case(
            f"{kind} {rate_hz:g} Hz {delay_s * 1e3:g} ms",
            kind,
            stiffness,
            Network(rate_hz, delay_s),
            come_in_s=come_in_s,
        )
        for rate_hz in RATES_HZ
        for delay_s in DELAYS_S
        for stiffness in LADDER_N_PER_M
    ]


def _plain(law: LawSpec) -> dict[str, Any]:
    return {"label": law.label, "name": law.name, "values": dict(law.values)}


def _block(spec: dict[str, Any], block: int, threads: int | None) -> list[Row]:
    laws, dampers, window = ([LawSpec(**each) for each in spec[name]] for name in ("laws", "dampers", "window"))
    more = {name: spec[name] for name in ("seed", "count", "ladder", "hand", "come_in_s")}
    work = RemotePlan(laws=laws, dampers=dampers, window=window, **more).work
    return [_became(*work[at]) for at in block_cells(block_sizes(len(work), _MOST_CASES), block)]


def _became(case: Case, laws: Sequence[LawSpec]) -> Row:
    """The rows of a client under its laws, one after the other."""
    if case.kind == TAMED:
        return list(chain.from_iterable(run(case, law) for law in laws))
    ready = CompiledCase(case)
    return list(chain.from_iterable(ready.run(law) for law in laws))
