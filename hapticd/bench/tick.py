"""What a tick costs, and how many of them a daemon runs.

The body of a tick is everything between two sleeps of the real `ControlLoop`: read, step, write, record, heartbeat. It
is measured from the sleep that the loop is given, so that nothing of the loop is copied here.
"""

from __future__ import annotations

import contextlib
import gc
import logging
import multiprocessing
import os
import random
import re
import signal
import tempfile
import threading
import time
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any

from hapticd import registry
from hapticd.bench import Bar, Conditions, Progress, Quantiles, Verdict, Watch, doubtful, ratio
from hapticd.config.loading import LoadedConfig, parse
from hapticd.config.models import MAX_WALLS, LoopConfig
from hapticd.contracts.errors import HapticdError
from hapticd.contracts.record import RecordLayout, TickRecord
from hapticd.control.loop import ControlLoop
from hapticd.control.process import make_tick, place_device
from hapticd.control.realtime import become_realtime, die_with_parent, make_sleeper
from hapticd.control.shared import SUPERVISOR_BEAT, RecordReader, SharedMemory
from hapticd.share import directory
from hapticd.supervisor.service import Service
from hapticd.telemetry.status import LateHistogram

RATE_HZ = 1000.0
BAR = 0.03
"""Largest share of the period that the body of a tick may take at 1 kHz, p99."""

CALM = 0.1
"""Processors that other programs may keep busy for a missed bar to count: they share caches and cores with the tick."""

WARM_TICKS = 60
"""First ticks of a block that are not counted: arming, first calls."""

ROUNDS = 10
"""Every case is measured in so many blocks, in a new random order each time, so that all see the same machine."""

BURST_S = 0.07
BURST_PAUSE_S = 0.1
"""A heavy publisher computes in pure Python for `BURST_S`, then only publishes for `BURST_PAUSE_S` [s]."""

START_TIMEOUT_S = 30.0
_SETTLE_S = 0.3
_FOREVER_NS = 10**15
_PIECES = ("nothing", "read", "step", "write", "record")


@dataclass(frozen=True, slots=True)
class Case:
    """Something whose tick is measured.

    Attributes:
        group: "reference", "law", "config" or "walls".
        name: which one of the group.
        text: its configuration; empty for a reference, which has no tick.
        pieces: whether to take the time of the pieces as well, which makes the whole a little slower.
    """

    group: str
    name: str
    text: str = ""
    pieces: bool = False


@dataclass(frozen=True, slots=True)
class Body:
    """What the tick of a case cost.

    Attributes:
        group, name: of the case.
        paced_us: at the set rate, with the caches as a sleep leaves them: the number that counts [us].
        hot_us: back to back [us].
        of_period: p99 of `paced_us` as a share of the period.
        p50_ratio, p99_ratio, hot_ratio: next to the reference, paced and hot (p50).
        problem: why it could not be measured, empty when it could.
    """

    group: str
    name: str
    paced_us: Quantiles
    hot_us: Quantiles
    of_period: float
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


@dataclass(frozen=True, slots=True)
class Rate:
    """What a real daemon did at a set rate.

    Attributes:
        rate_hz: set.
        sustained_hz: ticks executed a second.
        ticks: executed in the time that was looked at.
        skipped: deadlines in the same time that had to be skipped.
        dropped: ticks that the supervisor was too slow to fetch, in the whole run.
        late_us, busy_us: how late the ticks that the supervisor fetched began, and their bodies [us].
        late_histogram: those ticks by how late they were, bins of `LATE_EDGES_US`.
        late_p50_ratio: p50 of `late_us` next to the slowest rate of the same run.
        fault: the loop's own reason to stop, empty when all went well.
        warnings: what the loop could not have.
    """

    rate_hz: float
    sustained_hz: float
    ticks: int
    skipped: int
    dropped: int
    late_us: Quantiles
    busy_us: Quantiles
    late_histogram: tuple[int, ...]
    late_p50_ratio: float
    fault: str
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Report:
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


