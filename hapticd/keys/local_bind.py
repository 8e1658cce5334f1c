"""A ZeroMQ socket on a path: open to its owner and group alone, from its first moment on."""

from __future__ import annotations

import os
from pathlib import Path

import zmq

from hapticd.own_file import OwnFile

MODE = 0o660
"""Of the socket's file; its directory decides further who may reach it."""


def bind_local(socket: zmq.Socket[bytes], path: Path) -> OwnFile:
    """Bind a socket to a path.

    The umask is the whole process's, so that a file that another thread makes in this moment is for no more than
    owner and group either.

    Args:
        socket: any kind that binds.
        path: where its file is to lie.

    Returns:
        The file, which ZeroMQ leaves behind.

    Raises:
        ZMQError: it cannot be bound.
        OSError: its mode cannot be set.
    """
    before = os.umask(0o777 & ~MODE)  # with the mode set afterwards alone it would be open to all until then
    try:
        socket.bind(f"ipc://{path}")
    finally:
        os.umask(before)
    file = OwnFile(path, path.lstat())
    try:
        path.chmod(MODE)  # a directory's default list of rights takes the place of a umask
    except OSError:
        file.unlink()
        raise
    return file
