"""A law that fails at its first step: it raises an error, or its force is no number."""

from __future__ import annotations

import math
from typing import Any

from hapticd.law import Field, LawParams


class Params(LawParams):
    """How it fails."""

    raises: bool = Field(True, description="whether it raises an error; else its force is no number")


class State:
    """Nothing to remember."""


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Nothing to begin with."""


def step(state: Any, params: Any, tick: Any) -> float:
    """Fail."""
    if params.raises:
        raise ZeroDivisionError("as it happens")
    return math.nan
