"""What is asked of the body of a tick."""

from __future__ import annotations

from collections.abc import Sequence

from hapticd.bench import Bar, Verdict
from hapticd.bench.tick.bodies import Body

BAR = 0.03
"""Largest share of the period that the body of a tick may take at 1 kHz, p99."""

CALM = 0.1
"""Processors that other programs may keep busy for a missed bar to count: they share caches and cores with the tick."""


def judge(bodies: Sequence[Body], realtime: bool, others: float) -> list[Bar]:
    """Hold each law and each configuration against `BAR`; arguments as for `judge_body`."""
    return [
        judge_body(f"{body.group} {body.name}", body.of_period, realtime, others)
        for body in bodies
        if body.group in ("law", "config") and not body.problem
    ]


def judge_body(name: str, of_period: float, realtime: bool, others: float) -> Bar:
    """Hold p99 of a tick body against `BAR`.

    What disturbs a tick only adds to its time, so a pass is a pass anywhere; a miss counts only under real-time
    scheduling and on a machine that has nothing else to do.

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
