"""The two sides of a CAN interface: a virtual one where the kernel has it and this user may, else a pair of sockets."""

from __future__ import annotations

import atexit
import contextlib
import os
import socket
import subprocess
from types import ModuleType

import pytest

from hapticd_drivers.motors.socketcan import SocketCanLink

VIRTUAL = f"vh{os.getpid()}"
"""Of this process alone: tests run beside each other."""


def can_pair(
    driver: ModuleType, monkeypatch: pytest.MonkeyPatch, fd: bool
) -> tuple[socket.socket, socket.socket | None]:
    """The far side, and the near one where it is ours: without CAN in the kernel, this driver opens a pair of sockets.

    Args:
        driver: the module whose `open_can` opens an interface.
        monkeypatch: of the test.
        fd: whether the far side takes CAN-FD.
    """
    with contextlib.suppress(OSError, AttributeError):
        virtual = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        subprocess.run(["ip", "link", "add", "dev", VIRTUAL, "type", "vcan"], check=False, capture_output=True)
        subprocess.run(["ip", "link", "set", VIRTUAL, "mtu", "72", "up"], check=False, capture_output=True)
        with contextlib.suppress(OSError):
            if fd:
                virtual.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
            virtual.bind((VIRTUAL,))
            atexit.register(subprocess.run, ["ip", "link", "del", VIRTUAL], check=False, capture_output=True)
            return virtual, None
        virtual.close()
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    monkeypatch.setattr(
        driver, "open_can", lambda name, interface, fd, up: SocketCanLink(name, interface, fd, near.dup())
    )
    return far, near
