"""The closed loop, many times: device, one wall, law and force limit over a grid of parameters, on all cores.

The order of a tick is the daemon's: move, sample, velocity, contact, law, limit, books, write. `run` is plain
Python; a study runs it compiled, a test interpreted, and both give the daemon's numbers to the last bit. What the
daemon does at transitions is not here: a loop that starts inside the wall has its force at once, without a ramp.

Memory does not grow with the simulated time unless a trace is asked for.
"""

from __future__ import annotations

import math
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numba import get_num_threads, njit, prange, set_num_threads

from hapticd.config.models import WallConfig
from hapticd.contracts.errors import ConfigError
from hapticd.contracts.law import (
    LawParams,
    LawSnapshot,
    LawTick,
    fresh_state,
    plain_object,
    scalar_params,
    state_fields,
)
from hapticd.energy import EnergyLedger
from hapticd.simulation.compile import (
    OPTIONS,
    TICK_KINDS,
    compiled,
    compiled_step,
    kinds,
    on_stack,
    param_kinds,
    record_dtype,
)
from hapticd.simulation.options import ConstantForce, SimulationOptions
from hapticd.simulation.plant import (
    Buffers,
    PlantParams,
    PlantState,
    delay_line,
    epochs,
    move,
    recorded_points,
    sense,
    start_state,
    terms,
)
from hapticd.simulation.specialise import specialise

# What a loop has, beside the terms of the plant.
WALL_DAMPING: bool = True
LONG_VELOCITY: bool = True
LIMIT: bool = True
LEDGER: bool = True
LAW_DAMPING: bool = True
LAW_MASS: bool = True
SETTLING: bool = True
TRACE: bool = True

FARTHEST_M = 1e6
MOST = 1e18
MOST_M_PER_S = 1e6
CHUNK = 64
TRACE_COLUMNS = ("x_m", "v_m_per_s", "x_measured_m", "force_n", "energy_j", "damping_n_s_per_m")


@dataclass(frozen=True, slots=True)
class Point:
    """One loop of a grid.

    Attributes:
        device: the device model, hand included.
        wall: stiffness, damping and their changes; where it stands does not matter.
        params: the law's parameters.
        period_s: time between ticks [s].
        max_force_n: the guard's limit [N].
        velocity_samples: samples that the velocity difference spans.
        target_m: where it should settle; None: where hand and springs balance, known for a constant hand only [m].
        band_m: settled means within this of the target; None: 5 % of it, at least three counts [m].
    """

    device: SimulationOptions
    wall: WallConfig
    params: LawParams
    period_s: float = 1e-3
    max_force_n: float = math.inf
    velocity_samples: int = 1
    target_m: float | None = None
    band_m: float | None = None


@dataclass(frozen=True, slots=True)
class BatchResult:
    """What became of each point: one element a point, in the order of the points.

    Attributes:
        peak_to_peak_m, measured_peak_to_peak_m: true and measured position over the last window [m].
        mean_depth_m: mean depth in the wall over the last window, true position, negative outside [m].
        mean_force_n: mean force of the actuator over the last window [N].
        peak_force_n: largest force that was written, magnitude, whole run [N].
        damping_n_s_per_m: damping of the law at the end; 0 when it has none.
        felt_mass_kg: mass identified by the law; 0 when unknown.
        cycles: completed energy cycles, by the ledger's 2+2 window.
        energy_j, generated_j, dissipated_j: the ledger at the end [J].
        settled_s: from when on the true position stayed within the band of its target; NaN when it did not, or when
            there is no target [s].
        finite: whether position, velocity and force stayed in bounds; when not, the run ended there.
        ticks: ticks that were run.
        states: final state of the law, a structured array.
        trace: (points, rows, columns) in the order of `TRACE_COLUMNS`; empty unless asked for.
    """

    peak_to_peak_m: np.ndarray[Any, Any]
    measured_peak_to_peak_m: np.ndarray[Any, Any]
    mean_depth_m: np.ndarray[Any, Any]
    mean_force_n: np.ndarray[Any, Any]
    peak_force_n: np.ndarray[Any, Any]
    damping_n_s_per_m: np.ndarray[Any, Any]
    felt_mass_kg: np.ndarray[Any, Any]
    cycles: np.ndarray[Any, Any]
    energy_j: np.ndarray[Any, Any]
    generated_j: np.ndarray[Any, Any]
    dissipated_j: np.ndarray[Any, Any]
    settled_s: np.ndarray[Any, Any]
    finite: np.ndarray[Any, Any]
    ticks: np.ndarray[Any, Any]
    states: np.ndarray[Any, Any]
    trace: np.ndarray[Any, Any] = field(repr=False)


