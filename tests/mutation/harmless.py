"""Slips that change nothing, and why."""

from __future__ import annotations

EQUAL: dict[str, tuple[str, ...]] = {
    "at the very bound both give the same number": (
        "hapticd/tick/guard.py: blended: if weight >= 2.0 or -reach_n <= force_n <= reach_n:  [LtE 1 is Lt]",
        "hapticd/tick/guard.py: blended: weight: float = done / state.blend_ticks if done > 0.0 else 0.0  "
        "[Gt 0 is GtE]",
    ),
}
"""Each as `str` of a `Slip` says it."""

HARMLESS = frozenset(slip for slips in EQUAL.values() for slip in slips)
