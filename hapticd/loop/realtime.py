"""Make this process a real-time one, and sleep to absolute deadlines.

Order matters: everything is imported and built before memory is locked and the collector frozen, and the scheduling
class changes last.
"""

from __future__ import annotations

import ctypes
import gc
import os
import signal
import struct
import time

from hapticd.config.models import LoopConfig
from hapticd.errors import RealtimeError

_MCL_CURRENT_AND_FUTURE = 1 | 2
_PR_SET_PDEATHSIG = 1
_PR_SET_TIMERSLACK = 29

_libc = ctypes.CDLL(None, use_errno=True)
_monotonic_ns = time.monotonic_ns
_sleep = time.sleep
_latency_hold: int | None = None


def die_with_parent(parent_pid: int, by: signal.Signals = signal.SIGTERM) -> None:
    """Get a signal when the parent dies; also when it has died already."""
    _libc.prctl(_PR_SET_PDEATHSIG, by, 0, 0, 0)
    if os.getppid() != parent_pid:
        os.kill(os.getpid(), by)


def sleep_exactly() -> None:
    """Have sleeps of this thread end when they are due at normal priority too, and not 50 us later."""
    _libc.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)


def become_realtime(config: LoopConfig) -> tuple[list[str], list[str]]:
    """Lock memory, freeze the collector, hold the processor out of deep idle, and take SCHED_FIFO.

    Returns:
        What keeps the loop from being a real-time one, each with the grant that mends it; and what only makes it
        later than it need be.

    Raises:
        RealtimeError: `required`, and scheduling or locked memory could not be had.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    if config.realtime == "off":
        return ['loop.realtime = "off": the loop runs at normal priority'], []
    problems = []
    if _libc.mlockall(_MCL_CURRENT_AND_FUTURE):
        problems.append(
            f"memory is not locked ({os.strerror(ctypes.get_errno())}): grant CAP_IPC_LOCK or a memlock limit of "
            "unlimited"
        )
    advice = _hold_latency()
    try:
        cpu = max(os.sched_getaffinity(0)) if config.cpu is None else config.cpu
        os.sched_setaffinity(0, {cpu})
    except OSError as error:
        advice.append(f"loop.cpu = {config.cpu}: {error.strerror}; the loop may move between processors")
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(config.priority))
    except OSError as error:
        problems.append(
            f"no SCHED_FIFO {config.priority} ({error.strerror}): grant CAP_SYS_NICE or an rtprio limit of "
            f"{config.priority}"
        )
        sleep_exactly()
    if problems and config.realtime == "required":
        raise RealtimeError('loop.realtime = "required", but ' + "; ".join(problems))
    return problems, advice


def leave_realtime() -> None:
    """Have what is left to do at normal priority, so that the end of this loop holds up no other on its processor."""
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def sleep_until(deadline_ns: int) -> int:
    """Sleep until a CLOCK_MONOTONIC time and return when it woke [ns]; no signal cuts it short.

    Since Python 3.11 `time.sleep` makes an absolute deadline of its argument. Between its waking and the reading of the
    clock lies less code than in a call through ctypes: 1.3 us at the median.
    """
    left_ns = deadline_ns - _monotonic_ns()
    if left_ns > 0:
        _sleep(left_ns * 1e-9)
    return _monotonic_ns()


def _hold_latency() -> list[str]:
    """Ask the kernel not to let the processor sleep deeply, for as long as this process lives."""
    global _latency_hold
    if _latency_hold is not None:
        return []
    try:
        descriptor = os.open("/dev/cpu_dma_latency", os.O_RDWR | os.O_CLOEXEC)
        os.write(descriptor, struct.pack("i", 0))
    except OSError as error:
        return [f"/dev/cpu_dma_latency: {error.strerror}; deep idle makes the loop later"]
    _latency_hold = descriptor
    return []