class LoopBuffers(NamedTuple):
    """Histories of the loop: lists when interpreted, arrays when compiled."""

    position_m: Any
    time_s: Any


class LoopState:
    """What the loop remembers, and what it reports at the end."""

    force_n: float
    last_m: float
    velocity_m_per_s: float
    newest: int
    filled: int
    applied_spring_n: float
    low_m: float
    high_m: float
    low_measured_m: float
    high_measured_m: float
    sum_x_m: float
    sum_force_n: float
    peak_force_n: float
    damping_n_s_per_m: float
    felt_mass_kg: float
    outside_tick: int
    ticks: int
    finite: bool


class LoopParams:
    """What one loop is given."""

    dt_s: float
    limit_n: float
    samples: int
    target_m: float
    band_m: float
    first_segment: int
    end_segment: int
    trace_every: int


class Segment:
    """Ticks over which nothing is changed from outside."""

    start: int
    stop: int
    epoch: int
    stiffness_n_per_m: float
    damping_n_s_per_m: float
    last_window: bool


def law_step(state: Any, params: Any, tick: Any) -> float:
    """Stands for the law; `specialise` puts the real one here."""
    raise NotImplementedError


def ledger_update(
    ledger: Any,
    moved_m: float,
    applied_n: float,
    spring_n: float,
    stored_j: float,
    inside: bool,
    damping: float,
    dt_s: float,
) -> None:
    """Stands for `EnergyLedger.update`."""
    raise NotImplementedError


