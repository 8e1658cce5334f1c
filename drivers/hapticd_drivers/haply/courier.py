"""The driver's one I/O thread: it carries messages to the Inverse service and back, and knows nothing of them."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from typing import Any

from hapticd.errors import DeviceDisconnectedError, DeviceNotFoundError, DriverError
from hapticd_drivers.scheduling import LOOK_EVERY_TICKS, follow_caller

OPEN_S = 2.0
"""How long the service may take to be reached, and to say what is there [s]."""

END_S = 1.0
MOST_BYTES = 1 << 20


class Courier(threading.Thread):
    """A connection to the service.

    Each message that is sent brings one back; what has come unasked before is no answer. Only the newest that waits is
    sent: an old force is worth nothing.

    Args:
        url: of the service.

    Attributes:
        first: what the service said when it was reached.
        newest: the last message that has come.
        sent: messages that were given to it.
        exchanges: how many messages have come back for one that was sent.
        dropped: messages that a newer one has replaced before they were sent.
        exchange_ns: how long the last message was on its way and back.
        failed: why the connection is gone; None while it is there.

    Raises:
        DriverError: the service is not there, or not reached in time.
    """

    def __init__(self, url: str) -> None:
        super().__init__(name="inverse3-courier", daemon=True)
        self.first: str | bytes = ""
        self.newest: str | bytes = ""
        self.sent = 0
        self.exchanges = 0
        self.dropped = 0
        self.exchange_ns = 0
        self.failed: DriverError | None = None
        self._url = url
        self._outgoing: str | None = None
        self._ending = False
        self._until_look = 0
        self._lock = threading.Lock()
        self._reached = threading.Event()
        self._came = threading.Event()
        self._loop = asyncio.new_event_loop()
        self._go = asyncio.Event()
        self.start()
        self._reached.wait(2.0 * OPEN_S)
        if self.failed is None and not self._reached.is_set():
            self.failed = DeviceNotFoundError(f"inverse3: {url} does not answer: is the Haply Inverse service running?")
        if self.failed is not None:
            raise self.failed

    def send(self, message: str) -> None:
        """Send a message, instead of the one that still waits; does not wait."""
        self._until_look -= 1
        if self._until_look < 0:
            self._until_look = LOOK_EVERY_TICKS
            follow_caller(self)
        with self._lock:  # held for a moment only, by either side
            if self._outgoing is not None:
                self.dropped += 1
            self.sent += 1
            self._outgoing = message
        with contextlib.suppress(RuntimeError):  # it has ended
            self._loop.call_soon_threadsafe(self._go.set)

    @property
    def waiting(self) -> bool:
        """Whether the answer to a message, or to the newer one that replaced it, is still to come."""
        return self.sent > self.exchanges + self.dropped

    def wait(self, exchanges: int, timeout_s: float) -> None:
        """Return when there are more exchanges than these, or the connection is gone, or after this time [s]."""
        self._came.clear()
        if self.exchanges == exchanges and self.failed is None:
            self._came.wait(timeout_s)

    def end(self) -> None:
        """Send what waits, and end."""
        self._ending = True
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._go.set)
        self.join(END_S)

    def run(self) -> None:
        """Carry until the end."""
        try:
            self._loop.run_until_complete(self._carry())
        except Exception as error:  # noqa: BLE001 - whatever it was, the device is gone, and the loop has to hear of it
            self._fail(_lost(self._url, error, self._reached.is_set()))
        finally:
            self._loop.close()
            self._reached.set()
            self._came.set()

    def _arrive(self, message: str | bytes) -> None:
        self.newest = message

    def _fail(self, error: DriverError) -> None:
        self.failed = error

    async def _carry(self) -> None:
        connection: Any
        from websockets.asyncio.client import connect  # the extra may be missing

        async with connect(
            self._url, compression=None, proxy=None, open_timeout=OPEN_S, close_timeout=0.2, max_size=MOST_BYTES
        ) as connection:
            self._arrive(await asyncio.wait_for(connection.recv(), OPEN_S))
            self.first = self.newest
            self._reached.set()
            while True:
                await self._go.wait()
                self._go.clear()
                with self._lock:
                    message, self._outgoing = self._outgoing, None
                if message is not None:
                    with contextlib.suppress(TimeoutError):
                        while True:  # what lies unread would be taken for the answer, and each one after it be older
                            async with asyncio.timeout(0.0):
                                self._arrive(await connection.recv())
                    started_ns = time.monotonic_ns()
                    await connection.send(message)
                    self._arrive(await connection.recv())
                    self.exchange_ns = time.monotonic_ns() - started_ns
                    self.exchanges += 1
                    self._came.set()
                if self._ending and self._outgoing is None:
                    return


def _lost(url: str, error: Exception, reached: bool) -> DriverError:
    if isinstance(error, ImportError):
        return DeviceNotFoundError("inverse3: needs an extra that is not installed: pip install 'hapticd[gateway]'")
    if reached:
        return DeviceDisconnectedError(
            f"inverse3: the service at {url} is gone ({type(error).__name__}): start it again"
        )
    return DeviceNotFoundError(
        f"inverse3: no Haply Inverse service at {url} ({type(error).__name__}): install and start it (docs/inverse3.md)"
    )
