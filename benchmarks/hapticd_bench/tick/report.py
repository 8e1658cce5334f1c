"""All of `hapticd bench tick`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hapticd.measure import Bar, Conditions, MachineWatch, Progress, doubtful
from hapticd_bench.tick.bars import judge
from hapticd_bench.tick.bodies import ROUNDS, Body, Piece, measure_bodies
from hapticd_bench.tick.case import RATE_HZ, cases
from hapticd_bench.tick.rates import Rate, measure_rate


@dataclass(frozen=True, slots=True)
class TickReport:
    """All of `hapticd bench tick`.

    Attributes:
        conditions: the machine.
        realtime: whether bodies were measured under SCHED_FIFO with memory locked.
        warnings: what was missing for that.
        period_us: 1 / rate of the paced bodies [us].
        bodies: one a case; the references come first.
        pieces: of the energy-cycle law on one wall.
        bars: p99 of each law and configuration against `BAR`.
        rates: real daemons.
    """

    conditions: Conditions
    realtime: bool
    warnings: tuple[str, ...]
    period_us: float
    bodies: tuple[Body, ...]
    pieces: tuple[Piece, ...]
    bars: tuple[Bar, ...]
    rates: tuple[Rate, ...]


def measure(
    ticks: int = 4000,
    rounds: int = ROUNDS,
    rates_hz: Sequence[float] = (1000.0, 4000.0, 8000.0),
    rate_s: float = 5.0,
    progress: Progress = lambda seconds: None,
) -> TickReport:
    """Measure everything.

    Args:
        ticks: of each case, paced, and as many hot.
        rounds: blocks that they are divided into.
        rates_hz: of the real daemons; none when `rate_s` is 0.
        rate_s: how long each runs [s].
        progress: told as it goes; `duration_s` says what it adds up to.

    Raises:
        HapticdError: nothing can be measured.
    """
    machine = MachineWatch()

    def advance(seconds: float) -> None:
        machine.look()
        progress(seconds)

    measured = measure_bodies(cases(), ticks, rounds, advance)
    rates: list[Rate] = []
    for rate_hz in rates_hz if rate_s else ():
        rates.append(measure_rate(rate_hz, rate_s, rates[0].late_us.p50 if rates else 0.0))
        advance(rate_s)
    conditions = machine.end()
    return TickReport(
        conditions=conditions,
        realtime=measured.realtime,
        warnings=measured.warnings,
        period_us=1e6 / RATE_HZ,
        bodies=tuple(measured.bodies),
        pieces=tuple(measured.pieces),
        bars=tuple(doubtful(judge(measured.bodies, measured.realtime, conditions.others), conditions)),
        rates=tuple(rates),
    )


def duration_s(ticks: int, rates: int, rate_s: float) -> float:
    """What `measure` tells its progress in all [s]."""
    return len(cases()) * ticks / RATE_HZ + rates * rate_s