def run(
    plant: Any,
    plant_epochs: Any,
    buffers: Any,
    history: Any,
    loop: Any,
    params: Any,
    segments: Any,
    law_state: Any,
    law_params: Any,
    tick: Any,
    ledger: Any,
    trace: Any,
) -> None:
    """One loop from its first tick to its last."""
    for at in range(params.first_segment, params.end_segment):
        segment = segments[at]
        plant_params = plant_epochs[segment.epoch]
        stiffness = segment.stiffness_n_per_m
        wall_damping = segment.damping_n_s_per_m
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
                velocity = long_difference(loop, params, history, x_m)
            else:
                velocity = (x_m - loop.last_m) / params.dt_s
            loop.last_m = x_m
            if not (-MOST_M_PER_S < velocity < MOST_M_PER_S):
                loop.finite = False
                return

            # contact
            tick.moved_m = x_m - tick.x_m
            tick.x_m = x_m
            tick.velocity_m_per_s = velocity
            spring_n = 0.0
            if x_m < 0.0:
                tick.in_contact = True
                spring_n = -stiffness * x_m
                contact_n = spring_n
                if WALL_DAMPING and wall_damping != 0.0:
                    contact_n = spring_n - wall_damping * velocity
                tick.contact_n = contact_n
            else:
                tick.in_contact = False
                tick.contact_n = 0.0

            # law
            force_n = law_step(law_state, law_params, tick)
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
            if LAW_DAMPING:
                loop.damping_n_s_per_m = law_state.damping_n_s_per_m
            if LAW_MASS:
                loop.felt_mass_kg = law_state.felt_mass_kg
            if LEDGER:
                stored_j = 0.0
                if x_m < 0.0:
                    stored_j = -0.5 * spring_n * x_m
                    if LIMIT and spring_n > params.limit_n:
                        stored_j = params.limit_n * (-x_m - 0.5 * params.limit_n / stiffness)
                ledger_update(
                    ledger,
                    tick.moved_m,
                    tick.applied_n,
                    loop.applied_spring_n,
                    stored_j,
                    tick.in_contact,
                    loop.damping_n_s_per_m,
                    params.dt_s,
                )
                loop.applied_spring_n = spring_n
                if LIMIT and spring_n > params.limit_n:
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
            if TRACE and (count + 1) % params.trace_every == 0:
                record(plant, loop, ledger, trace, count // params.trace_every)
        loop.ticks = segment.stop


def long_difference(loop: Any, params: Any, history: Any, position_m: float) -> float:
    """`hapticd.velocity.LongDifference`, step by step, times included: its sums decide the last bit."""
    size = params.samples + 1
    last_s = history.time_s[loop.newest]
    if last_s > 10.0:
        for at in range(size):
            history.time_s[at] -= last_s
        last_s = 0.0
    loop.newest = (loop.newest + 1) % size
    history.position_m[loop.newest] = position_m
    history.time_s[loop.newest] = last_s + params.dt_s
    if loop.filled < size:
        loop.filled += 1
    oldest = (loop.newest + 1 - loop.filled + size) % size
    span_s = history.time_s[loop.newest] - history.time_s[oldest]
    return (position_m - history.position_m[oldest]) / span_s  # type: ignore[no-any-return]


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


class Batch:
    """A grid of loops with one law, ready to run.

    Args:
        law: the law's module.
        points: the loops.
        duration_s: simulated time [s].
        window_s: the last so many seconds are reported on [s].
        trace_every: keep one tick in this many; 0: none.
        ledger: keep the energy books; without them cycles and energies stay 0.

    Raises:
        ConfigError: a point that cannot be simulated, named by its index.
    """

    def __init__(
        self,
        law: ModuleType,
        points: Sequence[Point],
        duration_s: float,
        window_s: float = 0.5,
        trace_every: int = 0,
        ledger: bool = True,
    ) -> None:
        if not points:
            raise ConfigError("a batch needs at least one point")
        self.law = law
        self.points = points
        self._prepared = []
        for at, point in enumerate(points):
            try:
                self._prepared.append(_Prepared(law, point, duration_s, window_s, trace_every))
            except ValueError as error:
                raise ConfigError(f"points[{at}]: {error}") from error
        state_names = state_fields(law)
        self._switches = {
            "WALL_DAMPING": any(segment["damping_n_s_per_m"] for one in self._prepared for segment in one.segments),
            "LONG_VELOCITY": any(point.velocity_samples > 1 for point in points),
            "LIMIT": any(point.max_force_n < math.inf for point in points),
            "LEDGER": ledger,
            "LAW_DAMPING": "damping_n_s_per_m" in state_names,
            "LAW_MASS": "felt_mass_kg" in state_names,
            "SETTLING": any(not math.isnan(float(one.params["target_m"])) for one in self._prepared),
            "TRACE": trace_every > 0,
        }
        for point in points:
            for name, on in terms(point.device).items():
                self._switches[name] = self._switches.get(name, False) or on
        self._rows = max(one.ticks for one in self._prepared) // trace_every if trace_every else 0

    def run(self, workers: int | None = None, progress: Callable[[int], None] | None = None) -> BatchResult:
        """Run every point as machine code.

        Args:
            workers: threads; None: one a core.
            progress: told now and then how many points are done.

        Raises:
            PluginError: the law cannot be compiled.
        """
        arrays = self.arrays()
        self.run_on(arrays, workers, progress)
        return self._result(arrays)

    def arrays(self) -> Arrays:
        """Every point as it is before its first tick."""
        return Arrays(self._prepared, self._rows)

    def run_on(self, arrays: Arrays, workers: int | None = None, progress: Callable[[int], None] | None = None) -> None:
        """Run every point as machine code, from and into these arrays."""
        sweep = _machine_code(self.law, tuple(sorted(self._switches.items())))
        count = len(self._prepared)
        step = max(CHUNK, -(-count // 50)) if progress else count
        threads = get_num_threads()
        set_num_threads(min(workers or threads, threads))
        try:
            for first in range(0, count, step):
                stop = min(first + step, count)
                sweep(first, stop, *arrays.arguments())
                if progress:
                    progress(stop)
        finally:
            set_num_threads(threads)

    def run_interpreted(self) -> BatchResult:
        """Run every point as plain Python: the same numbers, about a hundred times slower."""
        loop = _bound(self._switches, self.law.step, EnergyLedger.update)
        arrays = Arrays(self._prepared, self._rows)
        for at, one in enumerate(self._prepared):
            plant = _plain(one.plant)
            state = _plain(one.loop)
            ledger = EnergyLedger()
            law_state = _plain(one.law_state)
            loop(
                plant,
                [_plain(fields) for fields in one.epochs],
                Buffers(list(one.line), *one.recorded),
                LoopBuffers(list(one.history), [0.0] * len(one.history)),
                state,
                _plain({**one.params, "first_segment": 0, "end_segment": len(one.segments)}),
                [_plain(fields) for fields in one.segments],
                law_state,
                _plain(one.law_params),
                _plain(one.tick),
                ledger,
                arrays.traces[at],
            )
            _store(arrays.loops[at], state)
            _store(arrays.ledgers[at], ledger)
            _store(arrays.law_states[at], law_state)
        return self._result(arrays)

    def _result(self, arrays: Arrays) -> BatchResult:
        loops, ledgers = arrays.loops, arrays.ledgers
        window = np.array([one.window for one in self._prepared], dtype=float)
        period_s = np.array([point.period_s for point in self.points])
        finite = loops["finite"].copy()
        seen = np.where(finite, 1.0, np.nan)
        last = np.array([one.ticks for one in self._prepared]) - 1
        has_target = np.array([not math.isnan(one.params["target_m"]) for one in self._prepared])
        settled = has_target & finite & (loops["outside_tick"] < last)
        return BatchResult(
            peak_to_peak_m=(loops["high_m"] - loops["low_m"]) * seen,
            measured_peak_to_peak_m=(loops["high_measured_m"] - loops["low_measured_m"]) * seen,
            mean_depth_m=-loops["sum_x_m"] / window * seen,
            mean_force_n=loops["sum_force_n"] / window * seen,
            peak_force_n=loops["peak_force_n"].copy(),
            damping_n_s_per_m=loops["damping_n_s_per_m"].copy(),
            felt_mass_kg=loops["felt_mass_kg"].copy(),
            cycles=ledgers["cycle"].copy(),
            energy_j=ledgers["energy_j"].copy(),
            generated_j=ledgers["generated_j"].copy(),
            dissipated_j=ledgers["dissipated_j"].copy(),
            settled_s=np.where(settled, (loops["outside_tick"] + 1) * period_s, np.nan),
            finite=finite,
            ticks=loops["ticks"].copy(),
            states=arrays.law_states,
            trace=arrays.traces,
        )


class _Prepared:
    """One point as scalar fields, its first sample taken and its law started."""

    def __init__(self, law: ModuleType, point: Point, duration_s: float, window_s: float, trace_every: int) -> None:
        device, period_s = point.device, point.period_s
        changes = epochs(device, period_s)
        self.ticks = max(1, round(duration_s / period_s))
        self.window = min(self.ticks, max(1, round(window_s / period_s)))
        self.epochs = [fields for _, fields in changes]
        self.line = delay_line(device)
        self.recorded = recorded_points(device)
        plant = _plain(start_state(device))
        specialise(sense, terms(device))(plant, _plain(self.epochs[0]))
        self.plant = _fields(plant)
        start_m = float(plant.measured_m)
        self.history = [start_m] + [0.0] * point.velocity_samples
        self.law_param_kinds = param_kinds(law)
        self.law_params = {
            name: kind(value)
            for (name, kind), value in zip(
                self.law_param_kinds.items(), scalar_params(point.params).values(), strict=True
            )
        }
        law_state = fresh_state(law)
        law.start(law_state, plain_object("Params", self.law_params), LawSnapshot(x_m=start_m))
        self.law_state = {name: kind(getattr(law_state, name)) for name, kind in state_fields(law).items()}
        tick = LawTick(device.resolution_m)
        tick.x_m = start_m
        tick.dt_s = period_s
        self.tick = _fields(tick)
        self.segments = self._segments(point, [first for first, _ in changes])
        target_m = point.target_m if point.target_m is not None else self._balance_m(point)
        band_m = point.band_m
        if band_m is None:
            band_m = max(0.05 * abs(target_m), 3.0 * device.resolution_m)
        self.params: dict[str, Any] = {
            "dt_s": period_s,
            "limit_n": float(point.max_force_n),
            "samples": point.velocity_samples,
            "target_m": target_m,
            "band_m": band_m,
            "first_segment": 0,
            "end_segment": 0,
            "trace_every": max(1, trace_every),
        }
        self.loop: dict[str, Any] = {name: kind(0) for name, kind in _hints(LoopState).items()} | {
            "last_m": start_m,
            "filled": 1,
            "low_m": math.inf,
            "high_m": -math.inf,
            "low_measured_m": math.inf,
            "high_measured_m": -math.inf,
            "outside_tick": -1,
            "finite": True,
        }

    def _segments(self, point: Point, epoch_starts: list[int]) -> list[dict[str, Any]]:
        stiffness, damping = point.wall.stiffness_n_per_m, point.wall.damping_n_s_per_m
        wall = {0: (stiffness, damping)}
        for change in point.wall.changes:
            stiffness = stiffness if change.stiffness_n_per_m is None else change.stiffness_n_per_m
            damping = damping if change.damping_n_s_per_m is None else change.damping_n_s_per_m
            wall[math.ceil(change.at_s / point.period_s - 1e-6)] = (stiffness, damping)
        starts = sorted({*wall, *epoch_starts, self.ticks - self.window})
        found = []
        for start, stop in zip(starts, [*starts[1:], self.ticks], strict=True):
            if start >= self.ticks:
                break
            k, b = wall[max(at for at in wall if at <= start)]
            found.append(
                {
                    "start": start,
                    "stop": min(stop, self.ticks),
                    "epoch": sum(first <= start for first in epoch_starts) - 1,
                    "stiffness_n_per_m": float(k),
                    "damping_n_s_per_m": float(b),
                    "last_window": start >= self.ticks - self.window,
                }
            )
        return found

    def _balance_m(self, point: Point) -> float:
        """Where a constant hand, its spring and the wall balance at the end; NaN when that is not known."""
        force = point.device.hand.force
        if not isinstance(force, ConstantForce):
            return math.nan
        spring = float(self.epochs[-1]["spring_n_per_m"])
        if force.newton < 0.0:
            spring += self.segments[-1]["stiffness_n_per_m"]
        return force.newton / spring if spring > 0.0 else math.nan


class Arrays:
    """All points as arrays of records, and what does not fit into records as one flat array each."""

    def __init__(self, prepared: Sequence[_Prepared], rows: int) -> None:
        self.plants = _records([one.plant for one in prepared], _hints(PlantState))
        self.epochs = _records([fields for one in prepared for fields in one.epochs], _hints(PlantParams))
        self.loops = _records([one.loop for one in prepared], _hints(LoopState))
        self.law_states = _records([one.law_state for one in prepared], kinds(prepared[0].law_state))
        self.law_params = _records([one.law_params for one in prepared], prepared[0].law_param_kinds)
        self.ticks = _records([one.tick for one in prepared], TICK_KINDS)
        ledger = _fields(EnergyLedger())
        self.ledgers = _records([ledger] * len(prepared), kinds(ledger))
        self.traces = np.full((len(prepared), rows, len(TRACE_COLUMNS)), np.nan)
        segments: list[dict[str, Any]] = []
        params = []
        first_epoch = 0
        for one in prepared:
            first = len(segments)
            segments += [{**fields, "epoch": fields["epoch"] + first_epoch} for fields in one.segments]
            params.append({**one.params, "first_segment": first, "end_segment": len(segments)})
            first_epoch += len(one.epochs)
        self.segments = _records(segments, _hints(Segment))
        self.params = _records(params, _hints(LoopParams))
        self.lines, self.line_from = _flat([one.line for one in prepared])
        self.points_s, self.points_from = _flat([one.recorded[0] for one in prepared])
        self.points_n, _ = _flat([one.recorded[1] for one in prepared])
        self.history_m, self.history_from = _flat([one.history for one in prepared])
        self.history_s = np.zeros_like(self.history_m)

    def arguments(self) -> tuple[Any, ...]:
        """In the order of the compiled sweep."""
        return (
            self.plants,
            self.epochs,
            self.lines,
            self.line_from,
            self.points_s,
            self.points_n,
            self.points_from,
            self.history_m,
            self.history_s,
            self.history_from,
            self.loops,
            self.params,
            self.segments,
            self.law_states,
            self.law_params,
            self.ticks,
            self.ledgers,
            self.traces,
        )


def _bound(switches: Mapping[str, bool], step: Callable[..., Any], update: Callable[..., Any]) -> Callable[..., None]:
    """`run` with the terms, the law and the ledger that it needs."""
    calls: dict[str, Callable[..., Any]] = {"law_step": step, "ledger_update": update}
    calls["move"] = specialise(move, switches)
    calls["sense"] = specialise(sense, switches)
    return specialise(run, switches, calls)


@lru_cache(maxsize=32)
def _machine_code(law: ModuleType, switches: tuple[tuple[str, bool], ...]) -> Any:
    memo = {law.step: compiled_step(law)}
    loop = compiled(_bound(dict(switches), law.step, EnergyLedger.update), memo)

    @njit(**OPTIONS)  # type: ignore[untyped-decorator]
    def one(
        at: Any,
        plants: Any,
        plant_epochs: Any,
        lines: Any,
        line_from: Any,
        points_s: Any,
        points_n: Any,
        points_from: Any,
        history_m: Any,
        history_s: Any,
        history_from: Any,
        loops: Any,
        params: Any,
        segments: Any,
        law_states: Any,
        law_params: Any,
        ticks: Any,
        ledgers: Any,
        traces: Any,
    ) -> None:
        plant = on_stack(plants[at])
        state = on_stack(loops[at])
        law_state = on_stack(law_states[at])
        ledger = on_stack(ledgers[at])
        points = slice(points_from[at], points_from[at + 1])
        past = slice(history_from[at], history_from[at + 1])
        loop(
            plant,
            plant_epochs,
            Buffers(lines[line_from[at] : line_from[at + 1]], points_s[points], points_n[points]),
            LoopBuffers(history_m[past], history_s[past]),
            state,
            on_stack(params[at]),
            segments,
            law_state,
            on_stack(law_params[at]),
            on_stack(ticks[at]),
            ledger,
            traces[at],
        )
        loops[at] = state
        law_states[at] = law_state
        ledgers[at] = ledger

    @njit(parallel=True, **OPTIONS)  # type: ignore[untyped-decorator]
    def sweep(
        first: Any,
        stop: Any,
        plants: Any,
        plant_epochs: Any,
        lines: Any,
        line_from: Any,
        points_s: Any,
        points_n: Any,
        points_from: Any,
        history_m: Any,
        history_s: Any,
        history_from: Any,
        loops: Any,
        params: Any,
        segments: Any,
        law_states: Any,
        law_params: Any,
        ticks: Any,
        ledgers: Any,
        traces: Any,
    ) -> None:
        for at in prange(first, stop):
            one(
                at,
                plants,
                plant_epochs,
                lines,
                line_from,
                points_s,
                points_n,
                points_from,
                history_m,
                history_s,
                history_from,
                loops,
                params,
                segments,
                law_states,
                law_params,
                ticks,
                ledgers,
                traces,
            )

    return sweep


@lru_cache
def _hints(cls: type[Any]) -> dict[str, type[Any]]:
    return {name: kind for name, kind in typing.get_type_hints(cls).items() if kind in (float, int, bool)}


def _fields(plain: Any) -> dict[str, Any]:
    return {name: getattr(plain, name) for name in type(plain).__slots__}


def _plain(fields: Mapping[str, Any]) -> Any:
    return plain_object("Fields", dict(fields))


def _records(rows: Sequence[Mapping[str, Any]], fields: Mapping[str, type[Any]]) -> np.ndarray[Any, Any]:
    array = np.zeros(len(rows), record_dtype(fields))
    for name in fields:
        array[name] = [row[name] for row in rows]
    return array


def _flat(lists: Sequence[Sequence[float]]) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Lists end to end, and where each begins."""
    starts = np.cumsum([0, *(len(one) for one in lists)])
    return np.array([value for one in lists for value in one], dtype=float), starts


def _store(row: Any, plain: Any) -> None:
    for name in row.dtype.names:
        if hasattr(plain, name):
            row[name] = getattr(plain, name)
