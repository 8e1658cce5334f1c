"""What carries messages between this computer and a rig."""

from __future__ import annotations

from typing import Protocol


class Link(Protocol):
    """A line, or a pipe of reports. Nothing of it ever waits, except `wait`.

    Attributes:
        where: the port, for people.
        notes: what is to be known about it, a line each.
    """

    where: str
    notes: tuple[str, ...]

    @property
    def damaged(self) -> int:
        """Frames so far that were no message."""

    @property
    def unsent(self) -> int:
        """Messages so far that were dropped because the link could take no more."""

    def send(self, message: bytes) -> None:
        """Send a message, or drop it when the link can take no more.

        Raises:
            DeviceDisconnectedError: the link is gone.
        """

    def receive(self) -> list[bytes]:
        """The intact messages that have come, in the order in which they came.

        Raises:
            DeviceDisconnectedError: the link is gone.
        """

    def wait(self, timeout_s: float) -> None:
        """Return when something may have come, or after so long [s].

        Raises:
            DeviceDisconnectedError: the link is gone.
        """

    def close(self) -> None:
        """Give it back; never raises."""
