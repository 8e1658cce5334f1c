"""A law whose force is no number."""

from __future__ import annotations

import math
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
    """Ask for what none can give."""
    return math.nan
