"""The whole examination: every check, in the order in which they are read."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from hapticd import discovery
from hapticd.doctor import configuration, driver, endpoints, kernel, memory, processor, rules, scheduling, usb
from hapticd.doctor.attempt import attempt
from hapticd.doctor.configuration import Wanted
from hapticd.doctor.finding import Check, Finding, Mark, examine, ok
from hapticd.doctor.latency import Latency, judge, judge_tick, measure
from hapticd.doctor.tree import ROOT
from hapticd.keys.store import KeyDirectory, key_directory
from hapticd.paths import fault_directory, instance_directories, runtime_directory

SCHEMA = 1
"""Version of what `--json` prints."""


@dataclass
class Examination:
    """One examination of this computer.

    Args:
        wanted: what the daemon would be asked for.
        instance: name of the daemon.
        root: the file system, for /proc and /sys.

    Attributes:
        latency: what was measured, None while nothing was.
    """

    wanted: Wanted
    instance: str
    root: Path = ROOT
    latency: Latency | None = None

    def checks(self) -> list[Check]:
        """Every check except the measurement."""
        root, loop, name = self.root, self.wanted.loop, self.wanted.driver
        options = self.wanted.loaded.options if self.wanted.loaded else None
        directory = runtime_directory(self.instance)
        tried = functools.cache(lambda: attempt(loop.priority))
        daemon = functools.cache(self._daemon)
        # The daemon's device would only be shown as held, and looking for it might disturb the loop.
        looked = functools.cache(lambda: discovery.look({name: options}, find=not _or_none(daemon))[0])
        faults = fault_directory(self.instance)
        return [
            Check("kernel.preemption", "kernel", lambda: kernel.preemption(root)),
            Check("kernel.timers", "timers", lambda: kernel.timers(root)),
            Check("processor.architecture", "processor", processor.architecture),
            Check("processor.count", "processors", lambda: processor.count(loop, root)),
            Check("processor.governor", "governor", lambda: processor.governor(root)),
            Check("processor.idle", "deep sleep", lambda: processor.idle(root)),
            Check("processor.virtual", "machine", lambda: processor.virtual(root)),
            Check("scheduling.priority", "scheduling", lambda: scheduling.priority(loop, tried().scheduling, root)),
            Check("scheduling.throttling", "throttling", lambda: scheduling.throttling(root)),
            Check("scheduling.quota", "quota", lambda: scheduling.quota(root, _or_none(daemon))),
            Check("memory.locking", "memory", lambda: memory.locking(loop, tried().memory, root)),
            Check("memory.swap", "swap", lambda: memory.swap(tried().memory, root)),
            Check("driver.needs", "driver", lambda: driver.needs(looked())),
            Check("driver.devices", "devices", lambda: driver.devices(looked(), _or_none(daemon))),
            Check(
                "usb.controller", "controller", lambda: usb.controller([one.where for one in looked().devices], root)
            ),
            Check("rules.installed", "udev rule", lambda: rules.installed(name, root)),
            Check("configuration.usable", "config", lambda: configuration.usable(self.wanted)),
            Check("endpoints.instance", "instance", lambda: endpoints.instance(self.instance, self._daemons())),
            Check("endpoints.runtime", "directory", lambda: endpoints.runtime(directory)),
            Check("endpoints.tcp", "endpoint", lambda: endpoints.tcp(self.wanted.tcp, _or_none(daemon))),
            Check("endpoints.keys", "keys", lambda: endpoints.keys(self.wanted.tcp, KeyDirectory(key_directory()))),
            Check("endpoints.streams", "lab streams", lambda: endpoints.streams(root)),
            Check("endpoints.state", "disk", lambda: endpoints.state(faults)),
        ]

    def findings(self) -> Iterator[Finding]:
        """What every check but the measurement has found, one after the other."""
        for check in self.checks():
            yield from examine(check)

    def measured(self, seconds: float, progress: Callable[[float], None]) -> list[Finding]:
        """Measure how late a loop wakes, and how long its tick computes.

        Args:
            seconds: how long [s].
            progress: called with the share that is done.
        """

        def look() -> Finding:
            if self._daemon():
                return ok("not measured: it would delay the running daemon; see hapticd watch")
            self.latency = measure(self.wanted.loop, self.wanted.loaded, seconds, progress, self.root)
            return judge(self.latency)

        found = examine(Check("latency.loop", "latency", look))
        if self.latency is None:
            return found
        latency = self.latency
        return found + examine(Check("latency.tick", "tick", lambda: judge_tick(latency)))

    def _daemon(self) -> int:
        """Process of the daemon that a command would reach, the system's or this user's own; 0 when there is none."""
        return next(iter(self._daemons().values()), 0)

    def _daemons(self) -> dict[Path, int]:
        """Processes that run the instance, by their directories."""
        places = instance_directories(self.instance)
        found = {directory: endpoints.running(directory, self.root) for directory in places}
        return {directory: process for directory, process in found.items() if process}


def verdict(findings: list[Finding]) -> Mark:
    """The worst of what is known."""
    marks = {finding.mark for finding in findings}
    return "problem" if "problem" in marks else "advice" if "advice" in marks else "ok"


def _or_none(daemon: Callable[[], int]) -> int:
    """Process of the daemon; 0 also when this user may not look, which is a finding of its own."""
    try:
        return daemon()
    except OSError:
        return 0
