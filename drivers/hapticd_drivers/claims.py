"""Claims on devices behind what any number of programs may open: a CAN interface, another program's service.

A second daemon on the same motors would set torques between those of the first, and neither would see it.

A claim keeps mistakes out. Any program of this computer may take the name of one and keep a daemon out, as it may speak
to such a device without asking; so a refusal says whose program it is, as the kernel knows it.
"""

from __future__ import annotations

import contextlib
import errno
import pwd
import socket
import struct

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
        held = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        name = f"\0hapticd {driver} {what}".encode()[:_LONGEST]
        try:
            held.bind(name)
            held.listen(socket.SOMAXCONN)  # never answered: the kernel tells who connects whose it is
        except OSError as error:
            held.close()
            if error.errno != errno.EADDRINUSE:
                raise
            raise DeviceBusyError(
                f"{driver}: {_holder(name)} has {what}: end it first (`hapticd status` lists daemons)"
            ) from None
        self._held.append(held)

    def release(self) -> None:
        """Give all of them back."""
        while self._held:
            self._held.pop().close()


def _holder(name: bytes) -> str:
    """Whose claim it is, for people, with what says more of it."""
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
        asking.setblocking(False)  # one that has been asked too often has no room for another
        asking.connect(name)
        said = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize(_CREDENTIALS))
        process, user, _group = struct.unpack(_CREDENTIALS, said)
        return f"process {process} of user {_user(user)} (`ps -fp {process}`)"
    return "another program (`sudo ss -xap | grep '@hapticd'` names it)"


def _user(number: int) -> str:
    try:
        return pwd.getpwuid(number).pw_name
    except KeyError:
        return str(number)


_CREDENTIALS = "iII"
_LONGEST = 107
"""Bytes of such a name, linux/un.h."""
