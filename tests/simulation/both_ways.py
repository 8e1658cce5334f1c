"""One loop both ways, tick by tick: the daemon's own tick with the loopback device, and the batch kernel.

Whatever the two remember of a tick is a column. The kernel runs in segments of one tick, so that all of it can be seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from types import ModuleType
from typing import Any, Literal

import numpy as np

from hapticd.config.models import SceneConfig, VelocityConfig
from hapticd.config.safety import SafetyConfig
from hapticd.errors import DeviceFaultError
from hapticd.law import LawTick, state_fields
from hapticd.simulation.batch import TRACE_COLUMNS, Batch, Point
from hapticd.simulation.batch.engine import plain_loop
from hapticd.simulation.batch.kernel import bound
from hapticd.simulation.batch.machine_code import machine_code
from hapticd.tick.contact import RunningLaw
from hapticd.tick.energy import EnergyLedger
from hapticd.tick.event import EventCode
from hapticd.tick.guard import Guard
from hapticd.tick.tick import ControlTick
from hapticd_drivers.loopback import Loopback

PLANT = ("x_m", "v_m_per_s", "measured_m", "applied_n")
LOOP = ("force_n", "damping_n_s_per_m", "felt_mass_kg", "applied_spring_n")
WALL = ("stiffness_n_per_m", "damping_n_s_per_m", "spring_n")
COPIES = (
    "motion.position_m",
    "motion.velocity_m_per_s",
    "motion.dt_s",
    "contact.x_m",
    "contact.moved_m",
    "contact.in_contact",
    "contact.contact_n",
    "contact.applied_n",
    "contact.applied_contact_n",
    "contact.force_n",
    "contact.requested_n",
    "tick.requested_n",
    "tick.force_n",
    "guard.limited",
)
REPORT = (
    "low_m",
    "high_m",
    "low_measured_m",
    "high_measured_m",
    "sum_x_m",
    "sum_force_n",
    "peak_force_n",
    "outside_tick",
    "ticks",
    "finite",
)

_plant, _loop, _wall, _report = (attrgetter(*names) for names in (PLANT, LOOP, WALL, REPORT))
_tick, _ledger = attrgetter(*LawTick.__slots__), attrgetter(*EnergyLedger.__slots__)

Row = tuple[float, ...]


class _NotShown:
    """What a law would have been shown, and would remember, had it not rested: equal to anything."""

    def __eq__(self, other: object) -> bool:
        return True

    def __hash__(self) -> int:
        return 0


_NOT_SHOWN: Any = _NotShown()
_RESTING = frozenset(("tick.x_m", "tick.moved_m", "tick.velocity_m_per_s", "contact.moved_m"))


@dataclass(frozen=True, slots=True)
class Case:
    """One loop.

    Attributes:
        law: the law.
        point: what the kernel is given.
        ticks: how many are run.
        window: the last of them, that are reported on.
        trace_every: how many ticks a row of the trace stands for.
        stepwise: whether the kernel's segments are cut into ticks; if not, only its last tick is seen.
        safety: which of the guard's two limits the daemon has from the point; the other is far.
    """

    law: ModuleType
    point: Point
    ticks: int
    window: int = 50
    trace_every: int = 3
    stepwise: bool = True
    safety: Literal["both", "axis", "magnitude"] = "both"


@dataclass(slots=True)
class Run:
    """What was remembered: a row a tick, until it ended or failed; the kernel's own report, and its trace."""

    rows: list[Row] = field(default_factory=list)
    report: Row = ()
    trace: list[list[float]] = field(default_factory=list)


def names(law: ModuleType) -> list[str]:
    """The columns of a row."""
    parts: dict[str, Sequence[str]] = {
        "plant": PLANT,
        "loop": LOOP,
        "tick": LawTick.__slots__,
        "wall": WALL,
        "ledger": EnergyLedger.__slots__,
        "law": list(state_fields(law)),
    }
    return [f"{part}.{name}" for part, each in parts.items() for name in each] + list(COPIES)


def batch_of(cases: Sequence[Case]) -> Batch:
    """Loops of one law and of as many ticks."""
    first = cases[0]
    batch = Batch(first.law, [case.point for case in cases], 1.0, trace_every=first.trace_every)
    for at, case in enumerate(cases):
        period_s = case.point.period_s
        one = type(batch.prepared[at])(
            case.law, case.point, case.ticks * period_s, case.window * period_s, case.trace_every
        )
        assert (one.ticks, one.window) == (case.ticks, case.window)
        if case.stepwise:
            one.segments = [
                {**segment, "start": tick, "stop": tick + 1}
                for segment in one.segments
                for tick in range(segment["start"], segment["stop"])
            ]
        batch.prepared[at] = one
    return batch


