"""Ticks as the page gets them: the daemon's topics joined tick by tick, packed into columns of 32-bit floats."""

from __future__ import annotations

import struct
from array import array
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import NamedTuple

from hapticd.client import Damping, Energy, Gap, Position, Timing

HEADER = struct.Struct("<IIdd")
"""Before the columns: ticks, axes, timestamp of the first tick [s], its number."""

COLUMNS_OF_AN_AXIS = ("position_m", "force_n", "force_requested_n")
COLUMNS = ("energy_j", "generated_j", "dissipated_j", "damping_n_s_per_m", "contacts", "late_us", "busy_us")
"""One column each, behind the time and the number of a tick relative to the first and those of the axes.

Damping is that of the wall that has the most of it, `contacts` how many walls are touched.
"""

MOST_WAITING = 4000
"""Ticks of which a part is waited for; beyond that the part is taken for lost."""

_UNKNOWN = float("nan")
_ENERGY = (_UNKNOWN,) * 3
_DAMPING = (_UNKNOWN,) * 2
_TIMING = (_UNKNOWN,) * 2

Part = Position | Energy | Damping | Timing
_PLACES = {Position: 0, Energy: 1, Damping: 2, Timing: 3}


class Tick(NamedTuple):
    """One tick.

    Attributes:
        timestamp: at its deadline [s since the epoch].
        seq: its number.
        axes: how many axes the device has.
        values: `COLUMNS_OF_AN_AXIS`, an element an axis each, then `COLUMNS`; NaN where it did not arrive.
    """

    timestamp: float
    seq: int
    axes: int
    values: tuple[float, ...]


class TickJoiner:
    """Joins what is published of a tick under four topics."""

    def __init__(self) -> None:
        self._waiting: dict[int, list[Part | None]] = {}

    def add(self, part: Part) -> None:
        """One part of a tick."""
        parts = self._waiting.get(part.seq)
        if parts is None:
            parts = self._waiting[part.seq] = [None, None, None, None]
        parts[_PLACES[type(part)]] = part

    def restart(self, gap: Gap) -> None:
        """A daemon that was started anew counts from the beginning: what waits of the one before is complete."""
        for seq in [seq for seq in self._waiting if abs(seq - gap.after) <= abs(seq - gap.seq)]:
            del self._waiting[seq]

    def take(self) -> list[Tick]:
        """The ticks that are complete, in order, and those before them of which a part is lost."""
        if not self._waiting:
            return []
        last = max((seq for seq, parts in self._waiting.items() if None not in parts), default=-1)
        if len(self._waiting) > MOST_WAITING:
            last = max(last, sorted(self._waiting)[len(self._waiting) // 2])
        ready = sorted(seq for seq in self._waiting if seq <= last)
        return [tick for tick in (_tick(self._waiting.pop(seq)) for seq in ready) if tick is not None]


def packed(ticks: Sequence[Tick]) -> bytes:
    """Ticks as one message or as a part of one; frames may follow each other without anything in between.

    Args:
        ticks: in order.

    Returns:
        A frame for each run of ticks with the same number of axes: `HEADER`, then the columns in the machine's order
        of bytes, which is the little end first on all that hapticd runs on.
    """
    return b"".join(_frame(list(run), axes) for axes, run in groupby(ticks, key=lambda tick: tick.axes))


def _frame(ticks: list[Tick], axes: int) -> bytes:
    first = ticks[0]
    columns = [
        array("f", [tick.timestamp - first.timestamp for tick in ticks]),
        array("f", [tick.seq - first.seq for tick in ticks]),
        *(array("f", column) for column in zip(*(tick.values for tick in ticks), strict=True)),
    ]
    return HEADER.pack(len(ticks), axes, first.timestamp, first.seq) + b"".join(map(bytes, columns))


def _tick(parts: list[Part | None]) -> Tick | None:
    """A tick from its parts; None when it is not known where the device was, and what pushed it."""
    position, energy, damping, timing = parts
    if not isinstance(position, Position):
        return None
    axes = len(position.position_m)
    if {len(position.force_n), len(position.force_requested_n)} != {axes}:
        return None
    values = (
        *position.position_m,
        *position.force_n,
        *position.force_requested_n,
        *((energy.energy_j, energy.generated_j, energy.dissipated_j) if isinstance(energy, Energy) else _ENERGY),
        *(_damped(damping) if isinstance(damping, Damping) else _DAMPING),
        *((timing.late_us, timing.busy_us) if isinstance(timing, Timing) else _TIMING),
    )
    return Tick(position.timestamp, position.seq, axes, values)


def _damped(damping: Damping) -> Iterator[float]:
    yield max(damping.damping_n_s_per_m, default=0.0)
    yield sum(damping.in_contact)
