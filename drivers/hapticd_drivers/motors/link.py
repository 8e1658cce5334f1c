"""What carries CAN frames between this computer and motor controllers, and how it was found."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from hapticd.errors import DeviceNotFoundError, DriverError
from hapticd.trace import DriverTrace

AUTO = "auto"

Frame = tuple[int, bytes]
"""Identifier and data."""

_SYSFS = Path("/sys/class/net")
_ARPHRD_CAN = "280"
_IFF_UP = 1  # linux/if.h
_CANFD_MTU = 72  # linux/can.h


class BusLink(Protocol):
    """An adapter. Nothing of it ever waits, except `wait`.

    Attributes:
        where: the port or interface, for people.
        damaged: what has come so far and was no frame.
    """

    where: str
    damaged: int

    @property
    def unsent(self) -> int:
        """Frames so far that were dropped because the adapter could take no more."""

    def send(self, identifier: int, data: bytes) -> None:
        """Send a frame, or drop it when the adapter can take no more.

        Raises:
            DeviceDisconnectedError: the adapter is gone.
        """

    def receive(self) -> list[Frame]:
        """The frames that have come, in the order in which they came.

        Raises:
            DeviceDisconnectedError: the adapter is gone.
        """

    def wait(self, timeout_s: float) -> None:
        """Return when something may have come, or after this time [s].

        Raises:
            DeviceDisconnectedError: the adapter is gone.
        """

    def close(self) -> None:
        """Give it back; never raises."""


class TracedLink:
    """A link that also keeps what passes through it: `> ID BYTES` was sent, `< ID BYTES` came.

    Args:
        link: the real one; closed with this one.
        trace: where frames are kept.
    """

    def __init__(self, link: BusLink, trace: DriverTrace) -> None:
        self.where = link.where
        self.damaged = link.damaged
        self.unsent = link.unsent
        self._link = link
        self._trace = trace

    def send(self, identifier: int, data: bytes) -> None:
        """Send a frame, or drop it when the adapter can take no more."""
        self._trace.keep(">", f"{identifier:x}", data.hex(" "))
        try:
            self._link.send(identifier, data)
        except DriverError as error:
            self._trace.keep(error)
            raise
        if self._link.unsent != self.unsent:
            self._trace.keep("frames that the adapter took no more:", self._link.unsent - self.unsent)
            self.unsent = self._link.unsent

    def receive(self) -> list[Frame]:
        """The frames that have come, in the order in which they came."""
        try:
            frames = self._link.receive()
        except DriverError as error:
            self._trace.keep(error)
            raise
        if self._link.damaged != self.damaged:
            self._trace.keep("damaged:", self._link.damaged - self.damaged)
            self.damaged = self._link.damaged
        for identifier, data in frames:
            self._trace.keep("<", f"{identifier:x}", data.hex(" "))
        return frames

    def wait(self, timeout_s: float) -> None:
        """Return when something may have come, or after this time [s]."""
        self._link.wait(timeout_s)

    def close(self) -> None:
        """Give it back."""
        self._link.close()


def can_interfaces() -> list[str]:
    """Every CAN interface of the kernel, up or not."""
    return sorted(place.parent.name for place in _SYSFS.glob("*/type") if place.read_text().strip() == _ARPHRD_CAN)


def is_up(interface: str) -> bool:
    """Whether a CAN interface is up."""
    return int((_SYSFS / interface / "flags").read_text(), 16) & _IFF_UP != 0


def carries_fd(interface: str) -> bool:
    """Whether a CAN interface that is up takes frames of more than eight bytes."""
    return int((_SYSFS / interface / "mtu").read_text()) >= _CANFD_MTU


def only(driver: str, there: list[str], what: str) -> str:
    """The one channel that is there.

    Args:
        driver: what the configuration calls it.
        there: the channels that may be meant.
        what: what was looked for, for people.

    Raises:
        DeviceNotFoundError: there is none, or there are several.
    """
    if len(there) == 1:
        return there[0]
    if not there:
        raise DeviceNotFoundError(
            f"{driver}: there is no {what}: plug the adapter in, or say where it is with device.options.channel"
        )
    raise DeviceNotFoundError(
        f"{driver}: which of them is the bus of the motors? device.options.channel = one of {', '.join(there)}"
    )