@dataclass(slots=True)
class Ticks:
    """Tick records in columns, and how the process that ran them fared.

    Attributes:
        seq, deadline_ns, late_us, busy_us, skipped: of each record.
        dropped: records that were overwritten before they were read.
        fault: text of the first fault, empty without one.
        warnings: what the loop could not have.
    """

    seq: array[int] = field(default_factory=lambda: array("q"))
    deadline_ns: array[int] = field(default_factory=lambda: array("q"))
    late_us: array[float] = field(default_factory=lambda: array("d"))
    busy_us: array[float] = field(default_factory=lambda: array("d"))
    skipped: array[int] = field(default_factory=lambda: array("q"))
    dropped: int = 0
    fault: str = ""
    warnings: tuple[str, ...] = ()

    def add(self, record: TickRecord) -> None:
        """Keep a record."""
        self.seq.append(record.seq)
        self.deadline_ns.append(record.deadline_ns)
        self.late_us.append(record.late_us)
        self.busy_us.append(record.busy_us)
        self.skipped.append(record.skipped)

    def from_s(self, settle_s: float) -> Ticks:
        """The same without the first so many seconds."""
        limit_ns = self.deadline_ns[0] + settle_s * 1e9 if self.deadline_ns else 0.0
        first = sum(deadline_ns < limit_ns for deadline_ns in self.deadline_ns)
        return Ticks(
            self.seq[first:],
            self.deadline_ns[first:],
            self.late_us[first:],
            self.busy_us[first:],
            self.skipped[first:],
            self.dropped,
            self.fault,
            self.warnings,
        )


class KeptRecords(RecordReader):
    """A reader of the ring that keeps what it reads, and computes in between if it is to be heavy.

    Args:
        shared: the memory.
        heavy: compute in pure Python for `BURST_S` now and then.

    Attributes:
        ticks: what was read.
    """

    def __init__(self, shared: SharedMemory, heavy: bool) -> None:
        super().__init__(shared)
        self.ticks = Ticks()
        self.started = threading.Event()
        self._burst_at_s = 0.0 if heavy else float("inf")

    def read(self, most: int = 4096) -> list[TickRecord]:
        """The records that are new; a heavy reader takes its time before it says so."""
        records = super().read(most)
        for record in records:
            self.ticks.add(record)
        if records:
            self.started.set()
        if time.monotonic() >= self._burst_at_s:
            _burst(time.monotonic() + BURST_S)
            self._burst_at_s = time.monotonic() + BURST_PAUSE_S
        return records


class RecordedLoop:
    """A control loop in another process, with everything that it recorded.

    Args:
        serve: runs it there: a function of a connection, a configuration's text and `heavy`.
        text: the configuration.
        heavy: with a heavy publisher.

    Raises:
        HapticdError: it could not start.
    """

    def __init__(self, serve: Callable[[Connection, str, bool], None], text: str, heavy: bool = False) -> None:
        spawn = multiprocessing.get_context("spawn")
        self._connection, theirs = spawn.Pipe()
        self._process = spawn.Process(target=serve, args=(theirs, text, heavy))
        self._process.start()
        theirs.close()
        try:
            self._receive(START_TIMEOUT_S)
        except BaseException:
            self.kill()
            raise

    def stop(self) -> Ticks:
        """End it and get its ticks.

        Raises:
            HapticdError: it ended badly.
        """
        try:
            self._process.terminate()
            ticks: Ticks = self._receive(START_TIMEOUT_S)
            self._process.join(5.0)
        finally:
            self.kill()
        return ticks

    def kill(self) -> None:
        """End it whatever it does; harmless when it has ended."""
        self._process.kill()
        self._process.join()

    def _receive(self, timeout_s: float) -> Any:
        try:
            if not self._connection.poll(timeout_s):
                raise HapticdError(f"the measured loop did not answer within {timeout_s:g} s")
            message = self._connection.recv()
        except EOFError:
            raise HapticdError("the measured loop died; its last words are above") from None
        if isinstance(message, HapticdError):
            raise message
        return message


