"""The evidence of a quick `hapticd study paper`, gathered once for every test of it."""

from __future__ import annotations

from functools import cache

from hapticd_studies.paper import study
from hapticd_studies.paper.claims import Evidence


@cache
def evidence() -> Evidence:
    """What the quick study runs. Tests that need other runs make a copy."""
    return study.gather(study.QUICK, silent)


def silent(_what: str, _done: float) -> None:
    """No progress is shown in a test."""
