"""Ticks as the page gets them: the daemon's topics joined tick by tick, packed into columns of 32-bit floats."""

from __future__ import annotations

import struct
from array import array
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import NamedTuple

from hapticd.client import Damping, Energy, Gap, Position, Timing

HEADER = struct.Struct("<IIddd")
"""Before the columns: ticks, axes, timestamp of the first tick [s], its number, the step to the next number."""

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
        every_ticks: when it was published, one tick in this many was: the step from one number to the next.
        values: `COLUMNS_OF_AN_AXIS`, an element an axis each, then `COLUMNS`; NaN where it did not arrive.
    """

    timestamp: float
    seq: int
    axes: int
    every_ticks: int
    values: tuple[float, ...]


class _Waiting(NamedTuple):
    every_ticks: int
    parts: list[Part | None]


class TickJoiner:
    """Joins what is published of a tick under four topics."""

    def __init__(self) -> None:
        self._waiting: dict[int, _Waiting] = {}

    def add(self, part: Part, every_ticks: int) -> None:
        """One part of a tick.

        Args:
            part: the part.
            every_ticks: of the latest status before it.
        """
        waiting = self._waiting.get(part.seq)
        if waiting is None:
            waiting = self._waiting[part.seq] = _Waiting(every_ticks, [None, None, None, None])
        waiting.parts[_PLACES[type(part)]] = part

    def restart(self, gap: Gap) -> None:
        """A daemon that was started anew counts from the beginning: what waits of the one before is complete."""
        for seq in [seq for seq in self._waiting if abs(seq - gap.after) <= abs(seq - gap.seq)]:
            del self._waiting[seq]

    def take(self) -> list[Tick]:
        """The ticks that are complete, in order, and those before them of which a part is lost."""
        if not self._waiting:
            return []
        last = max((seq for seq, waiting in self._waiting.items() if None not in waiting.parts), default=-1)
        if len(self._waiting) > MOST_WAITING:
            last = max(last, sorted(self._waiting)[len(self._waiting) // 2])
        ready = sorted(seq for seq in self._waiting if seq <= last)
        return [tick for tick in (_tick(self._waiting.pop(seq)) for seq in ready) if tick is not None]


def packed(ticks: Sequence[Tick]) -> bytes:
    """Ticks as one message or as a part of one; frames may follow each other without anything in between.

    Args:
        ticks: in order.

    Returns:
        A frame for each run of ticks with the same number of axes and the same step: `HEADER`, then the columns in the
        machine's order of bytes, which is the little end first on all that hapticd runs on.
    """
    return b"".join(_frame(list(run)) for _, run in groupby(ticks, key=lambda tick: (tick.axes, tick.every_ticks)))


def _frame(ticks: list[Tick]) -> bytes:
    first = ticks[0]
    columns = [
        array("f", [tick.timestamp - first.timestamp for tick in ticks]),
        array("f", [tick.seq - first.seq for tick in ticks]),
        *(array("f", column) for column in zip(*(tick.values for tick in ticks), strict=True)),
    ]
    header = HEADER.pack(len(ticks), first.axes, first.timestamp, first.seq, first.every_ticks)
    return header + b"".join(map(bytes, columns))


def _tick(waiting: _Waiting) -> Tick | None:
    """A tick from its parts; None when it is not known where the device was, and what pushed it."""
    position, energy, damping, timing = waiting.parts
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
    return Tick(position.timestamp, position.seq, axes, waiting.every_ticks, values)


def _damped(damping: Damping) -> Iterator[float]:
    yield max(damping.damping_n_s_per_m, default=0.0)
    yield sum(damping.in_contact)
