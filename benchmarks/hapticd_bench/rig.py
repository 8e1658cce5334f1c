"""What a rig's driver costs over a serial line: its share of a tick, and the way to the rig and back.

    hapticd bench rig [--ticks 4000] [--quick] [--json]

Two pseudo-terminals, at the far end of each a C program (`rig_peer.c`): behind one the protocol core of the firmware,
which the driver talks to, behind the other one that answers each write with as many bytes. The reference is a bare
`os.write` and `os.read` on that one. Both are done in every tick, in turns which goes first.
"""

from __future__ import annotations

import contextlib
import os
import pty
import select
import signal
import subprocess
import tempfile
import termios
import time
import tty
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from hapticd import plugins
from hapticd.config.models import LoopConfig
from hapticd.driver import Driver
from hapticd.errors import HapticdError
from hapticd.loop.realtime import become_realtime, die_with_parent, sleep_until
from hapticd.measure import Conditions, MachineWatch, Progress, Quantiles, ratio
from hapticd.paths import directory
from hapticd_bench.compiling import compile_c
from hapticd_bench.tick.spawned import Spawned

RATE_HZ = 1000.0
DRIVER = "serial-rig"

_SOURCE = Path(__file__).with_name("rig_peer.c")
_COMMAND = bytes(range(1, 14)) + b"\0"
"""As many bytes as a FORCE of one axis has on the line."""

_ANSWER_S = 1.0
_PERIOD_NS = round(1e9 / RATE_HZ)


@dataclass(frozen=True, slots=True)
class RigReport:
    """What was measured.

    Attributes:
        driver_us, raw_us: share of a tick: reading the last answer and writing the next command [us].
        share_p50_ratio, share_p99_ratio: of the driver's share to the bare one.
        driver_trip_us, raw_trip_us: from writing a command to having read its answer, back to back [us].
        trip_p50_ratio, trip_p99_ratio: of the driver's to the bare one.
        trips_per_s: commands that the driver gets answered in a second, back to back.
        ticks_without_state: ticks to whose beginning no answer had come.
        trouble: frames that were lost, damaged, late or repeated: 0 unless something is wrong.
        warnings: what the loop could not have.
        conditions: the machine.
    """

    driver_us: Quantiles
    raw_us: Quantiles
    share_p50_ratio: float
    share_p99_ratio: float
    driver_trip_us: Quantiles
    raw_trip_us: Quantiles
    trip_p50_ratio: float
    trip_p99_ratio: float
    trips_per_s: float
    ticks_without_state: int
    trouble: int
    warnings: tuple[str, ...]
    conditions: Conditions


def measure(ticks: int, progress: Progress) -> RigReport:
    """Measure `ticks` ticks at 1 kHz, and as many round trips back to back.

    Raises:
        HapticdError: there is no C compiler, or the driver cannot be used.
    """
    with tempfile.TemporaryDirectory(prefix="hapticd-bench-") as place:
        peer = _compiled(Path(place))
        machine = MachineWatch()
        process = Spawned("the measuring process", _measure_line, peer, ticks)
        try:
            times = process.receive()
            while not isinstance(times, _Times):
                progress(times)
                times = process.receive()
        finally:
            process.kill()
    shares, bares = Quantiles.of(times.driver_us), Quantiles.of(times.raw_us)
    trips, bare_trips = Quantiles.of(times.driver_trip_us), Quantiles.of(times.raw_trip_us)
    return RigReport(
        driver_us=shares,
        raw_us=bares,
        share_p50_ratio=ratio(shares.p50, bares.p50),
        share_p99_ratio=ratio(shares.p99, bares.p99),
        driver_trip_us=trips,
        raw_trip_us=bare_trips,
        trip_p50_ratio=ratio(trips.p50, bare_trips.p50),
        trip_p99_ratio=ratio(trips.p99, bare_trips.p99),
        trips_per_s=ratio(1e6 * ticks, sum(times.driver_trip_us)),
        ticks_without_state=times.ticks_without_state,
        trouble=times.trouble,
        warnings=times.warnings,
        conditions=machine.end(),
    )


@dataclass(slots=True)
class _Times:
    """What the measuring process has found; see `RigReport`."""

    driver_us: list[float]
    raw_us: list[float]
    driver_trip_us: list[float]
    raw_trip_us: list[float]
    ticks_without_state: int
    trouble: int
    warnings: tuple[str, ...]


