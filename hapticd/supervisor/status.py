"""What the daemon says of itself: counts kept over its life, and the status that is made of them."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hapticd.config.loading import LoadedConfig
from hapticd.config.safety import SafetyConfig
from hapticd.config.walls import WallConfig
from hapticd.device import DeviceInfo
from hapticd.errors import ConfigError
from hapticd.loop.resume import ResumeState
from hapticd.supervisor.child import LoopProcess
from hapticd.supervisor.metrics import values_of
from hapticd.supervisor.recovery import Recovery
from hapticd.telemetry.clock import timestamp_s
from hapticd.telemetry.records import LateHistogram, Status
from hapticd.tick.event import EventCode, LoopEvent
from hapticd.tick.flags import Flag
from hapticd.tick.guard import limits
from hapticd.tick.record import TickRecord
from hapticd.version import __version__

_RATE_S = 0.5
"""Shortest time that a measured rate is taken over [s]."""


class StatusBuilder:
    """Counts since the daemon started.

    Args:
        instance: name of the daemon's instance.
        epoch_offset_ns: what to add to CLOCK_MONOTONIC to get nanoseconds since the epoch.
        file: the configuration, by its absolute path: the working directory may go while the daemon runs.

    Attributes:
        last: the newest tick, None before the first.
        flags: of the newest tick of the loop that there is, or what it goes on from; 0 where nothing is known.
        rate_hz: measured lately [Hz].
        origin_m: where it was tared to, by name [m].
        made: the status as it was made last.
    """

    def __init__(self, instance: str, epoch_offset_ns: int, file: Path) -> None:
        self.last: TickRecord | None = None
        self.flags = 0
        self._law = 0
        self.rate_hz = 0.0
        self.made = Status()
        self._instance = instance
        self._offset_ns = epoch_offset_ns
        self._file = file
        self._late = LateHistogram()
        self._busy_max_us = 0.0
        self._ticks = 0
        self._ticks_dropped = 0
        self._events_dropped = 0
        self._rate_from = (0.0, 0, 0)  # when [s], after how many ticks, and when the last of them was due [ns]
        self._fault: LoopEvent | None = None
        self._fault_s = 0.0
        self._faults = 0
        self._started_s = timestamp_s(time.monotonic_ns(), epoch_offset_ns)
        self.origin_m: dict[str, float] = {}
        self._ticking = False

    def add(self, records: Sequence[TickRecord]) -> None:
        """Count ticks."""
        for record in records:
            self._late.add(record.late_us)
            if record.busy_us > self._busy_max_us:
                self._busy_max_us = record.busy_us
        if records:
            if self.last is None:
                self._rate_from = (time.monotonic(), 1, records[0].deadline_ns)
            self._ticks += len(records)
            self.last = records[-1]
            self._ticking = True
            self.flags = self.last.flags
            self._law = self.last.law

    def expect(self, resume: ResumeState) -> None:
        """A loop that has not ticked yet goes on from there; where the one before was tared to is forgotten."""
        self.origin_m = {}
        self._ticking = False
        self.flags = Flag.LATCHED if resume.latched else 0
        self._law = resume.law

    def follow_clock(self, epoch_offset_ns: int) -> None:
        """Tell times by another offset from now on."""
        self._offset_ns = epoch_offset_ns

    def add_dropped(self, ticks: int, events: int) -> None:
        """Count ticks and events that were overwritten before they were fetched."""
        self._ticks_dropped += ticks
        self._events_dropped += events

    def add_event(self, event: LoopEvent) -> None:
        """Remember the last fault, and where positions count from."""
        if event.is_fault:
            self._fault = event
            self._faults += 1
            self._fault_s = timestamp_s(event.deadline_ns, self._offset_ns)
        elif event.code in (EventCode.TARED, EventCode.CALIBRATED):
            self.origin_m = {name: float(value) for name, value in event.fields.items()}

    def make(
        self,
        config: LoadedConfig,
        loop: LoopProcess,
        recovery: Recovery,
        fault_records: int,
        requests_refused: int,
        problems: Sequence[str],
        remote: Mapping[str, Any],
    ) -> Status:
        """The status as it is now.

        Args:
            config: what is in force.
            loop: the process of the loop.
            recovery: knows whether there is a device.
            fault_records: written so far.
            requests_refused: on the control socket so far.
            problems: what stands and should be known, each a line.
            remote: what the remote process counted, by the fields of the status.
        """
        self._measure_rate()
        settings = config.config
        info = loop.info
        if recovery.lost:
            self.expect(recovery.resume)
        flags = self.flags
        self.made = Status(
            version=__version__,
            instance=self._instance,
            started_timestamp=self._started_s,
            rate_hz=settings.loop.rate_hz,
            measured_rate_hz=self.rate_hz,
            ticks=self._ticks,
            overruns=loop.skipped,
            late_histogram=tuple(self._late.counts),
            late_sum_us=self._late.sum_us,
            late_max_us=self._late.max_us,
            busy_max_us=self._busy_max_us,
            ring_drops=self._ticks_dropped,
            event_drops=self._events_dropped,
            requests_refused=requests_refused,
            armed=bool(flags & Flag.ARMED),
            fallback=bool(flags & Flag.FALLBACK),
            releasing=bool(flags & Flag.RELEASING),
            latched=bool(flags & Flag.LATCHED),
            law=settings.controller.law,
            law_index=self._law,
            driver=settings.device.driver,
            device=info.model,
            serial=info.serial,
            simulated=info.simulated,
            calibrated=self._ticking and not flags & Flag.UNCALIBRATED,
            device_metrics=values_of(config.driver.METRICS, loop.shared.metrics),
            accuracy=_accuracy(loop.accuracy, loop.fitted_hash, config.hash),
            axes=info.axes,
            origin_m=tuple(self.origin_m.get(f"origin_{axis}_m", 0.0) for axis in info.axes),
            max_force_n=_largest_force_n(settings.safety, info),
            wall_axis=tuple(wall.axis for wall in settings.scene.walls),
            wall_position_m=tuple(wall.position_m for wall in settings.scene.walls),
            wall_stiffness_n_per_m=self._stiffness_n_per_m(settings.scene.walls),
            object_name=tuple(one.name for one in settings.scene.objects),
            object_shape=tuple(one.shape for one in settings.scene.objects),
            object_position_m=tuple(at_m for one in settings.scene.objects for at_m in one.position_m),
            object_stiffness_n_per_m=tuple(one.stiffness_n_per_m for one in settings.scene.objects),
            **remote,
            config_file=str(self._file),
            config_hash=config.hash,
            realtime=loop.realtime,
            warnings=(*((_missing(recovery),) if recovery.lost else ()), *problems, *loop.warnings, *info.notes),
            device_lost_timestamp=self._epoch_s(recovery.lost_s) if recovery.lost else 0.0,
            next_try_timestamp=self._epoch_s(recovery.next_try_s) if recovery.lost else 0.0,
            fault_code=self._fault.code if self._fault else 0,
            fault_text=self._fault.text if self._fault else "",
            fault_timestamp=self._fault_s,
            faults=self._faults,
            fault_records=fault_records,
        )
        return self.made

    def _stiffness_n_per_m(self, walls: Sequence[WallConfig]) -> tuple[float, ...]:
        """Stiffness of each wall as the newest tick had it; before the first one, as the file has it [N/m]."""
        if self._ticking and self.last is not None and len(self.last.walls) == len(walls):
            return tuple(wall.stiffness_n_per_m for wall in self.last.walls)
        return tuple(wall.stiffness_n_per_m for wall in walls)

    def _measure_rate(self) -> None:
        """By when ticks were due: when they are fetched depends on how busy this process is."""
        now_s = time.monotonic()
        since_s, since_ticks, since_ns = self._rate_from
        if self.last is None or now_s - since_s < _RATE_S:
            return
        span_ns = self.last.deadline_ns - since_ns
        self.rate_hz = (self._ticks - since_ticks) / (span_ns * 1e-9) if span_ns > 0 else 0.0
        self._rate_from = (now_s, self._ticks, self.last.deadline_ns)

    def _epoch_s(self, monotonic_s: float) -> float:
        return timestamp_s(round(monotonic_s * 1e9), self._offset_ns)


def _largest_force_n(safety: SafetyConfig, info: DeviceInfo) -> float:
    """Largest magnitude that the guard lets through [N]; 0 when there is no limit."""
    try:
        max_force_n, max_axis_n, _ = limits(safety, info)
    except ConfigError:  # taken over while the device was gone; it is refused when it is back
        max_force_n = max_axis_n = info.max_force_n
    limit_n = min(max_force_n, math.sqrt(len(info.axes)) * max_axis_n)
    return limit_n if limit_n < math.inf else 0.0


def _accuracy(reason: str, fitted_hash: str, hash_now: str) -> str:
    if reason and fitted_hash != hash_now:
        return f"{reason}; chosen for configuration {fitted_hash}, a restart chooses again"
    return reason


def _missing(recovery: Recovery) -> str:
    in_s = recovery.next_try_s - time.monotonic()
    return f"no device: {recovery.why}; {f'next try in {in_s:.0f} s' if in_s > 0.0 else 'trying now'}"
