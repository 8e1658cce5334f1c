"""A law that pushes 2 N too much: it rests well, and in the wrong place."""

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
    """The contact's own force and 2 N."""
    force_n: float = tick.contact_n + 2.0
    return force_n
