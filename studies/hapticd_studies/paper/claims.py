"""What the paper claims, and whether it comes out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hapticd_studies.paper.readings import ReadingTable
from hapticd_studies.paper.recording import Recording, RunFigures
from hapticd_studies.paper.starts import Shares

HELD = ("fig9-12", "fig9-18", "fig9-20")
OFF_COUNT = tuple(f"{name}-off" for name in HELD)
"""The same under a hand that no whole number of counts balances."""

SHOWN_S = 0.5
"""What the paper's plots of its experiments show [s]."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """Everything that has been run.

    Attributes:
        runs: recordings by the name of their scenario.
        figures: their numbers.
        long: some of them again, much longer.
        shares: the studies over many starts.
        table: the readings.
    """

    runs: Mapping[str, Recording]
    figures: Mapping[str, RunFigures]
    long: Mapping[str, Recording]
    shares: Shares
    table: ReadingTable


@dataclass(frozen=True, slots=True)
class Claim:
    """One claim.

    Attributes:
        key: its name in files.
        source: where the paper says it.
        claim: what it says.
        scenario: what was run.
        measured: what came out.
        holds: whether that is what the paper says.
        remark: why not, or what to keep in mind.
    """

    key: str
    source: str
    claim: str
    scenario: str
    measured: str
    holds: bool
    remark: str = ""

    def declared(self) -> dict[str, Any]:
        """For a file of results."""
        return asdict(self)


def percent(share: float) -> str:
    """A share for people; all and none only when they are."""
    if share in (0.0, 1.0):
        return "all" if share else "none"
    return f"{min(max(share * 100.0, 0.1), 99.9):.3g} %"


def millimetres(span_m: float) -> str:
    """A span for people."""
    if not np.isfinite(span_m):
        return "without bound"
    if span_m < 1e-9:
        return "0"
    return f"{span_m * 1e3:.2g} mm" if span_m >= 1e-5 else f"{span_m * 1e6:.2g} um"
