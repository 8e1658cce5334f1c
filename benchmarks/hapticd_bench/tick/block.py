"""A block of ticks, and the time between their sleeps.

The time is taken from the sleep that the real `ControlLoop` is given, so that nothing of the loop is copied here.
"""

from __future__ import annotations

import contextlib
import time
from array import array
from collections.abc import Callable
from typing import Any

from hapticd.config.loading import LoadedConfig
from hapticd.config.walls import MAX_WALLS
from hapticd.errors import HapticdError
from hapticd.loop.loop import ControlLoop
from hapticd.loop.memory import SUPERVISOR_BEAT, EventReader, SharedMemory
from hapticd.tick.assemble import make_tick, place_device
from hapticd.tick.event import EventCode
from hapticd.tick.record import RecordLayout
from hapticd_bench.tick.case import RATE_HZ

_FOREVER_NS = 10**15


def stopwatch(
    spent_ns: array[int],
    sleep_until: Callable[[int], int] | None,
    stop: Callable[[], None],
    now_ns: Callable[[], int] = time.monotonic_ns,
) -> Callable[[int], int]:
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

    def sleep(deadline_ns: int) -> int:
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
        return woke_ns

    return sleep


def run_loop(
    config: LoadedConfig,
    spent: array[int],
    sleep_until: Callable[[int], int] | None,
    pieces: dict[str, list[int]],
) -> str:
    """Run the real loop on the configuration's device until `spent` is full.

    Args:
        config: what runs; the device is armed.
        spent: what each tick takes, from the start [ns].
        sleep_until: the real sleep; None lets ticks run back to back.
        pieces: by the names of the calls to time, where they are to be timed; each gets its times [ns].

    Returns:
        Why the device stayed disarmed; empty when it was armed.

    Raises:
        HapticdError: the device cannot be used, or the loop stopped by a fault.
    """
    settings = config.config
    driver = config.make_driver()
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
            (tick, "advance", "step"),
            (shared.layout, "pack_walls", "record"),
        ):
            if pieces:
                setattr(owner, method, timed(getattr(owner, method), pieces[name]))
        with contextlib.suppress(_Full):
            control.run()
        if pieces:
            del pieces["read"][0]  # where the loop found the device, before its first tick
        if tick.guard.latched:
            raise HapticdError(tick.fault_text or "stopped by a fault")
        return next((event.text for event in EventReader(shared).read() if event.code == EventCode.DISARMED), "")
    finally:
        driver.close()
        shared.close()


def run_reference(work: Callable[[], Any], spent: array[int], sleep_until: Callable[[int], int] | None) -> None:
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


def arithmetic() -> float:
    """The reference: a hundred multiplications and additions, interpreted."""
    value = 1.0
    for _ in range(100):
        value = value * 0.999 + 0.001
    return value


def nothing() -> None:
    """The empty loop's work."""


def timed(function: Callable[..., Any], spent_ns: list[int]) -> Callable[..., Any]:
    """The same function, taking the time of each call."""
    now_ns = time.monotonic_ns

    def call(*arguments: Any) -> Any:
        started_ns = now_ns()
        result = function(*arguments)
        spent_ns.append(now_ns() - started_ns)
        return result

    return call


class _Full(Exception):  # noqa: N818 - nothing went wrong
    """Ends a block."""


def _end_block() -> None:
    raise _Full


def _also(sleep: Callable[[int], int], pieces: dict[str, list[int]]) -> Callable[[int], int]:
    """The same sleep; where pieces are timed, an empty function is timed after it."""
    if not pieces:
        return sleep
    idle = timed(nothing, pieces["nothing"])

    def both(deadline_ns: int) -> int:
        woke_ns = sleep(deadline_ns)
        idle()
        return woke_ns

    return both
