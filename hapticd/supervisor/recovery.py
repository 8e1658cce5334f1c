"""A device that was lost is looked for until it is back: soon at first, then less often, and when one is plugged in."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from pathlib import Path

from hapticd.config.loading import LoadedConfig
from hapticd.errors import HapticdError
from hapticd.loop.force_mark import ForceMark
from hapticd.loop.resume import FROM_START, ResumeState, left_by
from hapticd.supervisor.child import LoopProcess, LoopStart

FIRST_S = 1.0
LONGEST_S = 30.0
"""Time to the first try and the longest between two; each wait is twice the one before [s]."""

SETTLE_S = 1.0
"""From something being plugged in to the try: udev has to give it its rights first [s]."""

STEADY_S = 60.0
"""A device that has been there for this long is looked for as if it were lost for the first time [s]."""


class Recovery:
    """Starts loops until one has the device again.

    Args:
        rescue: called with why the force has to be taken away from outside, where a try did not end by itself, or the
            loop that lost the device did not let go of it.
        mark: says whether a loop may have left a force.

    Attributes:
        lost: the device is being looked for.
        lost_s: since when, on CLOCK_MONOTONIC [s].
        next_try_s: when the next try is due; of one under way, when it began [s].
        why: why the last try failed, or why the device was lost.
        resume: what the next loop goes on from.
    """

    def __init__(self, rescue: Callable[[str], None], mark: ForceMark) -> None:
        self._rescue = rescue
        self._mark = mark
        self.lost = False
        self.lost_s = 0.0
        self.next_try_s = 0.0
        self.why = ""
        self.resume = FROM_START
        self._wait_s = FIRST_S
        self._found_s = 0.0
        self._start: LoopStart | None = None
        self._arrivals = HotplugWatch()

    def begin(self, lost: LoopProcess, why: str) -> None:
        """Look for a device that has just been lost.

        Args:
            lost: the process that lost it and is about to end; it has left what the next one goes on from.
            why: how it was lost.
        """
        now_s = time.monotonic()
        if now_s - self._found_s > STEADY_S:
            self._wait_s = FIRST_S
        self.lost = True
        self.lost_s = now_s
        self._arrivals = HotplugWatch()
        self.resume = left_by(lost.shared, lost.info)
        self._put_off(why)

    def turn(self, lost: LoopProcess, config: LoadedConfig) -> LoopProcess | None:
        """Go on looking; returns at once. The loop that has the device, once there is one.

        Args:
            lost: the process that lost it, which has to end first.
            config: what the next one is to run.
        """
        if not lost.force_seen_to:
            self._see_to_force(lost)
        if lost.exit_code is None:
            return None
        now_s = time.monotonic()
        if self._arrivals.news():
            self._wait_s = FIRST_S
            self.next_try_s = min(self.next_try_s, now_s + SETTLE_S)
        try:
            if self._start is None:
                if now_s >= self.next_try_s:
                    self._start = LoopStart(config, self._rescue, self._mark, self.resume)
                return None
            control = self._start.poll()
            if control is None:
                return None
        except (HapticdError, OSError) as error:
            self.stop()
            self._put_off(str(error))
            return None
        self._start = None
        self.lost = False
        self._found_s = now_s
        return control

    def amend(self, resume: ResumeState) -> None:
        """Change what the next loop goes on from, also when it is already on its way.

        What changes nothing costs no try: who says `clear` again and again would keep the device away.
        """
        if resume != self.resume:
            self.resume = resume
            self.stop()

    def hurry(self) -> None:
        """Somebody has seen to what kept the device away: look at once, and as if for the first time."""
        self._wait_s = FIRST_S
        self.next_try_s = min(self.next_try_s, time.monotonic())

    def stop(self) -> None:
        """Give up a try that is under way; the next turn begins another."""
        if self._start is not None:
            self._start.end()
            self._start = None

    def _see_to_force(self, lost: LoopProcess) -> None:
        """Have the force of a lost device taken away from outside where its loop did not: it may only be silent."""
        if lost.exit_code is not None:
            why = lost.left_behind
        elif lost.stalled():  # in a driver that cannot let go of a device that is gone
            lost.kill()
            why = "the control loop did not let go of its device and was killed"
        else:
            return
        lost.force_seen_to = True
        if why:
            self._rescue(why)

    def _put_off(self, why: str) -> None:
        self.why = why
        self.next_try_s = time.monotonic() + self._wait_s
        self._wait_s = min(2.0 * self._wait_s, LONGEST_S)


PLACES = (Path("/sys/bus/usb/devices"), Path("/sys/class/hidraw"), Path("/sys/class/tty"))
"""Directories with an entry a device."""

EVERY_S = 0.25
"""How often the lists are looked at [s]; a look takes some 50 us."""


class HotplugWatch:
    """What was plugged in since the last look."""

    def __init__(self) -> None:
        self._seen = _listed()
        self._due_s = 0.0

    def news(self) -> bool:
        """Whether a device has come since this was asked last."""
        now_s = time.monotonic()
        if now_s < self._due_s:
            return False
        self._due_s = now_s + EVERY_S
        before, self._seen = self._seen, _listed()
        return not self._seen <= before


def _listed() -> set[Path]:
    seen: set[Path] = set()
    for place in PLACES:
        with contextlib.suppress(OSError):  # a computer without such devices has no list of them
            seen.update(place.iterdir())
    return seen
