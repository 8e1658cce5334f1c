"""Claims on devices behind what any number of programs may open: a CAN interface, another program's service.

A second daemon on the same motors would set torques between those of the first, and neither would see it.
"""

from __future__ import annotations

import errno
import socket

from hapticd.errors import DeviceBusyError


class Claims:
    """What this program alone commands, until it is released or the program dies.

    Each is the name of a socket in no directory: the kernel gives it out once, among the programs that share this
    network and its CAN interfaces.
    """

    def __init__(self) -> None:
        self._held: list[socket.socket] = []

    def take(self, driver: str, what: str) -> None:
        """Claim a device.

        Args:
            driver: what the configuration calls it.
            what: which device and where, for people too.

        Raises:
            DeviceBusyError: another program of hapticd, or another driver in this one, has it.
        """
        held = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        name = f"\0hapticd {driver} {what}".encode()[:_LONGEST]
        try:
            held.bind(name)
        except OSError as error:
            held.close()
            if error.errno != errno.EADDRINUSE:
                raise
            raise DeviceBusyError(
                f"{driver}: another program of hapticd has {what}: end it first (hapticd status lists daemons)"
            ) from None
        self._held.append(held)

    def release(self) -> None:
        """Give all of them back."""
        while self._held:
            self._held.pop().close()


_LONGEST = 107
"""Bytes of such a name, linux/un.h."""
