"""The energy books of a run, kept a second time: every part by its own formula, none as what is left over.

    stored + dissipated = work done + generated

    stored       m v^2 / 2, and of the wall's and of the hand's spring k x^2 / 2
    dissipated   by viscous friction, the integral of b v^2 in closed form; by wall damping and law, -(F - F_spring) dx
    work done    by the hand, F_hand dx
    generated    by sampling and hold, k dx^2 / 2 of the part of a step that is inside the wall (and all of the rest
                 of the step while the spring lets go or takes hold); by the sensor, F d(x - x_measured); by delay and
                 saturation, (F_applied - F) dx

The wall's own books, which the ledger keeps, are the part of it that the measured position shows. A residual beside
them is held against a bound of what rounding can do, summed up along the run from the sizes of the numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit

from hapticd.simulation.batch import TRACE_COLUMNS
from hapticd.simulation.compiler.compile import OPTIONS, compiled, on_stack
from hapticd.simulation.compiler.threads import in_threads
from hapticd.simulation.options import FARTHEST_M
from hapticd.tick.motion import MOST_M_PER_S
from hapticd_studies.extremes.case import LoopCase
from hapticd_studies.extremes.exact import free_period, friction_integrals

X, V, MEASURED, FORCE = (TRACE_COLUMNS.index(name) for name in ("x_m", "v_m_per_s", "x_measured_m", "force_n"))

ROUNDING = 2.0**-52
TINIEST = 5e-324

GIVEN = (
    "ticks",
    "finite",
    "period_s",
    "stiffness_n_per_m",
    "mass_kg",
    "hand_stiffness_n_per_m",
    "hand_n",
    "limit_n",
    "delay",
    "start_m",
    "start_m_per_s",
    "start_measured_m",
    "step_m",
    "brakes_vv",
    "brakes_va",
    "brakes_aa",
    "slope",
    "swing",
    "area",
    "amplifies",
)
"""What a run was given, and its coefficients from the analytic solution."""

FOUND = (
    "stored_j",
    "dissipated_j",
    "work_j",
    "generated_j",
    "residual_j",
    "turnover_j",
    "rounding_j",
    "wall_energy_j",
    "wall_generated_j",
    "wall_dissipated_j",
    "wall_residual_j",
    "wall_turnover_j",
    "wall_rounding_j",
    "finite",
    "left_range",
)
"""What the books say; `finite` and `left_range` are 0 or 1."""


def run_of(place: LoopCase, ticks: int, finite: bool) -> dict[str, float]:
    """What `balance` needs to know of a run.

    Args:
        place: the run's.
        ticks: rows of its trace that are filled.
        finite: whether the run came to its end.
    """
    keys = (place.viscous_n_s_per_m, place.hand_stiffness_n_per_m, place.mass_kg, place.period_s)
    free = free_period(*keys, 40)
    brakes = [float(value) for value in friction_integrals(*keys)]
    step_m = place.resolution_m
    # Half to even, as the sensor rounds; beyond 2^52 steps a number has no half of one left.
    first_m = round(place.initial_position_m / step_m) * step_m if step_m else place.initial_position_m
    turns = place.period_s * math.sqrt(place.hand_stiffness_n_per_m / place.mass_kg)
    return {
        "ticks": float(ticks),
        "finite": float(finite),
        "period_s": place.period_s,
        "stiffness_n_per_m": place.stiffness_n_per_m,
        "mass_kg": place.mass_kg,
        "hand_stiffness_n_per_m": place.hand_stiffness_n_per_m,
        "hand_n": place.hand_n,
        "limit_n": place.max_force_n or math.inf,
        "delay": float(place.force_delay_samples),
        "start_m": place.initial_position_m,
        "start_m_per_s": place.initial_velocity_m_per_s,
        "start_measured_m": first_m,
        "step_m": step_m,
        "brakes_vv": brakes[0],
        "brakes_va": brakes[1],
        "brakes_aa": brakes[2],
        "slope": float(free.slope),
        "swing": float(free.swing),
        "area": float(free.area),
        # An angle is known to as many roundings as it has radians; the doublings of the closed form add some.
        "amplifies": 64.0 + 16.0 * turns,
    }


def balance(trace: Any, run: Any, books: Any) -> None:
    """Keep the books of one run.

    Args:
        trace: (rows, columns) as `TRACE_COLUMNS`, one row a tick.
        run: fields of `GIVEN`.
        books: an array in the order of `FOUND`, filled.
    """
    k = run.stiffness_n_per_m
    hand_k = run.hand_stiffness_n_per_m
    m = run.mass_kg
    delay = int(run.delay)
    x, v, measured = run.start_m, run.start_m_per_s, run.start_measured_m
    written = spring = wall_j = 0.0  # before the first tick there is no push
    wall_work = wall_spent = wall_made = sensed = late = hand = rubbed = 0.0
    wall_turnover = wall_slips = turnover = slips = 0.0
    start_j = 0.5 * m * v * v + 0.5 * hand_k * x * x
    stored_j = start_j
    finite = True
    ticks = int(run.ticks)
    for tick in range(ticks + 1):
        sent = 0.0 if tick <= delay else trace[tick - 1 - delay, FORCE]
        sent = min(max(sent, -run.limit_n), run.limit_n)
        pull = sent + run.hand_n - hand_k * x
        if tick == ticks:
            break
        next_x, next_v, next_measured = trace[tick, X], trace[tick, V], trace[tick, MEASURED]
        if not (abs(next_x) < math.inf and abs(next_v) < math.inf and abs(trace[tick, FORCE]) < math.inf):
            finite = False
        dx = next_x - x
        moved = next_measured - measured

        # the wall, as it is measured
        depth, next_depth = max(0.0, -measured), max(0.0, -next_measured)
        if tick == 0:
            depth = 0.0  # a spring that comes into being where the device already is
        change = abs(next_depth - depth)
        made = k * change * (0.5 * change + max(0.0, next_measured))
        work = -written * moved
        spent = -(written - spring) * moved
        wall_work += work
        wall_made += made
        wall_spent += spent
        wall_j = 0.5 * k * next_depth * next_depth
        wall_turnover = max(wall_turnover, wall_j) + abs(work) + abs(spent) + made
        reach = abs(measured) + abs(next_measured)
        wall_slips += (abs(written) + abs(spring)) * reach + k * next_depth * next_depth + 4.0 * abs(work) + made

        # the device, as it is
        push = pull / m
        brakes = run.brakes_vv * v * v + 2.0 * run.brakes_va * v * push + run.brakes_aa * push * push
        error = (next_x - next_measured) - (x - measured)
        rubbed += brakes
        hand += run.hand_n * dx
        sensed += written * error
        late += (sent - written) * dx
        stored_j = 0.5 * m * next_v * next_v + 0.5 * hand_k * next_x * next_x
        terms = abs(run.hand_n * dx) + abs(written * error) + abs((sent - written) * dx) + abs(brakes)
        turnover = max(turnover, stored_j) + terms
        forces = abs(sent) + abs(written) + abs(run.hand_n) + hand_k * abs(x)
        slips += forces * (abs(x) + abs(next_x) + reach) + 2.0 * stored_j + m * v * v + terms
        slips += abs(run.brakes_vv) * v * v + abs(run.brakes_aa) * push * push

        written = trace[tick, FORCE]
        spring = k * next_depth
        x, v, measured = next_x, next_v, next_measured

    dissipated = rubbed + wall_spent
    generated = wall_made + sensed + late
    books[0] = wall_j + stored_j
    books[1] = dissipated
    books[2] = start_j + hand
    books[3] = generated
    books[4] = wall_j + stored_j + dissipated - (start_j + hand) - generated
    books[5] = turnover + wall_turnover
    books[7] = wall_work
    books[8] = wall_made
    books[9] = wall_spent
    books[10] = wall_j + wall_spent - wall_work - wall_made
    books[11] = wall_turnover
    books[12] = ROUNDING * (16.0 * wall_slips + ticks * wall_turnover) + 64.0 * ticks * TINIEST
    books[6] = ROUNDING * (run.amplifies * (slips + wall_slips) + ticks * books[5]) + 64.0 * ticks * TINIEST
    books[13] = 1.0 if finite else 0.0
    # Where a run has been stopped, the next step of the analytic solution must be out of range, as the sensor reads it.
    push = pull / m
    far_x = x + run.swing * v + run.area * push
    off = 0.5 * run.step_m
    far = abs(far_x) + off >= 0.999 * FARTHEST_M or abs(far_x - measured) + off >= 0.999 * MOST_M_PER_S * run.period_s
    books[14] = 1.0 if far else 0.0


def balances(traces: np.ndarray[Any, Any], runs: Sequence[dict[str, float]]) -> np.ndarray[Any, Any]:
    """The books of many runs, on all threads: (runs, columns of `FOUND`)."""
    table = np.zeros(len(runs), np.dtype([(name, np.float64) for name in GIVEN], align=True))
    for name in GIVEN:
        table[name] = [run[name] for run in runs]
    found = np.zeros((len(runs), len(FOUND)))
    in_threads(_machine_code(), len(runs), traces, table, found)
    return found


@lru_cache(maxsize=1)
def _machine_code() -> Any:
    one = compiled(balance)

    @njit(**OPTIONS)  # type: ignore[untyped-decorator]  # numba publishes no types
    def sweep(first: Any, stop: Any, traces: Any, runs: Any, found: Any) -> None:
        for at in range(first, stop):
            one(traces[at], on_stack(runs[at]), found[at])

    return sweep
