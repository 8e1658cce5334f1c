"""A link that also keeps what passes through it."""

from __future__ import annotations

from hapticd.errors import DriverError
from hapticd.trace import DriverTrace
from hapticd_drivers.rig.link import Link


class TracedLink:
    """A link behind which another one does the work; a `link.Link`.

    An entry is `> BYTES` for a message that was sent, `< BYTES` for one that came, or what else there is to know:
    frames that were damaged, messages that the link could not take, and the end of the link.

    Args:
        link: the real one; closed with this one.
        trace: where messages are kept.
    """

    def __init__(self, link: Link, trace: DriverTrace) -> None:
        self.where = link.where
        self.notes = link.notes
        self._link = link
        self._trace = trace
        self._damaged = link.damaged
        self._unsent = link.unsent

    @property
    def damaged(self) -> int:
        """Frames so far that were no message."""
        return self._link.damaged

    @property
    def unsent(self) -> int:
        """Messages so far that were dropped because the link could take no more."""
        return self._link.unsent

    def send(self, message: bytes) -> None:
        """Send a message, or drop it when the link can take no more."""
        self._trace.keep(">", message.hex(" "))
        try:
            self._link.send(message)
        except DriverError as error:
            self._trace.keep(error)
            raise
        if self._link.unsent != self._unsent:
            self._trace.keep("messages that the link took no more:", self._link.unsent - self._unsent)
            self._unsent = self._link.unsent

    def receive(self) -> list[bytes]:
        """The intact messages that have come, in the order in which they came."""
        try:
            messages = self._link.receive()
        except DriverError as error:
            self._trace.keep(error)
            raise
        if self._link.damaged != self._damaged:
            self._trace.keep("damaged frames:", self._link.damaged - self._damaged)
            self._damaged = self._link.damaged
        for message in messages:
            self._trace.keep("<", message.hex(" "))
        return messages

    def wait(self, timeout_s: float) -> None:
        """Return when something may have come, or after this time [s]."""
        self._link.wait(timeout_s)

    def close(self) -> None:
        """Give it back."""
        self._link.close()
