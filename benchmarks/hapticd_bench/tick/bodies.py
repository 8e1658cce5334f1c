"""What the body of a tick costs: all between two sleeps of the loop, that is read, step, write, record, heartbeat."""

from __future__ import annotations

import gc
import os
import random
import signal
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from hapticd.config.loading import parse
from hapticd.config.models import LoopConfig
from hapticd.errors import HapticdError
from hapticd.loop.realtime import become_realtime, die_with_parent, sleep_until
from hapticd.measure import Progress, Quantiles, ratio
from hapticd_bench.tick.block import arithmetic, nothing, run_loop, run_reference
from hapticd_bench.tick.case import BAR, RATE_HZ, WARM_TICKS, Case
from hapticd_bench.tick.memory import MemoryReader
from hapticd_bench.tick.spawned import Spawned

ROUNDS = 10
"""Every case is measured in this many blocks, in a new random order each time, so that all see the same machine."""

_PIECES = ("nothing", "read", "step", "write", "record")


@dataclass(frozen=True, slots=True)
class Body:
    """What the tick of a case cost.

    Attributes:
        group, name: of the case.
        paced_us: at the set rate, with the caches as a sleep leaves them: the number that counts [us].
        hot_us: back to back [us].
        of_period: p99 of `paced_us` as a share of the period.
        over: share of the paced ticks that took more than `BAR` of the period.
        p50_ratio, p99_ratio, hot_ratio: next to the reference, paced and hot (p50).
        problem: why it could not be measured, empty when it could.
    """

    group: str
    name: str
    paced_us: Quantiles
    hot_us: Quantiles
    of_period: float
    over: float
    p50_ratio: float
    p99_ratio: float
    hot_ratio: float
    problem: str = ""


@dataclass(frozen=True, slots=True)
class Piece:
    """What a piece of the tick cost, paced.

    Attributes:
        name: the call that was timed; "nothing" is an empty function, what timing itself costs.
        us: its time, the timing included [us].
        p50_net_us: p50 without what the timing costs [us].
        p50_ratio: `p50_net_us` next to the reference.
    """

    name: str
    us: Quantiles
    p50_net_us: float
    p50_ratio: float


@dataclass(slots=True)
class Bodies:
    """What the measuring process found.

    Attributes:
        bodies: one a case.
        pieces: of the case that asked for them.
        realtime: whether it was a real-time process.
        warnings: what it could not have.
    """

    bodies: list[Body]
    pieces: list[Piece]
    realtime: bool
    warnings: tuple[str, ...]


def measure_bodies(found: Sequence[Case], ticks: int, rounds: int, progress: Progress) -> Bodies:
    """Measure the bodies of some cases, the first of them the reference, in a process that may become real-time.

    Raises:
        HapticdError: that process failed.
    """
    process = Spawned("the measuring process", _measure_bodies, found, ticks, rounds)
    try:
        while not isinstance(message := process.receive(), Bodies):
            progress(message)
        return message
    finally:
        process.kill()


class _Samples:
    """Times of one case, collected block by block [ns]."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.config = parse(case.text, case.name) if case.text else None
        self.paced: array[int] = array("q")
        self.hot: array[int] = array("q")
        self.pieces: dict[str, list[int]] = {name: [] for name in _PIECES} if case.pieces else {}
        self.problem = ""
        self._work: Callable[[], Any] = arithmetic if case.name == "arithmetic" else nothing
        if case.name == "memory in C":
            try:
                self._work = MemoryReader()
            except HapticdError as error:
                self.problem = str(error)

    def run(self, ticks: int, sleep_until: Callable[[int], int] | None) -> None:
        """Measure one more block."""
        if self.problem:
            return
        spent: array[int] = array("q", bytes(8 * (WARM_TICKS + ticks)))
        pieces: dict[str, list[int]] = {name: [] for name in self.pieces if sleep_until is not None}
        try:
            if self.config is not None:
                run_loop(self.config, spent, sleep_until, pieces)
            else:
                run_reference(self._work, spent, sleep_until)
                if isinstance(self._work, MemoryReader):
                    self._work.move()
        except HapticdError as error:
            self.problem = str(error)
            return
        (self.paced if sleep_until is not None else self.hot).extend(spent[WARM_TICKS:])
        for name, times in pieces.items():
            self.pieces[name] += times[WARM_TICKS : WARM_TICKS + ticks]


def _measure_bodies(connection: Connection, found: Sequence[Case], ticks: int, rounds: int) -> None:
    die_with_parent(os.getppid())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        samples = [_Samples(case) for case in found]
        for sample in samples:
            sample.run(WARM_TICKS, None)  # first calls, before memory is locked
            del sample.hot[:]
        problems, advice = become_realtime(LoopConfig())
        order = list(samples)
        for block in (ticks * (number + 1) // rounds - ticks * number // rounds for number in range(rounds)):
            random.shuffle(order)
            for sample in order:
                sample.run(block, sleep_until)
                sample.run(block, None)
                gc.collect()
            connection.send(len(order) * block / RATE_HZ)
    except HapticdError as error:
        connection.send(HapticdError(str(error)))
        return
    bodies = _bodies([sample for sample in samples if not sample.pieces])
    pieces = [piece for sample in samples for piece in _pieces(sample, bodies[0].paced_us.p50)]
    connection.send(Bodies(bodies, pieces, not problems, tuple(problems + advice)))


def _bodies(samples: Sequence[_Samples]) -> list[Body]:
    bodies: list[Body] = []
    for sample in samples:
        paced = Quantiles.of(spent * 1e-3 for spent in sample.paced)
        hot = Quantiles.of(spent * 1e-3 for spent in sample.hot)
        reference = bodies[0] if bodies else None
        bodies.append(
            Body(
                group=sample.case.group,
                name=sample.case.name,
                paced_us=paced,
                hot_us=hot,
                of_period=paced.p99 * 1e-6 * RATE_HZ,
                over=ratio(sum(spent > BAR * 1e9 / RATE_HZ for spent in sample.paced), len(sample.paced)),
                p50_ratio=ratio(paced.p50, reference.paced_us.p50) if reference else 1.0,
                p99_ratio=ratio(paced.p99, reference.paced_us.p99) if reference else 1.0,
                hot_ratio=ratio(hot.p50, reference.hot_us.p50) if reference else 1.0,
                problem=sample.problem,
            )
        )
    return bodies


def _pieces(sample: _Samples, reference_us: float) -> Iterator[Piece]:
    timing_us = 0.0
    for name, times in sample.pieces.items():
        us = Quantiles.of(spent * 1e-3 for spent in times)
        if name == "nothing":
            timing_us = us.p50
        net_us = us.p50 - timing_us
        yield Piece(name, us, net_us, ratio(net_us, reference_us))
