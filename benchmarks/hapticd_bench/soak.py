"""A daemon left running, looked at from outside: memory, file handles, period, ticks.

    hapticd bench soak --duration 3600

One subscriber reads `hapticd/timing`; memory and handles of both processes come from /proc. Memory is what a process
has for itself (RssAnon): the ring that both share is touched once, in the first seconds. Before the first look the
supervisor is stopped for 5 s: what it fetches afterwards is the largest batch it will ever handle, and takes some
megabytes that are not given back, which otherwise come whenever the computer stutters and look like a leak.
"""

from __future__ import annotations

import os
import signal
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from hapticd.client import Client, Event, Timing
from hapticd.config.loading import load
from hapticd.errors import ConfigError, HapticdError
from hapticd.measure import Bar, Progress, Quantiles
from hapticd_bench.running import RunningDaemon, running_daemon

SILENCE_S = 30.0
"""How long nothing may come [s]."""

STOPPED_S = 5.0
MOST_GROWTH_KB = 512.0
"""Memory that a process may gain after its first look [kB]; a leak of one float a tick gains 86 MB in an hour."""


@dataclass(frozen=True, slots=True)
class Process:
    """What a process of the daemon held at one time.

    Attributes:
        memory_kb: memory of its own [kB].
        handles: open file descriptors.
    """

    memory_kb: int
    handles: int

    @classmethod
    def of(cls, pid: int) -> Process:
        """Of a process that runs.

        Raises:
            HapticdError: it does not.
        """
        try:
            status = Path(f"/proc/{pid}/status").read_text()
            handles = len(os.listdir(f"/proc/{pid}/fd"))  # noqa: PTH208 - a Path for each is what is not wanted here
        except OSError as error:
            raise HapticdError(f"the daemon's process {pid} is gone: {error.strerror}") from error
        return cls(next(int(line.split()[1]) for line in status.splitlines() if line.startswith("RssAnon:")), handles)


@dataclass(frozen=True, slots=True)
class Look:
    """One interval of the soak.

    Attributes:
        end_s: when it ended, from the first tick [s].
        ticks: that came.
        lost: that ran and did not come.
        skipped: deadlines without a tick.
        off_beat: ticks whose deadline is no whole multiple of the period.
        late_us: how late they began [us].
        supervisor, control: the two processes at its end.
    """

    end_s: float
    ticks: int
    lost: int
    skipped: int
    off_beat: int
    late_us: Quantiles
    supervisor: Process
    control: Process


@dataclass(frozen=True, slots=True)
class Soak:
    """All of it.

    Attributes:
        rate_hz: of the configuration.
        looks: one an interval.
        dropped: ticks that the supervisor was too slow to fetch.
        faults: what the daemon told, a line each.
        bars: the verdicts.
    """

    rate_hz: float
    looks: tuple[Look, ...]
    dropped: int
    faults: tuple[str, ...]
    bars: tuple[Bar, ...]


@dataclass
class _Interval:
    ticks: int = 0
    lost: int = 0
    skipped: int = 0
    off_beat: int = 0
    late_us: list[float] = field(default_factory=list)


def measure(config: Path, duration_s: float, interval_s: float, progress: Progress) -> Soak:
    """Run a daemon for a while.

    Args:
        config: its configuration.
        duration_s: how long, from the first tick [s].
        interval_s: time between two looks [s].
        progress: told what is done.

    Raises:
        ConfigError: not every tick would be published.
        HapticdError: it could not start, or ended before its time.
    """
    loaded = load(config).config
    loop, every_ticks = loaded.loop, loaded.telemetry.every_ticks
    if every_ticks != 1:
        raise ConfigError(f"{config}: telemetry.every_ticks = {every_ticks}: a soak counts every tick, so set it to 1")
    with (
        tempfile.TemporaryDirectory(prefix="hapticd-soak-") as directory,
        running_daemon(config, Path(directory)) as daemon,
        Client(daemon.endpoint, topics=(Timing, Event), receive_high_water=0) as client,
    ):
        faults: list[str] = []
        looks = tuple(_looks(client, daemon, loop.period_ns, duration_s, interval_s, faults, progress))
        dropped = client.latest_status.ring_drops if client.latest_status else 0
    return Soak(loop.rate_hz, looks, dropped, tuple(faults), tuple(_bars(looks, dropped, len(faults))))


def _looks(
    client: Client,
    daemon: RunningDaemon,
    period_ns: int,
    duration_s: float,
    interval_s: float,
    faults: list[str],
    progress: Progress,
) -> Iterator[Look]:
    last: Timing | None = None
    first_ns = 0
    look_ns = 0
    interval = _Interval()
    told_s = time.monotonic()
    silent_s = told_s + SILENCE_S
    while True:
        records = client.receive(1.0)
        now_s = time.monotonic()
        if daemon.process.poll() is not None or (not records and now_s > silent_s):
            raise daemon.failed("the daemon does not tick")
        if records:
            silent_s = now_s + SILENCE_S
        progress(now_s - told_s)
        told_s = now_s
        for record in records:
            if isinstance(record, Event) and record.code in range(200, 300):
                faults.append(record.text)
            if not isinstance(record, Timing):
                continue
            if last is None:
                daemon.process.send_signal(signal.SIGSTOP)
                time.sleep(STOPPED_S)
                daemon.process.send_signal(signal.SIGCONT)
                first_ns = record.deadline_ns + int(STOPPED_S * 1e9)
                look_ns = first_ns + int(interval_s * 1e9)
            else:
                ran = record.seq - last.seq
                interval.lost += ran - 1
                interval.skipped += round((record.deadline_ns - last.deadline_ns) / period_ns) - ran
            last = record
            interval.ticks += 1
            interval.off_beat += record.deadline_ns % period_ns != 0
            interval.late_us.append(record.late_us)
            if record.deadline_ns >= look_ns:
                end_s = (record.deadline_ns - first_ns) * 1e-9
                yield _look(end_s, interval, daemon)
                interval = _Interval()
                look_ns += int(interval_s * 1e9)
                if end_s >= duration_s:
                    return


def _look(end_s: float, interval: _Interval, daemon: RunningDaemon) -> Look:
    return Look(
        end_s=end_s,
        ticks=interval.ticks,
        lost=interval.lost,
        skipped=interval.skipped,
        off_beat=interval.off_beat,
        late_us=Quantiles.of(interval.late_us),
        supervisor=Process.of(daemon.process.pid),
        control=Process.of(daemon.control_pid()),
    )


def _bars(looks: tuple[Look, ...], dropped: int, faults: int) -> Iterator[Bar]:
    first = looks[0]
    for name in ("supervisor", "control"):
        before: Process = getattr(first, name)
        grown_kb = max(getattr(look, name).memory_kb for look in looks) - before.memory_kb
        yield _bar(f"{name}: memory gained [kB]", grown_kb, MOST_GROWTH_KB)
        more = max(getattr(look, name).handles for look in looks) - before.handles
        yield _bar(f"{name}: file handles gained", more, 0.0)
    yield _bar("ticks that ran and did not come", sum(look.lost for look in looks), 0.0)
    yield _bar("ticks not fetched from the ring", dropped, 0.0)
    yield _bar("deadlines off the beat", sum(look.off_beat for look in looks), 0.0)
    yield _bar("faults", faults, 0.0)


def _bar(name: str, measured: float, limit: float) -> Bar:
    return Bar(name, measured, limit, "PASS" if measured <= limit else "FAIL")
