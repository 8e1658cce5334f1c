"""Every claim of the paper, judged by what was run."""

from __future__ import annotations

from collections.abc import Callable

from hapticd_studies.paper import argument, experiments, passivity, qualities, simulations, window
from hapticd_studies.paper.claims import Claim, Evidence


def judge(evidence: Evidence) -> list[Claim]:
    """Every claim, in the order of the paper."""
    judges: list[Callable[[Evidence], list[Claim]]] = [
        simulations.claims,
        argument.claims,
        window.claims,
        experiments.claims,
        passivity.claims,
        qualities.claims,
    ]
    return [claim for judged in judges for claim in judged(evidence)]
