"""No control: the contact's own force and nothing else.

The baseline of every comparison; the daemon's ledger still counts the energy that the wall makes.
"""

from __future__ import annotations

from typing import Any

from hapticd.law import LawParams

RESTS_OUTSIDE = True


class Params(LawParams):
    """Nothing to set."""


class State:
    """Nothing to remember."""


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Nothing to take over."""


def step(state: Any, params: Any, tick: Any) -> float:
    """The contact's own force.  -> force on the device [N]."""
    force_n: float = tick.contact_n
    return force_n
