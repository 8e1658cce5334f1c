"""A thread that follows the device, so that no client waits for the daemon and the daemon for no client."""

from __future__ import annotations

import asyncio
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Protocol

from hapticd.client import RefusedError
from hapticd.errors import HapticdError
from hapticd_views.gateway.cursor import Cursor

ABSENT_S = 0.5
"""After this time without a tick the device counts as gone [s]."""

END_S = 2.0

_TURN_S = 0.05
_AGAIN_S = 0.5  # before what was refused is tried again


class Device(Protocol):
    """What a gateway knows of the daemon; only the follower's thread uses it."""

    def next(self, timeout_s: float) -> Cursor | None:
        """The newest tick that is newer than the last one; None when none came in time [s]."""

    def push(self, force_n: Sequence[float]) -> None:
        """Have a force act from now on, x, y, z [N]."""

    def let_go(self) -> None:
        """Have no force act, until one is pushed again."""


class Follower(threading.Thread):
    """The newest tick of the device, for any number of readers, and the newest force for it.

    Args:
        device: as the daemon has it.
        trouble: takes one line each time that the daemon refuses something; called from the thread.
    """

    def __init__(self, device: Device, trouble: Callable[[str], None]) -> None:
        super().__init__(name="gateway-follower", daemon=True)
        self._device = device
        self._trouble = trouble
        self._newest: Cursor | None = None
        self._heard_s = time.monotonic()
        self._lock = threading.Lock()
        self._forces: deque[Sequence[float] | None] = deque()  # None: let go; one force at most, and one letting go
        self._ending = False
        self._asked = False
        self._loop = asyncio.get_running_loop()
        self._came = asyncio.Event()

    def push(self, force_n: Sequence[float]) -> None:
        """Have a force act, instead of one that still waits; returns at once.

        Args:
            force_n: x, y, z [N].
        """
        with self._lock:
            if self._forces and self._forces[-1] is not None:
                self._forces.pop()
            self._forces.append(force_n)

    def let_go(self) -> None:
        """Have no force act any more; returns at once."""
        with self._lock:
            self._forces.clear()
            self._forces.append(None)

    async def newer(self, seq: int) -> Cursor | None:
        """The newest tick as soon as it is another than this one; None when the device is gone.

        Args:
            seq: of the tick that is known; -1 for none.
        """
        try:
            async with asyncio.timeout(ABSENT_S):
                while (newest := self._newest) is None or newest.seq == seq or self._is_silent():
                    came = self._came
                    self._asked = True
                    if self._newest is newest:  # else it has come since, and the thread may not have seen the question
                        await came.wait()
                return newest
        except TimeoutError:
            return None

    def _is_silent(self) -> bool:
        """Whether the newest tick is an old one: the thread may have ended with the pipe that it tells trouble to."""
        return time.monotonic() - self._heard_s > ABSENT_S

    def end(self) -> None:
        """Hand over the force that waits, and end."""
        self._ending = True
        self.join(END_S)

    def run(self) -> None:
        """Follow until the end."""
        while not self._ending:
            try:
                self._take(self._device.next(_TURN_S))
                self._hand_over()
            except RefusedError as error:
                self._trouble(str(error))
            except HapticdError as error:
                self._trouble(str(error))
                time.sleep(_AGAIN_S)
        with suppress(HapticdError):  # it has gone as well
            self._hand_over()

    def _take(self, cursor: Cursor | None) -> None:
        now_s = time.monotonic()
        if cursor is not None:
            self._heard_s = now_s
            self._newest = cursor
            if self._asked:
                self._asked = False
                self._loop.call_soon_threadsafe(self._wake)
        elif self._is_silent():
            self._newest = None

    def _hand_over(self) -> None:
        with self._lock:
            forces = list(self._forces)
            self._forces.clear()
        for force_n in forces:
            if force_n is None:
                self._device.let_go()
            else:
                self._device.push(force_n)

    def _wake(self) -> None:
        self._came.set()
        self._came = asyncio.Event()
