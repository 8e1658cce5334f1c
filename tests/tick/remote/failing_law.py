"""A law that raises once it has a force to give."""

from __future__ import annotations

from typing import Any

from hapticd.law import LawParams


class Params(LawParams):
    """Nothing to set."""


class State:
    """Nothing to remember."""


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Nothing to begin with."""


def step(state: Any, params: Any, tick: Any) -> float:
    """Fails."""
    raise ArithmeticError("this law fails")
