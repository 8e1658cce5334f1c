"""A law that machine code cannot be made of."""

from __future__ import annotations

from typing import Any

from hapticd.law import LawParams


class Params(LawParams):
    """Nothing to set."""


class State:
    """Nothing to remember."""


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Nothing to take over."""


def step(state: Any, params: Any, tick: Any) -> float:
    """Builds a list at every tick."""
    return sum([tick.contact_n, 0.0])
