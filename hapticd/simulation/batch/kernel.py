"""One loop from its first tick to its last.

The order of a tick is the daemon's: move, sample, velocity, contact, law, limit, books, write. Velocity, wall, law and
books are the daemon's own functions; the order of `Motion.see`, `Contact`, `Guard.reduce` and `ControlTick.step` is
written down once more, for one axis, one wall and an armed guard. tests/simulation/test_kernel_and_tick.py finds any
line of the two that goes apart. What the daemon does at transitions is not here: a loop that starts inside the wall has
its force at once, without a ramp.

Memory does not grow with the simulated time unless a trace is asked for. Switches in capitals are what a loop has,
beside the terms of the plant; `bound` removes the branches of the others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from hapticd.simulation.batch.state import LoopControl, LoopDevice, LoopLaw
from hapticd.simulation.compiler.specialise import specialise
from hapticd.simulation.options import FARTHEST_M
from hapticd.simulation.plant import move, sense
from hapticd.tick.contact import MOST
from hapticd.tick.energy import EnergyLedger
from hapticd.tick.motion import MOST_M_PER_S
from hapticd.tick.scene import Wall
from hapticd.tick.velocity import Difference, push

LONG_VELOCITY: bool = True
LIMIT: bool = True
LEDGER: bool = True
LAW_DAMPING: bool = True
LAW_MASS: bool = True
SETTLING: bool = True
TRACE: bool = True

# The daemon's own, on whatever has the fields that they use.
difference: Callable[..., float] = Difference.update
wall_force: Callable[..., float] = Wall.force
wall_stored_j: Callable[..., float] = Wall.stored_j
ledger_update: Callable[..., None] = EnergyLedger.update


def law_step(state: Any, params: Any, tick: Any) -> float:
    """Stands for the law; `specialise` puts the real one here."""
    raise NotImplementedError


def run(device: LoopDevice, control: LoopControl, law: LoopLaw, wall: Any, ledger: Any, trace: Any) -> None:
    """One loop from its first tick to its last.

    Args:
        device: where it starts, and where it is at the end.
        control: the same of the loop.
        law: the same of the law.
        wall: fields of `WallState`.
        ledger: fields of `EnergyLedger`.
        trace: room for `TRACE_COLUMNS`, (rows, columns).
    """
    plant, plant_epochs, buffers = device
    loop, params, segments, history = control
    law_state, law_params, tick = law
    for at in range(params.first_segment, params.end_segment):
        segment = segments[at]
        plant_params = plant_epochs[segment.epoch]
        wall.stiffness_n_per_m = segment.stiffness_n_per_m
        wall.damping_n_s_per_m = segment.damping_n_s_per_m
        last_window = segment.last_window
        for count in range(segment.start, segment.stop):
            loop.ticks = count
            move(plant, plant_params, buffers, loop.force_n)
            sense(plant, plant_params)
            x_m = plant.measured_m
            if not (-FARTHEST_M < x_m < FARTHEST_M):
                loop.finite = False
                return

            # velocity
            if LONG_VELOCITY and params.samples > 1:
                push(loop, history.position_m, history.time_s, x_m, params.dt_s)
                oldest = (loop.newest + 1 - loop.filled) % loop.size
                span_s = history.time_s[loop.newest] - history.time_s[oldest]
                velocity = (x_m - history.position_m[oldest]) / span_s
            else:
                velocity = difference(loop, x_m, params.dt_s, 0.0)
            if not (-MOST_M_PER_S < velocity < MOST_M_PER_S):
                loop.finite = False
                return

            # contact
            tick.moved_m = x_m - tick.x_m
            tick.x_m = x_m
            tick.velocity_m_per_s = velocity
            if x_m < 0.0:
                tick.in_contact = True
                tick.contact_n = wall_force(wall, x_m, velocity)
                tick.spring_n = wall.spring_n
            else:
                tick.in_contact = False
                tick.contact_n = 0.0
                tick.spring_n = wall.spring_n = 0.0

            # law
            force_n = law_step(law_state, law_params, tick)
            if LAW_DAMPING:
                loop.damping_n_s_per_m = law_state.damping_n_s_per_m
                if not (-MOST < loop.damping_n_s_per_m < MOST):
                    loop.finite = False
                    return
            if LAW_MASS:
                loop.felt_mass_kg = law_state.felt_mass_kg
                if not (-MOST < loop.felt_mass_kg < MOST):
                    loop.finite = False
                    return
            if not tick.in_contact:
                force_n = 0.0
            if not (-MOST < force_n < MOST):
                loop.finite = False
                return

            # limit
            share = 1.0
            if LIMIT and (force_n > params.limit_n or force_n < -params.limit_n):
                share = params.limit_n / abs(force_n)

            # books
            if LEDGER:
                ledger_update(
                    ledger,
                    tick.moved_m,
                    tick.applied_n,
                    loop.applied_spring_n,
                    wall_stored_j(wall, x_m, params.limit_n),
                    tick.in_contact,
                    loop.damping_n_s_per_m,
                    params.dt_s,
                )
                loop.applied_spring_n = wall.spring_n
                if LIMIT and wall.spring_n > params.limit_n:
                    loop.applied_spring_n = params.limit_n
            tick.applied_n = share * force_n
            tick.applied_contact_n = share * tick.contact_n
            loop.force_n = tick.applied_n

            # report
            if tick.applied_n > loop.peak_force_n:
                loop.peak_force_n = tick.applied_n
            elif tick.applied_n < -loop.peak_force_n:
                loop.peak_force_n = -tick.applied_n
            if SETTLING:
                off_m = plant.x_m - params.target_m
                if not (-params.band_m <= off_m <= params.band_m):
                    loop.outside_tick = count
            if last_window:
                report(plant, loop)
            if TRACE:
                traced = count - params.trace_from
                if count >= params.trace_from and (traced + 1) % params.trace_every == 0:
                    record(plant, loop, ledger, trace, traced // params.trace_every)
        loop.ticks = segment.stop


def report(plant: Any, loop: Any) -> None:
    """Enter one tick of the last window."""
    if plant.x_m < loop.low_m:
        loop.low_m = plant.x_m
    if plant.x_m > loop.high_m:
        loop.high_m = plant.x_m
    if plant.measured_m < loop.low_measured_m:
        loop.low_measured_m = plant.measured_m
    if plant.measured_m > loop.high_measured_m:
        loop.high_measured_m = plant.measured_m
    loop.sum_x_m += plant.x_m
    loop.sum_force_n += plant.applied_n


def record(plant: Any, loop: Any, ledger: Any, trace: Any, row: int) -> None:
    """Enter one tick into the trace."""
    trace[row, 0] = plant.x_m
    trace[row, 1] = plant.v_m_per_s
    trace[row, 2] = plant.measured_m
    trace[row, 3] = loop.force_n
    trace[row, 4] = ledger.energy_j
    trace[row, 5] = loop.damping_n_s_per_m


def bound(switches: Mapping[str, bool], step: Callable[..., Any]) -> Callable[..., None]:
    """`run` with the terms that it needs and this law."""
    calls: dict[str, Callable[..., Any]] = {"law_step": step}
    calls["move"] = specialise(move, switches)
    calls["sense"] = specialise(sense, switches)
    return specialise(run, switches, calls)
