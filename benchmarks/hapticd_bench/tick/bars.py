"""What is asked of the body of a tick."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from hapticd.measure import Bar, Verdict
from hapticd_bench.tick.bodies import Body
from hapticd_bench.tick.case import BAR

CALM = 0.1
"""Processors that other programs may keep busy for a missed bar to count: they share caches and cores with the tick."""

_ONE_IN_A_HUNDRED = 0.01  # what p99 leaves


def judge(bodies: Sequence[Body], realtime: bool, others: float) -> list[Bar]:
    """Hold each law and each configuration against `BAR`.

    What disturbs a tick only adds to its time, so a pass is a pass anywhere. A miss counts only where the machine let
    ticks be: see `judge_body`, and not if without the share of ticks in which it held up a C program that reads as much
    memory (`hapticd_bench.tick.memory`) one in a hundred would have missed.

    Args:
        bodies: what was measured.
        realtime: whether under real-time scheduling.
        others: processors that other programs kept busy.
    """
    held_up = max((body.over for body in bodies if body.name == "memory in C"), default=0.0)
    bars = []
    for body in bodies:
        if body.group in ("law", "config") and not body.problem:
            bar = judge_body(f"{body.group} {body.name}", body.of_period, realtime, others)
            if bar.verdict == "FAIL" and body.over - held_up <= _ONE_IN_A_HUNDRED:
                note = f"{body.over:.2%} of ticks, and {held_up:.2%} of those that only read memory in C"
                bar = replace(bar, verdict="INCONCLUSIVE", note=note)
            bars.append(bar)
    return bars


def judge_body(name: str, of_period: float, realtime: bool, others: float) -> Bar:
    """Hold p99 of a tick body against `BAR`; a miss is one only under real-time scheduling beside no other work.

    Args:
        name: whose body it is.
        of_period: its p99 as a share of the period.
        realtime: whether it was measured under real-time scheduling.
        others: processors that other programs kept busy.
    """
    verdict: Verdict = "PASS" if of_period <= BAR else "FAIL"
    note = ""
    if verdict == "FAIL" and not realtime:
        verdict, note = "INCONCLUSIVE", "not under SCHED_FIFO"
    elif verdict == "FAIL" and others > CALM:
        verdict, note = "INCONCLUSIVE", f"other programs kept {others:.2f} processors busy"
    return Bar(f"{name}: tick body p99 / period", of_period, BAR, verdict, note)
