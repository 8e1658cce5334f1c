"""What settings cost, in one run and in turns, so that a machine that slows down slows all of them.

What disturbs a call only adds to its time, so the fastest round counts.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

ROUNDS = 15
_SLICE_NS = 500_000
"""How long a call is repeated in a row: less than what a scheduler takes away at once [ns]."""


@dataclass(frozen=True, slots=True)
class StepCost:
    """What one call costs.

    Attributes:
        ns: of the fastest round, which nothing has disturbed [ns].
        ratio: to the cheapest of the same run.
    """

    ns: float
    ratio: float


def costs(
    calls: Sequence[Callable[[], object]],
    progress: Callable[[], object] = lambda: None,
    idle: Callable[[], object] = lambda: None,
) -> list[StepCost]:
    """Time calls against each other.

    Args:
        calls: what to call, each again and again.
        progress: called after each round.
        idle: what every call does besides what is to be timed; its own time is taken off.
    """
    every = [idle, *calls]
    fastest = [math.inf] * len(every)
    for _ in range(ROUNDS):
        for at, call in enumerate(every):
            times = 1 if math.isinf(fastest[at]) else max(1, min(500, int(_SLICE_NS / fastest[at])))
            started_ns = time.perf_counter_ns()
            for _ in range(times):
                call()
            fastest[at] = min(fastest[at], (time.perf_counter_ns() - started_ns) / times)
        progress()
    net = [max(1.0, ns - fastest[0]) for ns in fastest[1:]]
    return [StepCost(ns, ns / min(net)) for ns in net]


def single_precision_ratio(ticks: int = 200_000) -> float:
    """Cost of the exact step with a wall in single precision over double, both as machine code; 1 saves nothing."""

    @njit
    def steps(x, v, x_per_v, x_per_f, v_per_v, v_per_f, stiffness, ticks):  # type: ignore[no-untyped-def]  # numba finds the types
        for _ in range(ticks):
            f = -1.0 - stiffness * x  # pressed, lest it decays into denormals
            x, v = x + (v * x_per_v + f * x_per_f), v * v_per_v + f * v_per_f
        return x

    values = (1e-3, 0.0, 1e-3, 2e-6, 0.99, 4e-3, 100.0)
    both = []
    for kind in (np.float64, np.float32):
        arguments = [kind(value) for value in values]
        steps(*arguments, ticks)
        both.append(min(_seconds(lambda: steps(*arguments, ticks)) for _ in range(ROUNDS)))  # noqa: B023 - called at once
    return both[1] / both[0] if both[0] > 0.0 else math.nan


def _seconds(call: Callable[[], object]) -> float:
    started = time.perf_counter()
    call()
    return time.perf_counter() - started
