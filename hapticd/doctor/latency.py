"""How late a loop wakes on this computer and how long its tick computes, and whether that is good enough at its rate.

Both are delay, and delay takes stiffness: a wall of K at period T is passive on a device with damping b while
b > K (T/2 + delay) (Colgate), so a loop that is T/10 late has to do with a sixth less stiffness, one at T/2 with half.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hapticd.config.loading import LoadedConfig
from hapticd.config.models import LoopConfig
from hapticd.doctor.finding import Finding, advice, ok, own_command, problem, unknown
from hapticd.doctor.processor import is_virtual
from hapticd.doctor.tree import ROOT
from hapticd.errors import HapticdError
from hapticd.measure import MachineWatch, Quantiles
from hapticd.telemetry.records import LateHistogram

GOOD_DELAY = 0.1
"""Share of the period that p99 of lateness, and that of the tick, may take in a good loop."""
BAD_DELAY = 0.5
"""Share of the period from which on the loop is a bad one."""
GOOD_SKIPPED = 0.001
"""Share of deadlines that a good loop may skip."""
BAD_SKIPPED = 0.01

_ENOUGH_TICKS = 1000
_BUSY = 0.5
_STOLEN = 0.01
_POLL_S = 0.1
_START_S = 30.0


@dataclass(frozen=True, slots=True)
class Latency:
    """How late a child process woke at the daemon's deadlines, and how long it computed at each.

    Attributes:
        rate_hz: of the deadlines [Hz].
        seconds: how long [s].
        realtime: scheduling and memory were as the loop wants them.
        late_us: lateness of the ticks that ran [us].
        tick_us: how long they computed, without device and telemetry [us].
        tick_fault: why they did not compute, or not to the end; "" if they did.
        skipped: deadlines that were missed by a whole period.
        histogram: ticks in the bins of `hapticd/status`.
        virtual: the processors are those of a virtual machine.
        stolen: processors that its host gave to others during that time.
        others: processors that other programs kept busy during that time.
        rivals: other programs under real-time scheduling.
    """

    rate_hz: float
    seconds: float
    realtime: bool
    late_us: Quantiles
    tick_us: Quantiles
    tick_fault: str
    skipped: int
    histogram: tuple[int, ...]
    virtual: bool
    stolen: float
    others: float
    rivals: tuple[str, ...]

    @property
    def skipped_share(self) -> float:
        """Share of all deadlines that were skipped."""
        return self.skipped / max(1, self.skipped + self.late_us.count)


def measure(
    loop: LoopConfig,
    config: LoadedConfig | None,
    seconds: float,
    progress: Callable[[float], None] = lambda share: None,
    root: Path = ROOT,
) -> Latency:
    """Let a child sleep to deadlines and compute, with the rights and on the processor that the daemon would have.

    Args:
        loop: rate, priority and processor.
        config: whose tick it computes, None for none.
        seconds: how long [s].
        progress: called with the share that is done.
        root: the file system of /proc.

    Raises:
        HapticdError: the child did not run.
    """
    machine = MachineWatch()
    with tempfile.TemporaryFile("w+") as request:
        json.dump(_request(loop, config, seconds), request)
        request.seek(0)
        child = subprocess.Popen(
            [sys.executable, "-P", "-m", "hapticd.doctor.sleeper"],
            stdin=request,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
    started_s = time.monotonic()
    try:
        while True:
            with contextlib.suppress(subprocess.TimeoutExpired):
                output, errors = child.communicate(timeout=_POLL_S)
                break
            taken_s = time.monotonic() - started_s
            progress(min(1.0, taken_s / seconds))
            if taken_s > seconds + _START_S:
                raise HapticdError("the child that measures did not end")
    finally:
        child.kill()
        child.wait()
    if child.returncode:
        raise HapticdError(
            f"the child that measures failed: {(errors.strip() or str(child.returncode)).splitlines()[-1]}"
        )
    told = json.loads(output.splitlines()[-1])
    conditions = machine.end()
    late_us = [late_ns * 1e-3 for late_ns in told["late_ns"]]
    histogram = LateHistogram()
    for late in late_us:
        histogram.add(late)
    virtual = False
    with contextlib.suppress(OSError):
        virtual = is_virtual(root)
    return Latency(
        rate_hz=loop.rate_hz,
        seconds=seconds,
        realtime=told["realtime"],
        late_us=Quantiles.of(late_us),
        tick_us=Quantiles.of(took_ns * 1e-3 for took_ns in told["took_ns"]),
        tick_fault=told["fault"],
        skipped=told["skipped"],
        histogram=tuple(histogram.counts),
        virtual=virtual,
        stolen=conditions.stolen,
        others=conditions.others,
        rivals=conditions.rivals,
    )


def judge(latency: Latency) -> Finding:
    """Whether a loop at this rate runs well here, and whom to ask when it does not."""
    period_us = 1e6 / latency.rate_hz
    share = latency.late_us.p99 / period_us
    figures = (
        f"{latency.rate_hz:g} Hz: p99 {latency.late_us.p99:.0f} us late, {share:.1%} of the period; "
        f"latest {latency.late_us.max:.0f} us; {latency.skipped} of "
        f"{latency.skipped + latency.late_us.count} deadlines skipped"
    )
    doubts = _doubts(latency)
    said = "; ".join([figures, *doubts])
    if share <= GOOD_DELAY and latency.skipped_share <= GOOD_SKIPPED:
        return ok(said)
    worse = problem if share > BAD_DELAY or latency.skipped_share > BAD_SKIPPED else advice
    tell_apart = own_command("bench", "lateness") + "  # tells the loop's own share from the machine's"
    return worse(said, *_remedies(latency, tell_apart))


def judge_tick(latency: Latency) -> Finding:
    """Whether what this configuration computes in a tick is little enough here."""
    if latency.tick_fault:
        return unknown(latency.tick_fault)
    tick_us = latency.tick_us
    share = tick_us.p99 * 1e-6 * latency.rate_hz
    said = (
        f"computing a tick of this configuration: p99 {tick_us.p99:.0f} us, {share:.1%} of the period; "
        f"p50 {tick_us.p50:.0f} us, longest {tick_us.max:.0f} us; device and telemetry come on top"
    )
    if share <= GOOD_DELAY:
        return ok(said)
    tell_apart = own_command("bench", "tick") + "  # tells a slow computer from a scene that is large"
    return (problem if share > BAD_DELAY else advice)(said, *_remedies(latency, tell_apart))


def _request(loop: LoopConfig, config: LoadedConfig | None, seconds: float) -> dict[str, Any]:
    """What the child is asked for."""
    read = config and {"text": config.text, "path": str(config.path), "folder": str(config.folder)}
    return {"parent": os.getpid(), "loop": loop.model_dump(), "seconds": seconds, "config": read}


def _doubts(latency: Latency) -> list[str]:
    """Reasons to doubt the figures."""
    doubts = []
    if not latency.realtime:
        doubts.append("measured without real-time rights")
    if latency.virtual:
        stolen = f" (it took {latency.stolen:.1%} of a processor)" if latency.stolen > _STOLEN else ""
        doubts.append(f"a virtual machine: its host{stolen} has a part in this, and the next minute may differ")
    if latency.others > _BUSY:
        doubts.append(f"other programs kept {latency.others:.1f} processors busy")
    if latency.rivals:
        doubts.append(f"another real-time program ran: {latency.rivals[0]}")
    if latency.late_us.count + latency.skipped < _ENOUGH_TICKS:
        doubts.append("too short to trust p99")
    return doubts


def _remedies(latency: Latency, tell_apart: str) -> list[str]:
    """What to do about a slow loop; the last resort is to measure more."""
    if not latency.realtime:
        return ["# mend scheduling and memory first, see above"]
    if latency.others > _BUSY or latency.rivals:
        return [own_command("doctor") + "  # once more, with the other programs stopped"]
    if latency.virtual:
        return ["# measure on the computer that has the device, not in a virtual machine"]
    return [tell_apart]
