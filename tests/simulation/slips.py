"""Every single slip in the batch kernel and in the tick's half of it, and whether chosen loops show it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import partial
from types import FunctionType

from hapticd.simulation.batch import kernel
from hapticd.simulation.batch.prepare import Prepared
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.driver import SimulatedDriver
from hapticd.tick.contact import Contact
from hapticd.tick.guard import Guard
from hapticd.tick.motion import Motion
from hapticd.tick.scene import Wall
from hapticd.tick.tick import ControlTick
from hapticd.tick.velocity import LongDifference
from tests.simulation.both_ways import Case, Run, by_the_daemon, by_the_kernel, difference
from tests.simulation.loops import chosen_cases
from tests.simulation.mutants import Mutant, mutants

SWITCHES = dict.fromkeys(("LONG_VELOCITY", "LIMIT", "LEDGER", "SETTLING", "TRACE"), True)
"""On in every loop below, whether it needs them or not."""

KERNEL = (kernel.run, kernel.report, kernel.record)
TICK: tuple[tuple[type, str], ...] = (
    (ControlTick, "step"),
    (Motion, "see"),
    (LongDifference, "update"),
    (Contact, "observe"),
    (Contact, "act"),
    (Contact, "settle"),
    (Guard, "reduce"),
    (Wall, "pass_time"),
    (SimulatedDriver, "_read"),
    (SimulatedDriver, "_write"),
    (SimulatedDevice, "advance"),
)
PREPARED = (Prepared, "_segments")

APART = {
    "ControlTick.step": {
        "if guard.mode is not _DISARMED:": "stops for speed and for a frozen device, which a simulation has not",
        "passed_s = self.period_s if self._simulated else self._passed(clock_dt_s)": (
            "time on a real device; tests/tick/test_tick_time.py"
        ),
        "waiting.hold(periods)": "a simulated device does not repeat a sample",
        "self._see_again()": "after a position that was not possible the kernel has ended",
        "if not seen or sight.gain > 0.0:": "the same",
        "if self.leaving:": "walls that are gone: the kernel's stays",
        "if law_clock is not None:": "laws are not timed in a simulation; tests/tick/test_law_time.py",
        "except KeyboardInterrupt:": "nobody presses Ctrl-C",
    },
    "Motion.see": {
        "if self._has_clock:": "the device has a clock; its time and its order are tested in tests/tick/test_motion.py",
        "if repeats:": "a simulated device does not repeat a sample",
        "if LEAST_S <= dt_s < MOST_S:": "its time between samples is the period",
        "if not low_m <= position_m <= high_m:": "the driver ends sooner",
        "speed_squared = 0.0": "stops for speed; tests/tick/test_tick_time.py",
        "if watches_speed:": "the same",
        "self.speed_squared = speed_squared": "the same",
        "if at_rest:": "after a position that was not possible the kernel has ended",
        "position_m -= origin_m[axis]": "nothing is tared",
    },
    "Wall.pass_time": {
        "changed = False": "changes come by a ramp on a real device; tests/tick/test_tick_time.py",
        "changed = True": "the same",
        "return changed": "the same",
    },
    "Contact.act": {
        "if self.waited > 0.0:": "a simulated device does not repeat a sample",
        "self.blending = False": "blends are at transitions, which the kernel has not",
    },
    "Contact.settle": {"if self.blending:": "the same"},
    "Guard.reduce": {
        "if self.changing:": "limits that change and releases are transitions",
        "if self.mode is not _ARMED:": "the kernel is always armed",
        "self.latched = True": "no law's force comes through that is so large",
        "self.drop()": "the same",
    },
    "SimulatedDriver._read": {
        "self._started_ns = self._now_ns()": "clock = wall is not for studies",
        "self._catch_up(device)": "the same",
        "if device is None:": "several axes; tests/simulation/test_space_device.py",
        "sample.sequence = device.ticks": "its clock is looked at, not its count",
        "raise DeviceFaultError(f'the model has diverged after {device.ticks * self.period_s:g} s')": "what it tells",
    },
    "SimulatedDriver._write": {
        "if self._space is not None:": "the same",
    },
}
"""Statements of the tick that the kernel has no other half of, and why."""


EQUAL: dict[str, dict[str, tuple[str, ...]]] = {
    "at the very bound both give the same number": {
        "run: if tick.applied_n > loop.peak_force_n:": ("Gt 0 is GtE",),
        "run: if tick.applied_n < -loop.peak_force_n:": ("Lt 0 is LtE",),
        "run: if LIMIT and (force_n > params.limit_n or force_n < -params.limit_n):": ("Gt 0 is GtE", "Lt 0 is LtE"),
        "run: if LIMIT and wall.spring_n > params.limit_n:": ("Gt 0 is GtE",),
        "report: if plant.x_m < loop.low_m:": ("Lt 0 is LtE",),
        "report: if plant.x_m > loop.high_m:": ("Gt 0 is GtE",),
        "report: if plant.measured_m < loop.low_measured_m:": ("Lt 0 is LtE",),
        "report: if plant.measured_m > loop.high_measured_m:": ("Gt 0 is GtE",),
        "Contact.settle: self._applied_spring_n = gain * (spring_n if spring_n <= limit_n else limit_n)": (
            "LtE 0 is Lt",
        ),
        "Guard.reduce: if newton > max_axis_n or newton < -max_axis_n:": ("Gt 0 is GtE", "Lt 0 is LtE"),
        "Guard.reduce: if not squared <= self._max_squared:": ("LtE 0 is Lt",),
        "Guard.reduce: if squared < math.inf:": ("Lt 0 is LtE",),
    },
    "the one-sample difference does not look at the device's own velocity": {
        "run: velocity = difference(loop, x_m, params.dt_s, 0.0)": ("0.0 is 1.0",),
    },
    "a force times 1 is itself, and the smaller of two does not depend on their order": {
        "Guard.reduce: if share != 1.0:": ("1.0 is 2.0",),
        "Guard.reduce: share = min(share, max_axis_n / abs(newton))": ("share one later",),
        "Guard.reduce: share = min(share, self.max_force_n / math.sqrt(squared))": ("share one later",),
        "Prepared._segments: found.append({'start': start, 'stop': min(stop, self.ticks), 'epoch': sum((first <= start "
        "for first in epoch_starts)) - 1, 'stiffness_n_per_m': float(k), 'damping_n_s_per_m': float(b), 'last_window': "
        "start >= self.ticks - self.window})": ("stop one later",),
    },
    "there is one axis": {
        "ControlTick.step: for contact in self._active:": ("without axis = wall.axis",),
        "ControlTick.step: for contact in contacts:": ("without wall = contact.wall",),
    },
    "time between samples is the period, always": {
        "LongDifference.update: if dt_s > 0.0:": ("Gt 0 is GtE",),
        "ControlTick.step: if dt_s > 0.0:": (
            "Gt 0 is GtE", "without contacts = self._active", "without for waiting in contacts:",
        ),
        "ControlTick.step: seen = motion.see(sample, clock_dt_s, passed_s, sight.blind)": ("clock_dt_s one later",),
        "Contact.settle: if dt_s > 0.0 and (touched or self._touched):": ("Gt 0 is GtE",),
        "Contact.observe: def observe(self, x_m, velocity_m_per_s, dt_s):": ("without tick.dt_s = dt_s",),
    },
    "what does not pass the quick look goes to `_number`, which looks at the same": {
        "Contact.act: if force_n.__class__ is not float or not -MOST < force_n < MOST:": (
            "IsNot 0 is Is", "Lt 0 is Gt", "Lt 1 is Gt", "-MOST turned round",
        ),
        "Contact.act: self.damping_n_s_per_m = value if value.__class__ is float and -MOST < value < MOST else "
        "_number(value)": ("Is 0 is IsNot", "Lt 0 is Gt", "Lt 1 is Gt", "-MOST turned round"),
        "Contact.act: self.felt_mass_kg = value if value.__class__ is float and -MOST < value < MOST else "
        "_number(value)": ("Is 0 is IsNot", "Lt 0 is Gt", "Lt 1 is Gt", "-MOST turned round"),
    },
    "nothing blends": {
        "Contact.act: self.force_n = blended(self, self.x_m, force_n, periods) if self.blending else force_n": (
            "self.x_m one later", "force_n one later",
        ),
    },
    "the trace begins with the first tick; tests/simulation/test_batch.py has others": {
        "run: traced = count - params.trace_from": ("Add in count - params.trace_from",),
        "run: if count >= params.trace_from and (traced + 1) % params.trace_every == 0:": ("GtE 0 is Gt",),
    },
    "it only saves time": {
        "ControlTick.step: if x_m < 0.0 or contact.awake:": ("Lt 0 is LtE", "0.0 is 1.0"),
        "Contact.settle: touched = in_contact or self.applied_n != 0.0": ("0.0 is 1.0",),
        "Contact.settle: if dt_s > 0.0 and (touched or self._touched):": (
            "without self._touched = touched", "without self.awake = touched or not self.law.rests",
        ),
    },
    "a debt that is left where contact ends is for the next law; tests/tick/test_tick_books.py": {
        "Contact.settle: if dt_s > 0.0 and (touched or self._touched):": ("and is or, or is and",),
        "Wall.pass_time: def pass_time(self, periods):": ("without self.changes_left = bool(self._changes)",),
        "Prepared._segments: for start, stop in zip(starts, [*starts[1:], self.ticks], strict=True):": (
            "without if start >= self.ticks:", "True is False",
        ),
        "Prepared._segments: if start >= self.ticks:": ("without break", "GtE 0 is Gt"),
    },
}  # fmt: skip
"""Slips that change no number, and why."""

HARMLESS = {f"{line}  [{what}]" for lines in EQUAL.values() for line, slips in lines.items() for what in slips}


@contextmanager
def put_in(owner: type, name: str, function: FunctionType) -> Iterator[None]:
    """A method with a slip, for a while."""
    before = vars(owner)[name]
    setattr(owner, name, function)
    try:
        yield
    finally:
        setattr(owner, name, before)


class Slips:
    """Every single slip in the kernel's functions and in the tick's half of them.

    A slip in the kernel is held against the tick, one in the tick against the kernel.
    """

    def __init__(self) -> None:
        self.cases = chosen_cases()
        self.by_the_daemon = [by_the_daemon(case) for case in self.cases]
        self.by_the_kernel = [by_the_kernel(case, switches=SWITCHES) for case in self.cases]
        named = [*SWITCHES, "LAW_DAMPING", "LAW_MASS"]
        self.of_the_kernel = [mutant for function in KERNEL for mutant in mutants(function, named)]
        self.of_methods = [
            (owner, name, mutant)
            for owner, name in (*TICK, PREPARED)
            for mutant in mutants(vars(owner)[name], apart=APART.get(f"{owner.__name__}.{name}", ()))
        ]

    def all(self) -> list[Mutant]:
        """Each of them."""
        return self.of_the_kernel + [mutant for _, _, mutant in self.of_methods]

    def living(self, chosen: Collection[Mutant]) -> list[str]:
        """Those among the chosen that no loop shows."""
        found = []
        for mutant in self.of_the_kernel:
            if mutant in chosen and not self._shows(partial(by_the_kernel, make=_kernel_of(mutant), switches=SWITCHES)):
                found.append(str(mutant))
        for owner, name, mutant in self.of_methods:
            if mutant in chosen:
                with put_in(owner, name, mutant.into(dict(vars(owner)[name].__globals__))):
                    shown = self._shows(partial(by_the_kernel, switches=SWITCHES) if owner is Prepared else None)
                if not shown:
                    found.append(str(mutant))
        return found

    def _shows(self, kernel_run: Callable[[Case], Run] | None) -> bool:
        for case, ours, theirs in zip(self.cases, self.by_the_kernel, self.by_the_daemon, strict=True):
            try:
                if kernel_run is not None:
                    shown = difference(case, kernel_run(case), theirs)
                else:
                    shown = difference(case, ours, by_the_daemon(case))
            except Exception:  # noqa: BLE001 - what cannot even run is seen
                return True
            if shown:
                return True
        return False


def _kernel_of(mutant: Mutant) -> Callable[..., Callable[..., None]]:
    """`bound` of a kernel with this slip."""
    scope = dict(vars(kernel))
    scope["run"] = FunctionType(kernel.run.__code__, scope, "run")
    mutant.into(scope)
    return FunctionType(kernel.bound.__code__, scope, "bound")
