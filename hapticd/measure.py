"""What parts of the service cost on this machine, next to a reference measured in the same run.

Nothing here is a test: a benchmark reports, and says when the machine was too restless to tell.
"""

from __future__ import annotations

import contextlib
import math
import os
import platform
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

Verdict = Literal["PASS", "FAIL", "INCONCLUSIVE"]

Progress = Callable[[float], None]
"""Told how many more seconds of measuring are done."""


@dataclass(frozen=True, slots=True)
class Quantiles:
    """How a quantity is distributed: all of these come from values that were really measured (nearest rank).

    Attributes:
        count: number of values.
        p50, p99, p999, max: in the unit of the values.
    """

    count: int
    p50: float
    p99: float
    p999: float
    max: float

    @classmethod
    def of(cls, values: Iterable[float]) -> Quantiles:
        """The quantiles of some values, zeros for none."""
        ordered = sorted(values)
        if not ordered:
            return cls(0, 0.0, 0.0, 0.0, 0.0)
        return cls(len(ordered), quantile(ordered, 0.5), quantile(ordered, 0.99), quantile(ordered, 0.999), ordered[-1])


@dataclass(frozen=True, slots=True)
class Bar:
    """A figure held against what is asked of it.

    Attributes:
        name: what is judged.
        measured: the figure.
        limit: the largest that passes.
        verdict: INCONCLUSIVE when the machine, and not what is judged, decided the figure.
        note: why, where that needs saying.
    """

    name: str
    measured: float
    limit: float
    verdict: Verdict
    note: str = ""


@dataclass(frozen=True, slots=True)
class Conditions:
    """The machine while it was measured.

    Attributes:
        machine: processor architecture and number of processors that this process may use.
        kernel: release and build of the kernel.
        python: version of the interpreter.
        load_before, load_after: runnable tasks, mean of a minute.
        others: processors that other programs kept busy, 0.5 is one of them half the time.
        stolen: processors that the host of a virtual machine gave to others.
        rivals: other programs that were seen under real-time scheduling; a loop has to wait for them.
        seconds: how long the measurement took [s].
    """

    machine: str
    kernel: str
    python: str
    load_before: float
    load_after: float
    others: float
    stolen: float
    rivals: tuple[str, ...]
    seconds: float


def quantile(ordered: Sequence[float], share: float) -> float:
    """The smallest of some sorted values that at least this share of them does not exceed."""
    return ordered[max(0, math.ceil(share * len(ordered) - 1e-9) - 1)]


def ratio(value: float, reference: float) -> float:
    """How many times the reference; 0 where there is no reference."""
    return value / reference if reference else 0.0


class MachineWatch:
    """Watches the machine from now on."""

    def __init__(self) -> None:
        self._rivals = rivals()
        self._started_s = time.monotonic()
        self._load_before = os.getloadavg()[0]
        self._busy_s, self._stolen_s = _processor_time_s()
        self._own_s = sum(os.times()[:4])

    def look(self) -> None:
        """See whether a rival has come."""
        self._rivals |= rivals()

    def end(self) -> Conditions:
        """What the machine was like, once every child has been waited for."""
        self.look()
        seconds = time.monotonic() - self._started_s
        busy_s, stolen_s = _processor_time_s()
        own_s = sum(os.times()[:4]) - self._own_s
        return Conditions(
            machine=f"{platform.machine()}, {len(os.sched_getaffinity(0))} processors",
            kernel=f"{platform.release()} {platform.version()}",
            python=platform.python_version(),
            load_before=self._load_before,
            load_after=os.getloadavg()[0],
            others=max(0.0, busy_s - self._busy_s - own_s) / seconds,
            stolen=(stolen_s - self._stolen_s) / seconds,
            rivals=tuple(sorted(self._rivals)),
            seconds=seconds,
        )


def rivals() -> set[str]:
    """Programs under real-time scheduling, each as its process and name.

    Neither the kernel's own threads nor this process and what it has started.
    """
    parents: dict[int, int] = {}
    commands: dict[int, str] = {}
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has just ended
            parents[int(process.name)] = int((process / "stat").read_text().rpartition(")")[2].split()[1])
            command = (process / "cmdline").read_bytes().decode(errors="replace")
            command = "".join(each if each.isprintable() else " " for each in command).strip()
            if command and any(_is_realtime(int(thread.name)) for thread in (process / "task").iterdir()):
                commands[int(process.name)] = command[:60]
    return {f"{process} {command}" for process, command in commands.items() if not _is_ours(process, parents)}


def _is_realtime(thread: int) -> bool:
    with contextlib.suppress(OSError):
        return os.sched_getscheduler(thread) & ~os.SCHED_RESET_ON_FORK in (os.SCHED_FIFO, os.SCHED_RR)
    return False


def _is_ours(process: int, parents: Mapping[int, int]) -> bool:
    while process > 1:
        if process == os.getpid():
            return True
        process = parents.get(process, 0)
    return False


def doubtful(bars: Iterable[Bar], conditions: Conditions) -> list[Bar]:
    """The same bars; all of them inconclusive when other real-time programs were in the way."""
    if not conditions.rivals:
        return list(bars)
    note = f"beside another real-time program: {conditions.rivals[0]}"
    return [replace(bar, verdict="INCONCLUSIVE", note=note) for bar in bars]


def _processor_time_s() -> tuple[float, float]:
    """Time that all processors have been busy, and time stolen from them, since the machine started [s]."""
    fields = Path("/proc/stat").read_text().splitlines()[0].split()[1:]
    user, nice, system, _idle, _wait, interrupts, soft, stolen = (int(field) for field in fields[:8])
    hertz = os.sysconf("SC_CLK_TCK")
    return (user + nice + system + interrupts + soft) / hertz, stolen / hertz
