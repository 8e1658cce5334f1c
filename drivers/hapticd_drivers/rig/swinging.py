"""Measures a Hapkit's angle table while somebody swings its handle; the motor gets no force."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from hapticd.errors import ConfigError, HapticdError
from hapticd_drivers.rig.angle_table import ENOUGH_PASSES, AngleTable, Swings
from hapticd_drivers.rig.conversation import Conversation
from hapticd_drivers.rig.metrics import METRICS
from hapticd_drivers.rig.serial_link import SerialLink
from hapticd_drivers.rig.serial_ports import Port

MODEL = "hapkit"
USABLE_ERROR = 3.0
"""A table that is less certain is worth no flashing [counts]."""

_LOOK_EVERY = 50


def measure(
    port: Port, baud: int, before: Sequence[int], longest_s: float, told: Callable[[float], None]
) -> AngleTable:
    """Read positions until the table is good, or for so long.

    Args:
        port: of the board.
        baud: bits a second.
        before: the table that the board was flashed with.
        longest_s: after which what is known has to do [s].
        told: how many more half turns can be used, of `ENOUGH_PASSES`.

    Raises:
        ConfigError: the rig is no Hapkit.
        DriverError: the rig cannot be reached.
        HapticdError: too little is known for a table.
    """
    link = SerialLink(port, baud, low_latency=True)
    try:
        talk = Conversation(link, _Counts(), "serial-rig")
        model = talk.greet().model
        if model != MODEL:
            raise ConfigError(f"the rig on {link.where} is a {model}: only a {MODEL} has an angle table")
        return _watch(talk, Swings(before), longest_s, told)
    finally:
        link.close()


class _Counts:
    """Where a conversation counts what went wrong on the line."""

    def __init__(self) -> None:
        self.metrics = memoryview(bytearray(8 * len(METRICS))).cast("d")


def _watch(talk: Conversation, swings: Swings, longest_s: float, told: Callable[[float], None]) -> AngleTable:
    end_s = time.monotonic() + longest_s
    shown = 0
    found: AngleTable | None = None
    while time.monotonic() < end_s and not (found is not None and found.is_good):
        for _ in range(_LOOK_EVERY):
            state = talk.state()
            swings.add(state.time_us, state.position[0])
        found = swings.table()
        told(float(min(swings.passes, ENOUGH_PASSES) - shown))
        shown = min(swings.passes, ENOUGH_PASSES)
    if found is None or found.error_counts > USABLE_ERROR:
        error = "nothing" if found is None else f"its worst number to {found.error_counts:.1f} counts"
        raise HapticdError(
            f"the table is not known after {longest_s:g} s: {swings.passes} half turns could be used, and they tell "
            f"{error}. Swing the handle over most of its travel, about twice a second, without stopping on the way"
        )
    return found