def by_the_kernel(
    case: Case, make: Callable[..., Callable[..., None]] = bound, switches: Mapping[str, bool] | None = None
) -> Run:
    """The interpreted kernel.

    Args:
        case: the loop.
        make: `bound`, or that of a kernel with a slip.
        switches: on or off, whatever the loop needs.
    """
    batch = batch_of([case])
    trace = np.full((case.ticks // case.trace_every, len(TRACE_COLUMNS)), np.nan)
    objects = plain_loop(batch.prepared[0], trace)
    asked_n = 0.0

    def step(state: Any, params: Any, tick: Any) -> float:
        nonlocal asked_n
        asked_n = float(case.law.step(state, params, tick))
        return asked_n

    kernel = make({**batch.switches, **(switches or {})}, step)
    law_state = _fields(case.law)
    plant, tick, wall, ledger = objects.device.state, objects.law.tick, objects.wall, objects.ledger
    loop, params = objects.control.state, objects.control.params
    dt_s, limit_n = params.dt_s, params.limit_n
    run = Run()
    for at in range(case.ticks if case.stepwise else 1):
        if case.stepwise:
            params.first_segment, params.end_segment = at, at + 1
        kernel(*objects)
        if not loop.finite:
            break
        x_m, velocity = tick.x_m, tick.velocity_m_per_s
        requested_n = asked_n if tick.in_contact else 0.0
        run.rows.append(
            (
                *_plant(plant),
                *_loop(loop),
                *_tick(tick),
                *_wall(wall),
                *_ledger(ledger),
                *law_state(objects.law.state),
                x_m,
                velocity,
                dt_s,
                x_m,
                tick.moved_m,
                tick.in_contact,
                tick.contact_n,
                tick.applied_n,
                tick.applied_contact_n,
                requested_n,
                requested_n,
                requested_n,
                loop.force_n,
                abs(requested_n) > limit_n,
            )
        )
    run.report = _report(loop)
    run.trace = trace.tolist()
    return run


def by_machine_code(cases: Sequence[Case]) -> list[Run]:
    """The compiled kernel over stepwise loops of one law and of as many ticks; without the columns of `COPIES`."""
    batch = batch_of(cases)
    ticks = cases[0].ticks
    arrays = batch.arrays()
    arrays = arrays._replace(traces=np.full((len(cases), ticks // cases[0].trace_every, len(TRACE_COLUMNS)), np.nan))
    code = machine_code(batch.law, tuple(sorted(batch.switches.items())))
    first = arrays.params["first_segment"].copy()
    runs = [Run() for _ in cases]
    parts = (
        (arrays.plants, PLANT),
        (arrays.loops, LOOP),
        (arrays.ticks, LawTick.__slots__),
        (arrays.walls, WALL),
        (arrays.ledgers, EnergyLedger.__slots__),
        (arrays.law_states, list(state_fields(batch.law))),
    )
    snapshots = []
    for at in range(ticks):
        arrays.params["first_segment"] = first + at
        arrays.params["end_segment"] = first + at + 1
        # One that has ended is not gone on with.
        arrays.params["end_segment"][~arrays.loops["finite"]] = 0
        code(0, len(cases), arrays)
        snapshots.append((arrays.loops["finite"].copy(), [part.copy() for part, _ in parts]))
    for finite, copies in snapshots:
        columns = [one[name].tolist() for one, (_, each) in zip(copies, parts, strict=True) for name in each]
        for index, (run, row) in enumerate(zip(runs, zip(*columns, strict=True), strict=True)):
            if finite[index]:
                run.rows.append(row)
    for index, run in enumerate(runs):
        run.report = tuple(arrays.loops[name][index].item() for name in REPORT)
        run.trace = arrays.traces[index].tolist()
    return runs


def by_the_daemon(case: Case) -> Run:
    """The daemon's tick, from outside the wall, as `hapticd simulate` runs it; the report is what its rows say."""
    point = case.point
    driver = Loopback(point.device, point.period_s)
    place_m, outward = point.wall.position_m, 1.0 if point.wall.free_side == "positive" else -1.0
    driver.place(place_m, int(outward))
    info = driver.open()
    tick = ControlTick(
        SceneConfig(walls=(point.wall,)),
        VelocityConfig(samples=point.velocity_samples),
        Guard(_safety(case), info),
        info,
        lambda: RunningLaw(case.law, point.params),
        point.period_s,
        0.05,
    )
    tick.start(driver.read())
    assert not tick.contacts[0].in_contact
    assert tick.arm()
    driver.enable()
    device = driver.model
    (contact,) = tick.contacts
    motion, guard = tick.motion, tick.guard
    law_state = _fields(case.law)
    rested = [name in _RESTING or name.startswith("law.") for name in names(case.law)]
    run = Run()
    for _ in range(case.ticks):
        awake = contact.awake
        try:
            force_n = tick.step(driver.read(), point.period_s)
        except DeviceFaultError:
            break
        if tick.fault:
            assert tick.fault in (EventCode.SAMPLE_IMPOSSIBLE, EventCode.LAW_FAILED), tick.fault_text
            break
        driver.write(force_n)
        run.rows.append(
            (
                *_plant(device),
                outward * force_n[0],
                contact.damping_n_s_per_m,
                contact.felt_mass_kg,
                contact._applied_spring_n,
                *_tick(contact.tick),
                *_wall(contact.wall),
                *_ledger(contact.ledger),
                *law_state(contact.law.state),
                outward * (motion.position_m[0] - place_m),
                outward * motion.velocity_m_per_s[0],
                motion.dt_s,
                contact.x_m,
                contact._moved_m,
                contact.in_contact,
                contact._contact_n,
                contact.applied_n,
                contact._applied_contact_n,
                contact.force_n,
                contact.requested_n,
                outward * tick.requested_n[0],
                outward * tick.force_n[0],
                guard.limited,
            )
        )
        if not awake and not contact.in_contact:
            row = run.rows[-1]
            run.rows[-1] = tuple(_NOT_SHOWN if rests else value for rests, value in zip(rested, row, strict=True))
    _tell(case, run)
    return run


def difference(case: Case, ours: Run, theirs: Run) -> str:
    """The first place where two runs are not equal, to the last bit; empty when they are. 0 and -0 are equal.

    Args:
        case: the loop.
        ours: a row may end before `COPIES`.
        theirs: all columns.
    """
    their_rows = theirs.rows
    if not case.stepwise:
        their_rows = their_rows[-1:] if len(their_rows) == case.ticks else []
    for at, (our_row, their_row) in enumerate(zip(ours.rows, their_rows, strict=False)):
        if our_row != their_row:
            for name, one, other in zip(names(case.law), our_row, their_row, strict=False):
                if one != other:
                    return f"tick {at}: {name} is {one!r}, and not {other!r}"
    if len(ours.rows) != len(their_rows):
        return f"one ends after {len(ours.rows)} ticks, the other after {len(their_rows)}"
    for name, one, other in zip(REPORT, ours.report, theirs.report, strict=True):
        if one != other:
            return f"report: {name} is {one!r}, and not {other!r}"
    if not np.array_equal(ours.trace, theirs.trace, equal_nan=True):
        return "the traces differ"
    return ""


def _safety(case: Case) -> SafetyConfig:
    limit_n = case.point.max_force_n
    if limit_n == math.inf:
        return SafetyConfig(profile="simulation")
    force_n = 1000.0 if case.safety == "axis" else limit_n
    axis_n = 1000.0 if case.safety == "magnitude" else limit_n
    return SafetyConfig(max_force_n=force_n, max_axis_force_n=axis_n)


def _fields(law: ModuleType) -> Callable[[Any], Row]:
    fields = list(state_fields(law))
    return lambda state: tuple(getattr(state, name) for name in fields)


def _tell(case: Case, run: Run) -> None:
    """Report and trace, from the rows."""
    column = names(case.law).index
    x, v, measured, applied = (column(f"plant.{name}") for name in PLANT)
    force = column("loop.force_n")
    kept = (x, v, measured, force, column("ledger.energy_j"), column("loop.damping_n_s_per_m"))
    whole = len(run.rows) == case.ticks
    last = run.rows[case.ticks - case.window :]
    one = batch_of([case]).prepared[0]
    target_m, band_m = one.params["target_m"], one.params["band_m"]
    outside = -1
    if not math.isnan(target_m):
        outside = max((at for at, row in enumerate(run.rows) if not abs(row[x] - target_m) <= band_m), default=-1)
    sum_x_m = sum_force_n = 0.0
    for row in last:  # in this order, not by `sum`, which is more exact on some versions
        sum_x_m += row[x]
        sum_force_n += row[applied]
    run.report = (
        min((row[x] for row in last), default=math.inf),
        max((row[x] for row in last), default=-math.inf),
        min((row[measured] for row in last), default=math.inf),
        max((row[measured] for row in last), default=-math.inf),
        sum_x_m,
        sum_force_n,
        max((abs(row[force]) for row in run.rows), default=0.0),
        outside,
        len(run.rows),
        whole,
    )
    rows = run.rows[case.trace_every - 1 :: case.trace_every]
    run.trace = [[row[at] for at in kept] for row in rows]
    run.trace += [[math.nan] * len(kept)] * (case.ticks // case.trace_every - len(rows))