def _measure_line(connection: Connection, peer: Path, ticks: int) -> None:
    die_with_parent(os.getppid())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with contextlib.ExitStack() as stack:
            _, port = stack.enter_context(_line(peer, "rig"))
            bare, _ = stack.enter_context(_line(peer, "raw"))
            driver = _driver(port)
            stack.callback(driver.close)
            driver.open()
            driver.enable()
            problems, advice = become_realtime(LoopConfig())
            driver_us, raw_us = _paced(driver, bare, ticks, connection.send)
            without = driver.metrics[[metric.name for metric in driver.METRICS].index("ticks_without_state")]
            times = _Times(
                driver_us,
                raw_us,
                [_trip(driver) for _ in range(ticks)],
                [_bare_trip(bare) for _ in range(ticks)],
                round(without),
                round(sum(driver.metrics[at] for at, metric in enumerate(driver.METRICS) if metric.warns)),
                tuple(problems + advice),
            )
    except HapticdError as error:
        connection.send(HapticdError(str(error)))
        return
    connection.send(times)


def _paced(driver: Driver[Any], bare: int, ticks: int, progress: Progress) -> tuple[list[float], list[float]]:
    """The share of each tick that the driver takes, and the bare one [us]."""
    force_n = [0.1]

    def drive() -> None:
        driver.read()
        driver.write(force_n)

    def do_without() -> None:
        os.read(bare, 4096)
        os.write(bare, _COMMAND)

    spent: dict[Callable[[], None], list[float]] = {drive: [], do_without: []}
    order = [drive, do_without]
    deadline_ns = time.monotonic_ns() // _PERIOD_NS * _PERIOD_NS + 2 * _PERIOD_NS
    for tick in range(ticks + 1):
        sleep_until(deadline_ns)
        for work in order:
            started_ns = time.monotonic_ns()
            work()
            spent[work].append((time.monotonic_ns() - started_ns) * 1e-3)
        order.reverse()
        deadline_ns = max(deadline_ns + _PERIOD_NS, time.monotonic_ns() // _PERIOD_NS * _PERIOD_NS)
        if tick % 100 == 99:
            progress(100.0 / RATE_HZ)
    return spent[drive][1:], spent[do_without][1:]  # before the first there was nothing to read


def _trip(driver: Driver[Any]) -> float:
    """From writing a force to reading what the rig says to it [us]."""
    before = driver.read().sequence
    started_ns = time.monotonic_ns()
    driver.write([0.1])
    while driver.read().sequence == before:
        if time.monotonic_ns() - started_ns > _ANSWER_S * 1e9:
            raise HapticdError(f"{DRIVER}: the far end of the line did not answer within {_ANSWER_S:g} s")
    return (time.monotonic_ns() - started_ns) * 1e-3


def _bare_trip(bare: int) -> float:
    with contextlib.suppress(BlockingIOError):
        os.read(bare, 4096)
    started_ns = time.monotonic_ns()
    os.write(bare, _COMMAND)
    select.select([bare], [], [], _ANSWER_S)
    os.read(bare, 4096)
    return (time.monotonic_ns() - started_ns) * 1e-3


def _driver(port: str) -> Driver[Any]:
    kind = plugins.driver(DRIVER)
    options = kind.Options.model_validate({"port": port, "sign_checked": True, "answer_after_us": 0})
    return kind(options, 1.0 / RATE_HZ)


@contextlib.contextmanager
def _line(peer: Path, what: str) -> Iterator[tuple[int, str]]:
    """A line with a peer at its far end: descriptor and path of the near one."""
    far, near = pty.openpty()
    tty.setraw(near)
    attributes = termios.tcgetattr(near)
    attributes[6][termios.VMIN] = attributes[6][termios.VTIME] = 0
    termios.tcsetattr(near, termios.TCSANOW, attributes)
    process = subprocess.Popen([peer, what], stdin=far)
    try:
        yield near, os.ttyname(near)
    finally:
        process.kill()
        process.wait()
        os.close(far)
        os.close(near)


def _compiled(place: Path) -> Path:
    firmware = directory("drivers") / "firmware"
    core = [firmware / "host-rig" / "host_rig.c", *sorted((firmware / "protocol").glob("*.c"))]
    folders = [f"-I{firmware / 'host-rig'}", f"-I{firmware / 'protocol'}"]
    return compile_c(_SOURCE, place / "rig_peer", *core, *folders)
