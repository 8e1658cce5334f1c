"""The daemon's own loop in the time of a device that is not there."""

from __future__ import annotations

from hapticd.loop.loop import ControlLoop


class DeviceTime:
    """A clock that stands still but for the loop's own sleeps, each of which ends on time.

    The device moves by a period with each sample, so that loop and device live in the same time, and how busy this
    computer is changes nothing.
    """

    def __init__(self, stop_after: int) -> None:
        self.now_ns = 0
        self.ticks = 0
        self.loop: ControlLoop | None = None
        self._stop_after = stop_after

    def monotonic_ns(self) -> int:
        return self.now_ns

    def thread_time_ns(self) -> int:
        return 0

    def sleep_until(self, deadline_ns: int) -> int:
        assert deadline_ns > self.now_ns
        self.now_ns = deadline_ns
        self.ticks += 1
        if self.loop is not None and self.ticks > self._stop_after:
            self.loop.session.stop_requested = True
        return deadline_ns
