"""Every case under every law, judged, block by block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hapticd.offline.outcome import Criterion
from hapticd_studies.grid.job import Job, block_cells, block_sizes, in_order
from hapticd_studies.grid.journal import Row
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.space_robustness.cases import Case, draw
from hapticd_studies.space_robustness.verdict import COLUMNS, judged

LAWS = "none,damper,tdpa,energy-cycle,ring-damping"

_MOST_CASES = 20

_MANY_CASES = 700
"""From here on every process makes machine code of the laws, which takes as long as some 300 cases interpreted."""


@dataclass(frozen=True, slots=True)
class SpaceRobustnessPlan:
    """What is wanted.

    Attributes:
        seed: of all cases.
        count: how many.
        laws: those that are compared.
        criterion: what still and in place mean.
    """

    seed: int
    count: int
    laws: Sequence[LawSpec]
    criterion: Criterion

    @property
    def cases(self) -> list[Case]:
        """The cases, in order."""
        return [draw(self.seed, index) for index in range(self.count)]

    def job(self) -> Job:
        """Cut into blocks of cases; each runs under every law in turn, since a linkage takes long to make ready."""
        spec = {
            "seed": self.seed,
            "laws": [{"label": law.label, "name": law.name, "values": dict(law.values)} for law in self.laws],
            "criterion": asdict(self.criterion),
            "sizes": block_sizes(self.count, _MOST_CASES),
            "compiled": self.count >= _MANY_CASES,
        }
        names = tuple(sorted({law.name for law in self.laws}))
        return Job(_block, spec, block_sizes(self.count, _MOST_CASES), names, interpreted=True)

    def tables(self, blocks: Sequence[list[Row]]) -> list[np.ndarray[Any, Any]]:
        """Of each law a table with a row a case."""
        rows = in_order(block_sizes(self.count, _MOST_CASES), blocks)
        whole = np.array(rows).reshape(self.count, len(self.laws), len(COLUMNS))
        return [whole[:, at] for at in range(len(self.laws))]


def _block(spec: dict[str, Any], block: int, _threads: int | None) -> list[Row]:
    """A row a case: what it did under the first law, then under the next."""
    laws, criterion = [LawSpec(**law) for law in spec["laws"]], Criterion(**spec["criterion"])
    cases = [draw(spec["seed"], index) for index in block_cells(spec["sizes"], block)]
    return [[value for law in laws for value in judged(case, law, criterion, spec["compiled"])] for case in cases]