def serve_daemon(connection: Connection, text: str, heavy: bool) -> None:
    """Run the real daemon until SIGTERM: supervisor here, control process of its own."""
    die_with_parent(os.getppid())
    logging.getLogger("hapticd").addHandler(logging.NullHandler())  # its warnings are figures of the report
    with tempfile.TemporaryDirectory(prefix="hapticd-bench-") as runtime:
        os.environ["HAPTICD_RUNTIME_DIR"] = runtime
        try:
            service = Service(parse(text, "benchmark"), "bench")
            kept = KeptRecords(service.control.shared, heavy)
            service.control.reader = kept
            threading.Thread(target=_tell_start, args=(connection, kept.started), daemon=True).start()
            read_events = service.control.events.read

            def watched() -> Any:
                events = read_events()
                for event in events:
                    if event.is_fault and not kept.ticks.fault:
                        kept.ticks.fault = event.text
                return events

            vars(service.control.events)["read"] = watched
            kept.ticks.warnings = tuple(service.control.warnings)
            exit_code = service.run()
            kept.ticks.dropped = kept.dropped
            if exit_code and not kept.ticks.fault:
                kept.ticks.fault = f"the daemon ended with exit code {exit_code}"
            connection.send(kept.ticks)
        except HapticdError as error:
            connection.send(HapticdError(str(error)))


def cases() -> list[Case]:
    """All that there is to measure: references, installed laws, shipped configurations, numbers of walls, pieces."""
    found = [Case("reference", "arithmetic"), Case("reference", "empty loop")]
    found += [Case("law", name, scene(law=name)) for name in registry.names(registry.CONTROLLERS)]
    shapes = set()
    for path in sorted(directory("config").glob("*.toml")):
        text = path.read_text()
        if (shape := _shape(text)) not in shapes:
            shapes.add(shape)
            found.append(Case("config", path.name, text))
    found += [Case("walls", str(walls), scene(walls=walls)) for walls in (0, 1, 2, MAX_WALLS)]
    return [*found, Case("pieces", "energy-cycle", scene(), pieces=True)]


def scene(law: str = "energy-cycle", walls: int = 1, rate_hz: float = RATE_HZ, loop: str = "") -> str:
    """A configuration: the simulated omega.7 pressed with 3 N into walls that share 12 kN/m, all in contact at once.

    Args:
        law: on every wall.
        walls: how many.
        rate_hz: ticks a second [Hz].
        loop: more lines of its [loop] table.
    """
    wall = f"[[scene.walls]]\nstiffness_n_per_m = {12000.0 / max(walls, 1)}\n"
    hand = f'hand.force = {{ profile = "constant", newton = {-3.0 if walls else 0.0} }}\n'
    return (
        f"[loop]\nrate_hz = {rate_hz}\n{loop}\n"
        f'[device.options]\nmodel = "omega7"\n{hand}\n{wall * walls}\n[controller]\nlaw = "{law}"\n'
    )


