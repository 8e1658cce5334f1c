"""What the paper claims, and whether it comes out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hapticd.study.paper.readings import Table
from hapticd.study.paper.recording import Figures, Recording
from hapticd.study.paper.starts import Shares

HELD = ("fig9-12", "fig9-18", "fig9-20")


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
    figures: Mapping[str, Figures]
    long: Mapping[str, Recording]
    shares: Shares
    table: Table


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


def judge(evidence: Evidence) -> list[Claim]:
    """Every claim, in the order of the paper."""
    from hapticd.study.paper import experiments, simulations, window

    judges: list[Callable[[Evidence], list[Claim]]] = [simulations.claims, window.claims, experiments.claims]
    return [claim for judged in judges for claim in judged(evidence)]


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
