"""How long a daemon takes from its command line to its first tick, and what of it; next to a bare interpreter.

Looked at from outside: processes that appear, the deadline of the first tick, the processor time of each.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from hapticd.client.connection import Client
from hapticd.measure import Progress, Quantiles
from hapticd.paths import directory
from hapticd.telemetry.records import Timing
from hapticd_bench.running import RunningDaemon, running_daemon

START_S = 2.0
"""About what one start takes, its end and its bare interpreters [s]."""

PATIENCE_S = 60.0

HELPER = "helper"
LOOP = "loop"
_MODULES = {HELPER: b"hapticd.supervisor.force_release", LOOP: b"hapticd.loop.process"}
_IMPORTED = {
    "supervisor": "hapticd.cli.app, hapticd.cli.run, hapticd.supervisor.daemon",
    HELPER: "hapticd.supervisor.force_release",
    LOOP: "hapticd.loop.process",
}
_LINE = re.compile(r"import time:\s+(\d+) \|\s+\d+ \| +(\S+)")
_BARE = (sys.executable, "-P", "-c", "pass")
_LARGEST = 5


@dataclass(frozen=True, slots=True)
class Start:
    """One start, times since the command line [s].

    Attributes:
        bare_s: what an interpreter takes that does nothing, before and after it.
        helper_s: until the helper's process was there: command line, imports and configuration are done.
        loop_s: until the loop's process was there.
        tick_s: until the deadline of the first tick.
        processor_s: time on a processor until soon after that, by process: supervisor, helper, loop.
    """

    bare_s: float
    helper_s: float
    loop_s: float
    tick_s: float
    processor_s: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Starts:
    """What was seen, in bare interpreters' starts.

    Attributes:
        bare_ms: one of those [ms].
        helper, loop, tick: until those were there.
        processor: time on a processor, by process.
        imports: what imports take of that, by process: all, and the packages that take most.
    """

    bare_ms: Quantiles
    helper: Quantiles
    loop: Quantiles
    tick: Quantiles
    processor: Mapping[str, Quantiles]
    imports: Mapping[str, Mapping[str, float]]


def measure(starts: int, progress: Progress) -> Starts:
    """Start a daemon `starts` times.

    Args:
        starts: how many.
        progress: told what is done.

    Raises:
        HapticdError: one did not start.
    """
    seen = []
    for _ in range(starts):
        seen.append(_start())
        progress(START_S)
    bare_s = median(start.bare_s for start in seen)
    return Starts(
        bare_ms=Quantiles.of(1e3 * start.bare_s for start in seen),
        helper=Quantiles.of(start.helper_s / start.bare_s for start in seen),
        loop=Quantiles.of(start.loop_s / start.bare_s for start in seen),
        tick=Quantiles.of(start.tick_s / start.bare_s for start in seen),
        processor={name: Quantiles.of(start.processor_s[name] / start.bare_s for start in seen) for name in _IMPORTED},
        imports={name: _imports(modules, bare_s) for name, modules in _IMPORTED.items()},
    )


def _start() -> Start:
    before_s = _bare_s()
    with tempfile.TemporaryDirectory(prefix="hapticd-start-") as place:
        begun_s = time.monotonic()
        with running_daemon(directory("config") / "hapticd.toml", Path(place)) as daemon:
            there = _children(daemon)
            tick_s = _first_tick_s(daemon)
            pids = {"supervisor": daemon.process.pid} | {name: pid for name, (pid, _) in there.items()}
            processor_s = {name: _on_processor_s(pid) for name, pid in pids.items()}
    return Start(
        bare_s=(before_s + _bare_s()) / 2.0,
        helper_s=there[HELPER][1] - begun_s,
        loop_s=there[LOOP][1] - begun_s,
        tick_s=tick_s - begun_s,
        processor_s=processor_s,
    )


def _bare_s() -> float:
    """What an interpreter takes that does nothing, the best of a few [s]."""
    found = []
    for _ in range(3):
        begun_s = time.monotonic()
        subprocess.run(_BARE, check=True)
        found.append(time.monotonic() - begun_s)
    return min(found)


def _children(daemon: RunningDaemon) -> dict[str, tuple[int, float]]:
    """Process of the helper and of the loop, and when each was there [s]."""
    listed = Path(f"/proc/{daemon.process.pid}/task/{daemon.process.pid}/children")
    found: dict[str, tuple[int, float]] = {}
    end_s = time.monotonic() + PATIENCE_S
    while len(found) < len(_MODULES):
        if daemon.process.poll() is not None or time.monotonic() > end_s:
            raise daemon.failed("it did not start")
        for pid in listed.read_text().split():
            command = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
            for name, module in _MODULES.items():
                if name not in found and module in command:
                    found[name] = int(pid), time.monotonic()
        time.sleep(0.0005)
    return found


def _first_tick_s(daemon: RunningDaemon) -> float:
    """When the first tick was due, counted back from the earliest that is heard of [s]."""
    end_s = time.monotonic() + PATIENCE_S
    with Client(daemon.endpoint, topics=(Timing,)) as client:
        while time.monotonic() < end_s and daemon.process.poll() is None:
            for record in client.receive(0.1):
                if isinstance(record, Timing):
                    return record.deadline_ns * 1e-9 - record.seq * 1e-3
    raise daemon.failed("no tick came")


def _on_processor_s(pid: int) -> float:
    """Time of every thread of a process on a processor so far [s]."""
    return sum(int(task.read_text().split()[0]) for task in Path(f"/proc/{pid}/task").glob("*/schedstat")) * 1e-9


def _imports(modules: str, bare_s: float) -> dict[str, float]:
    """What importing takes, in bare starts: all of it, then the packages that take most, each without the others."""
    said = subprocess.run(
        [sys.executable, "-P", "-X", "importtime", "-c", f"import {modules}"],
        capture_output=True,
        text=True,
        check=True,
    ).stderr
    own_us: dict[str, float] = {}
    for found in _LINE.finditer(said):
        package = found[2].partition(".")[0]
        package = "standard library" if package in sys.stdlib_module_names else package.removesuffix("_core")
        own_us[package] = own_us.get(package, 0.0) + float(found[1])
    largest = sorted(own_us, key=lambda package: -own_us[package])[:_LARGEST]
    return {"all": sum(own_us.values()) * 1e-6 / bare_s} | {name: own_us[name] * 1e-6 / bare_s for name in largest}