def measure(
    ticks: int = 4000,
    rounds: int = ROUNDS,
    rates_hz: Sequence[float] = (1000.0, 4000.0, 8000.0),
    rate_s: float = 5.0,
    progress: Progress = lambda seconds: None,
) -> Report:
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
    machine = Watch()

    def advance(seconds: float) -> None:
        machine.look()
        progress(seconds)

    measured = measure_bodies(cases(), ticks, rounds, advance)
    rates: list[Rate] = []
    for rate_hz in rates_hz if rate_s else ():
        rates.append(measure_rate(rate_hz, rate_s, rates[0].late_us.p50 if rates else 0.0))
        advance(rate_s)
    conditions = machine.end()
    return Report(
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
    spawn = multiprocessing.get_context("spawn")
    ours, theirs = spawn.Pipe()
    process = spawn.Process(target=_measure_bodies, args=(theirs, found, ticks, rounds))
    process.start()
    theirs.close()
    try:
        while True:
            message = ours.recv()
            if isinstance(message, HapticdError):
                raise message
            if isinstance(message, Bodies):
                return message
            progress(message)
    except EOFError:
        raise HapticdError("the measuring process died; its last words are above") from None
    finally:
        process.kill()
        process.join()


def measure_rate(rate_hz: float, seconds: float, reference_us: float = 0.0) -> Rate:
    """Run a real daemon at a rate and see what it did.

    Args:
        rate_hz: set [Hz].
        seconds: how long, not counting its start [s].
        reference_us: p50 lateness to compare with; 0: its own [us].

    Raises:
        HapticdError: it could not run, or not a single tick came.
    """
    daemon = RecordedLoop(serve_daemon, scene(rate_hz=rate_hz))
    try:
        time.sleep(_SETTLE_S + seconds)
        ticks = daemon.stop().from_s(_SETTLE_S)
    finally:
        daemon.kill()
    if len(ticks.seq) < 2:
        raise HapticdError(f"the daemon ran no ticks at {rate_hz:g} Hz: {ticks.fault or 'it gave no reason'}")
    # Sequence numbers and the loop's own count of skips also cover ticks that were never fetched.
    executed = ticks.seq[-1] - ticks.seq[0]
    histogram = LateHistogram()
    for each_us in ticks.late_us:
        histogram.add(each_us)
    late_us = Quantiles.of(ticks.late_us)
    return Rate(
        rate_hz=rate_hz,
        sustained_hz=executed / ((ticks.deadline_ns[-1] - ticks.deadline_ns[0]) * 1e-9),
        ticks=executed,
        skipped=ticks.skipped[-1] - ticks.skipped[0],
        dropped=ticks.dropped,
        late_us=late_us,
        busy_us=Quantiles.of(ticks.busy_us),
        late_histogram=tuple(histogram.counts),
        late_p50_ratio=ratio(late_us.p50, reference_us or late_us.p50),
        fault=ticks.fault,
        warnings=ticks.warnings,
    )


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


def stopwatch(
    spent_ns: array[int],
    sleep_until: Callable[[int], None] | None,
    stop: Callable[[], None],
    now_ns: Callable[[], int] = time.monotonic_ns,
) -> Callable[[int], None]:
    """A sleep for the loop that takes the time of everything between two sleeps.

    Args:
        spent_ns: filled from the start, an element a tick; the time before the first sleep is left out [ns].
        sleep_until: the real sleep; None does not sleep, so that ticks run back to back.
        stop: called when `spent_ns` is full.
        now_ns: the clock.
    """
    count = -1
    last = len(spent_ns) - 1
    woke_ns = 0

    def sleep(deadline_ns: int) -> None:
        nonlocal count, woke_ns
        body_ns = now_ns() - woke_ns
        if 0 <= count <= last:
            spent_ns[count] = body_ns
            if count == last:
                stop()
        count += 1
        if sleep_until is not None:
            sleep_until(deadline_ns)
        woke_ns = now_ns()

    return sleep


def timed(function: Callable[..., Any], spent_ns: list[int]) -> Callable[..., Any]:
    """The same function, taking the time of each call."""
    now_ns = time.monotonic_ns

    def call(*arguments: Any) -> Any:
        started_ns = now_ns()
        result = function(*arguments)
        spent_ns.append(now_ns() - started_ns)
        return result

    return call


class _Samples:
    """Times of one case, collected block by block [ns]."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.config = parse(case.text, case.name) if case.text else None
        self.paced: array[int] = array("q")
        self.hot: array[int] = array("q")
        self.pieces: dict[str, list[int]] = {name: [] for name in _PIECES} if case.pieces else {}
        self.problem = ""

    def run(self, ticks: int, sleep_until: Callable[[int], None] | None) -> None:
        """Measure one more block."""
        if self.problem:
            return
        spent: array[int] = array("q", bytes(8 * (WARM_TICKS + ticks)))
        pieces: dict[str, list[int]] = {name: [] for name in self.pieces if sleep_until is not None}
        try:
            if self.config is not None:
                _run_loop(self.config, spent, sleep_until, pieces)
            else:
                _run_reference(_arithmetic if self.case.name == "arithmetic" else _nothing, spent, sleep_until)
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
        sleep_until = make_sleeper()
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


def _run_loop(
    config: LoadedConfig,
    spent: array[int],
    sleep_until: Callable[[int], None] | None,
    pieces: dict[str, list[int]],
) -> None:
    """Run the real loop on the configuration's device until `spent` is full."""
    settings = config.config
    driver = config.driver(config.options, settings.loop.period_s)
    place_device(config, driver)
    info = driver.open()
    shared = SharedMemory(RecordLayout(len(info.axes), info.has_orientation, MAX_WALLS), settings.loop.rate_hz)
    try:
        shared.words[SUPERVISOR_BEAT] = time.monotonic_ns() + _FOREVER_NS  # there is none that could stall
        sleep = stopwatch(spent, sleep_until, _end_block)
        tick = make_tick(config, info)
        control = ControlLoop(driver, tick, shared, settings.loop, settings.safety, True, _also(sleep, pieces))
        for owner, method, name in (
            (driver, "read", "read"),
            (driver, "write", "write"),
            (tick, "step", "step"),
            (control, "_record", "record"),
        ):
            if pieces:
                setattr(owner, method, timed(getattr(owner, method), pieces[name]))
        with contextlib.suppress(_Full):
            control.run()
        if pieces:
            del pieces["read"][0]  # where the loop found the device, before its first tick
        if tick.guard.latched:
            raise HapticdError(tick.fault_text or "stopped by a fault")
    finally:
        driver.close()
        shared.close()


def _run_reference(work: Callable[[], Any], spent: array[int], sleep_until: Callable[[int], None] | None) -> None:
    """Run a loop of the same form with other work until `spent` is full."""
    sleep = stopwatch(spent, sleep_until, _end_block)
    period_ns = round(1e9 / RATE_HZ)
    deadline_ns = time.monotonic_ns() // period_ns * period_ns + 2 * period_ns
    with contextlib.suppress(_Full):
        while True:
            sleep(deadline_ns)
            work()
            deadline_ns += period_ns
            deadline_ns = max(deadline_ns, time.monotonic_ns() // period_ns * period_ns)


class _Full(Exception):  # noqa: N818 - nothing went wrong
    """Ends a block."""


def _end_block() -> None:
    raise _Full


def _arithmetic() -> float:
    """The reference: a hundred multiplications and additions, interpreted."""
    value = 1.0
    for _ in range(100):
        value = value * 0.999 + 0.001
    return value


def _nothing() -> None:
    pass


def _also(sleep: Callable[[int], None], pieces: dict[str, list[int]]) -> Callable[[int], None]:
    """The same sleep; where pieces are timed, an empty function is timed after it."""
    if not pieces:
        return sleep
    nothing = timed(_nothing, pieces["nothing"])

    def both(deadline_ns: int) -> None:
        sleep(deadline_ns)
        nothing()

    return both


def _burst(until_s: float) -> None:
    total = 0
    while time.monotonic() < until_s:
        for number in range(2000):
            total += number * number


def _tell_start(connection: Connection, started: threading.Event) -> None:
    if started.wait(START_TIMEOUT_S):
        connection.send(None)


def _shape(text: str) -> str:
    """What is left of a configuration without comments and numbers: files alike in it run the same tick."""
    lines = (line.partition("#")[0].strip() for line in text.splitlines())
    return re.sub(r"[-+]?\d[\d.e_]*", "0", "\n".join(line for line in lines if line))
