"""The first calls of a tick, made before the first deadline."""

from __future__ import annotations

import gc

from hapticd.loop.press import Press
from hapticd.tick.tick import ControlTick

TICKS = 200


def warm_up(tick: ControlTick) -> None:
    """Press and release what is in a scene, as a hand would.

    Args:
        tick: fresh, made for this; it is of no other use afterwards.
    """
    press = Press(tick)
    for _ in range(TICKS):
        press.step()
    gc.collect()
