"""What viewers cost: two recorders, a dashboard with a page, and subscribers, beside the same daemon without them.

    hapticd bench viewers --duration 600

One daemon, in turns alone and looked at by everybody, so that the machine is the same for both. The benchmark itself is
a subscriber to `hapticd/timing` all the time: the lateness that it reads is the loop's.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import select
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hapticd.client import Client, Timing
from hapticd.config.loading import load
from hapticd.errors import ConfigError, HapticdError
from hapticd.measure import Bar, Progress, Quantiles, ratio
from hapticd_bench.audience import READY, audience, free_port
from hapticd_bench.running import RunningDaemon, running_daemon

SUBSCRIBERS = 14
RECORDERS = 2
ROUNDS = 2
"""Times that it is looked at and left alone."""

START_S = 60.0
MOST_LATER = 1.25
"""How many times as late as alone a tick may begin, one in a hundred of them."""


@dataclass(frozen=True, slots=True)
class Share:
    """Processor time of one program.

    Attributes:
        program: which.
        alone, watched: part of a processor that it kept busy without and with viewers; 0 where it did not run.
    """

    program: str
    alone: float
    watched: float


@dataclass(frozen=True, slots=True)
class Viewers:
    """All of it.

    Attributes:
        seconds: of each half [s].
        alone, watched: how late ticks began [us].
        skipped_alone, skipped_watched: deadlines without a tick.
        ticks: that the readers got, by reader, while all of them looked.
        missing: that they did not get.
        shares: processor time, by program.
        bars: the verdicts.
    """

    seconds: float
    alone: Quantiles
    watched: Quantiles
    skipped_alone: int
    skipped_watched: int
    ticks: dict[str, int]
    missing: dict[str, int]
    shares: tuple[Share, ...]
    bars: tuple[Bar, ...]


@dataclass
class _Half:
    """What was seen alone, or watched."""

    seconds: float = 0.0
    late_us: list[float] = field(default_factory=list)
    lost: int = 0
    skipped: int = 0
    busy_s: dict[str, float] = field(default_factory=dict)
    ticks: dict[str, int] = field(default_factory=dict)
    missing: dict[str, int] = field(default_factory=dict)


def measure(config: Path, duration_s: float, progress: Progress) -> Viewers:
    """Run a daemon, alone and looked at in turns.

    Args:
        config: its configuration.
        duration_s: of everything that is measured [s].
        progress: told what is done.

    Raises:
        ConfigError: not every tick would be published.
        HapticdError: the daemon or a viewer could not start, or ended before its time.
    """
    loaded = load(config).config
    if loaded.telemetry.every_ticks != 1:
        raise ConfigError(f"{config}: telemetry.every_ticks = {loaded.telemetry.every_ticks}: set it to 1")
    alone, watched = _Half(), _Half()
    turn_s = duration_s / (2 * ROUNDS)
    with (
        tempfile.TemporaryDirectory(prefix="hapticd-viewers-") as folder,
        running_daemon(config, Path(folder)) as daemon,
        Client(daemon.endpoint, topics=(Timing,), receive_high_water=0) as client,
    ):
        observer = _Observer(client, daemon, loaded.loop.period_ns, progress)
        observer.wait(lambda: client.latest_status is not None)
        own = {"the daemon's supervisor": daemon.process.pid, "the daemon's loop": daemon.control_pid()}
        for turn in range(ROUNDS):
            observer.watch(alone, own, turn_s)
            with _looking(daemon, observer, Path(folder), turn, watched) as viewers:
                observer.watch(watched, {**own, **viewers}, turn_s)
    return _judged(alone, watched, observer.lost)


class _Observer:
    """Reads the timing of every tick, with viewers and without."""

    def __init__(self, client: Client, daemon: RunningDaemon, period_ns: int, progress: Progress) -> None:
        self.lost = 0
        self._client = client
        self._daemon = daemon
        self._period_ns = period_ns
        self._progress = progress
        self._last: Timing | None = None

    def wait(self, until: Callable[[], bool]) -> None:
        """Read on until something is so."""
        end_s = time.monotonic() + START_S
        while not until():
            self._read(None)
            if time.monotonic() > end_s:
                raise self._daemon.failed(f"a viewer did not start within {START_S:g} s")

    def watch(self, half: _Half, programs: dict[str, int], seconds: float) -> None:
        """Note what comes for some time, and how busy the programs are."""
        while self._read(None, 0.0):  # what came while viewers started or ended belongs to no half
            pass
        began_s = told_s = time.monotonic()
        before = {name: _busy_s(pid) for name, pid in programs.items()}
        while (now_s := time.monotonic()) < began_s + seconds:
            self._read(half)
            self._progress(now_s - told_s)
            told_s = now_s
        half.seconds += time.monotonic() - began_s
        for name, pid in programs.items():
            half.busy_s[name] = half.busy_s.get(name, 0.0) + _busy_s(pid) - before[name]

    def _read(self, half: _Half | None, timeout_s: float = 0.5) -> bool:
        """Take one message in, for a half or only for the count of what is lost; whether there was one."""
        records = self._client.receive(timeout_s)
        if self._daemon.process.poll() is not None:
            raise self._daemon.failed("the daemon ended")
        for record in records:
            if isinstance(record, Timing):
                if self._last is not None:
                    ran = record.seq - self._last.seq
                    self.lost += ran - 1
                    skipped = round((record.deadline_ns - self._last.deadline_ns) / self._period_ns) - ran
                    if half is not None:
                        half.skipped += skipped
                self._last = record
                if half is not None:
                    half.late_us.append(record.late_us)
        return bool(records)


@contextmanager
def _looking(
    daemon: RunningDaemon, observer: _Observer, folder: Path, turn: int, half: _Half
) -> Iterator[dict[str, int]]:
    """Everybody looks for as long as the block lasts; then what they got is counted."""
    spawn = multiprocessing.get_context("spawn")
    port = free_port()
    files = [folder / f"{turn}-{number}.mcap" for number in range(RECORDERS)]
    with ExitStack() as stack:
        page = stack.enter_context(daemon.started("dashboard", "--port", str(port)))
        _until_it_says(page, "watch:", observer)
        recorders = [stack.enter_context(daemon.started("record", "--output", str(file), "--json")) for file in files]
        ours, theirs = spawn.Pipe()
        readers = spawn.Process(target=audience, args=(daemon.endpoint, SUBSCRIBERS, port, theirs), daemon=True)
        readers.start()
        observer.wait(lambda: all(file.exists() and file.stat().st_size > 0 for file in files))
        observer.wait(ours.poll)
        if ours.recv() != READY:
            raise HapticdError("the subscribers did not start")
        yield {
            **{f"recorder {number + 1}": one.pid for number, one in enumerate(recorders)},
            "dashboard": page.pid,
            f"{SUBSCRIBERS} subscribers and a page": readers.pid or 0,
        }
        ours.send("stop")
        counts: dict[str, dict[str, int]] = ours.recv()
        readers.join(5.0)
        readers.kill()
        for number, recorder in enumerate(recorders):
            recorder.send_signal(signal.SIGINT)
            counts[f"recorder {number + 1}"] = json.loads(recorder.communicate(timeout=START_S)[0])
    for name, found in counts.items():
        half.ticks[name] = half.ticks.get(name, 0) + found["ticks"]
        half.missing[name] = half.missing.get(name, 0) + found["missing"]


def _until_it_says(process: subprocess.Popen[str], line: str, observer: _Observer) -> None:
    """Return once a program has printed a line that begins so."""
    assert process.stdout is not None
    output = process.stdout.fileno()
    said = b""

    def has_said() -> bool:
        nonlocal said
        if process.poll() is not None:
            raise HapticdError(f"a viewer ended: {process.communicate()[1]}")
        while select.select([output], [], [], 0.0)[0]:
            piece = os.read(output, 4096)
            said += piece
            if not piece:
                break
        return any(one.startswith(line.encode()) for one in said.splitlines())

    observer.wait(has_said)


def _busy_s(pid: int) -> float:
    """Processor time that a process has used [s].

    Raises:
        HapticdError: it has ended.
    """
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError as error:
        raise HapticdError(f"process {pid} is gone: {error.strerror}") from error
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _judged(alone: _Half, watched: _Half, lost: int) -> Viewers:
    late, later = Quantiles.of(alone.late_us), Quantiles.of(watched.late_us)
    missing = {**watched.missing, "this benchmark": lost}
    programs = {**alone.busy_s, **watched.busy_s}
    shares = tuple(
        Share(
            name, alone.busy_s.get(name, 0.0) / alone.seconds, watched.busy_s.get(name, 0.0) / watched.seconds
        )
        for name in programs
    )  # fmt: skip
    bars = (
        _bar("ticks that any reader did not get", sum(missing.values()), 0.0),
        _bar("p99 of the lateness, times that without viewers", ratio(later.p99, late.p99), MOST_LATER),
    )
    ticks: dict[str, Any] = {**watched.ticks, "this benchmark": late.count + later.count}
    return Viewers(alone.seconds, late, later, alone.skipped, watched.skipped, ticks, missing, shares, bars)


def _bar(name: str, measured: float, limit: float) -> Bar:
    return Bar(name, measured, limit, "PASS" if measured <= limit else "FAIL")
