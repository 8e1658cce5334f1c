"""A law that fails at its first step."""

from __future__ import annotations

from typing import Any

from hapticd.law import LawParams


class Params(LawParams):
    """None."""


class State:
    """Nothing."""

    steps: int


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Begin."""
    state.steps = 0


def step(state: Any, params: Any, tick: Any) -> float:
    """Fail."""
    raise ZeroDivisionError("as it happens")
