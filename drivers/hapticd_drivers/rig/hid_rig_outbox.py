"""What goes to a HID device, on a thread of its own: a write may take milliseconds, and a tick may not wait for it."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

from hapticd_drivers.scheduling import LOOK_EVERY_TICKS, follow_caller

END_S = 1.0
"""How long the last reports may take before they are left behind [s]."""

MOST_WAITING = 64
"""Orders that may wait for a write that stalls; whoever waits for an answer repeats them."""


class Outbox(threading.Thread):
    """The driver's one I/O thread; it moves reports and knows nothing of what is in them.

    Of the reports of ticks only the newest waits, since an old force is worth nothing. Orders all wait, in their order,
    and throw away the tick's report before them. Only one thread may send, and none of this ever waits for the device.

    Args:
        write: writes one report; negative when it failed.
        release: called by this thread once the end was asked for, and never before: others may be using what it frees.

    Attributes:
        failed: a write has failed; nothing goes out any more.
        dropped: reports so far that never went out, since the device took too long over those before.
    """

    def __init__(self, write: Callable[[bytes], int], release: Callable[[], None]) -> None:
        super().__init__(name="hid-rig-outbox", daemon=True)
        self.failed = False
        self.dropped = 0
        self._write = write
        self._release = release
        self._waiting: deque[tuple[bytes, bool]] = deque(maxlen=MOST_WAITING)  # report, and whether it is a tick's
        self._seen_all = threading.Lock()  # a gate: locked while this thread has seen all there is
        self._seen_all.acquire()
        self._until_look = 0
        self._ending = False
        self.start()

    def send_tick(self, report: bytes) -> None:
        """Send the report of a tick, instead of the one before it if that still waits."""
        self._until_look -= 1
        if self._until_look < 0:
            self._follow_caller()
        if self._take_tick_back():
            self.dropped += 1
        self._append(report, True)

    def send_order(self, report: bytes) -> None:
        """Send a report that has to arrive."""
        self._follow_caller()
        self._take_tick_back()
        self._append(report, False)

    def send_question(self, report: bytes) -> None:
        """Send a report that nobody misses: it is dropped when more than a tick's waits."""
        if len(self._waiting) > 1:
            self.dropped += 1
        else:
            self._append(report, False)

    def end(self) -> None:
        """Send what waits and end; a write that hangs is left behind, and releases what it holds when it returns."""
        self._ending = True
        self._open_gate()
        self.join(END_S)

    def run(self) -> None:
        """Write what there is; then sleep until there is more, or until the end."""
        ending = False
        while not ending:
            self._seen_all.acquire()
            ending = self._ending  # looked at before the reports, so that none that came before it is left
            while self._waiting and not self.failed:
                self._write_next()
        self._release()

    def _write_next(self) -> None:
        try:
            report, _ = self._waiting.popleft()
        except IndexError:  # the sender has just taken it back
            return
        try:
            self.failed = self._write(report) < 0
        except (OSError, ValueError):
            self.failed = True

    def _take_tick_back(self) -> bool:
        """Take the report of a tick back if one waits at the end; whether one did."""
        if not self._waiting:
            return False
        try:
            last = self._waiting.pop()
        except IndexError:  # this thread's run has just taken it
            return False
        if not last[1]:
            self._waiting.append(last)
        return last[1]

    def _append(self, report: bytes, is_tick: bool) -> None:
        self._waiting.append((report, is_tick))
        self._open_gate()

    def _open_gate(self) -> None:
        if self._seen_all.locked():
            try:  # noqa: SIM105 - suppress() would cost every tick a part of a microsecond
                self._seen_all.release()
            except RuntimeError:
                pass  # the end has opened it in between, beside a calibration that was called off

    def _follow_caller(self) -> None:
        """Be scheduled as the loop is. A calibration sends from a thread of its own, so it is looked at again."""
        self._until_look = LOOK_EVERY_TICKS
        follow_caller(self)
