"""The far end of an adapter: frames of a bus for a double, over a pseudo-terminal or a socket.

Lines of text are written and read here by the rules of the adapters' makers, in other words than the driver's.
"""

from __future__ import annotations

import contextlib
import os
import pty
import re
import select
import socket
import struct
import tty
from pathlib import Path

Frames = list[tuple[int, bytes]]


class TtyEnd:
    """An adapter on a pseudo-terminal; its port is a link that stays the same when it is plugged in again.

    Args:
        port: a path for the port.
    """

    END = b"\n"

    def __init__(self, port: Path) -> None:
        self.port = port
        self.raw = b""
        self._rest = b""
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self._slave = slave
        os.set_blocking(self._master, False)
        port.unlink(missing_ok=True)
        port.symlink_to(os.ttyname(slave))

    def receive(self, timeout_s: float) -> Frames:
        """Frames from the computer, waited for this time at most."""
        ready, _, _ = select.select([self._master], [], [], timeout_s)
        if not ready:
            return []
        try:
            data = os.read(self._master, 65536)
        except (BlockingIOError, OSError):
            return []
        *lines, self._rest = (self._rest + data).split(self.END)
        return [frame for line in lines if (frame := self.parse(line)) is not None]

    def send(self, identifier: int, data: bytes) -> None:
        self.send_raw(self.form(identifier, data))

    def send_raw(self, line: bytes) -> None:
        with contextlib.suppress(BlockingIOError, OSError):
            os.write(self._master, line)

    def close(self) -> None:
        """Unplug it."""
        self.port.unlink(missing_ok=True)
        os.close(self._master)
        os.close(self._slave)

    def parse(self, line: bytes) -> tuple[int, bytes] | None:
        raise NotImplementedError

    def form(self, identifier: int, data: bytes) -> bytes:
        raise NotImplementedError


class FdcanusbEnd(TtyEnd):
    """An fdcanusb: it says OK to each line and passes frames on."""

    def parse(self, line: bytes) -> tuple[int, bytes] | None:
        found = re.fullmatch(rb"can send ([0-9a-f]{4,8}) ((?:[0-9A-F]{2})*) BF", line)
        if found is None:
            if line.strip():
                self.send_raw(b"ERR unknown command\r\n")
            return None
        self.send_raw(b"OK\r\n")
        data = bytes.fromhex(found[2].decode())
        assert len(data) in (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64), "no length of CAN-FD"
        return int(found[1], 16), data

    def form(self, identifier: int, data: bytes) -> bytes:
        return f"rcv {identifier:x} {data.hex().upper()} E B F\r\n".encode()


class SlcanEnd(TtyEnd):
    """An slcan adapter: a carriage return for each line; deaf until it was opened."""

    END = b"\r"

    def __init__(self, port: Path) -> None:
        super().__init__(port)
        self.opened = False
        self.speed = b""

    def parse(self, line: bytes) -> tuple[int, bytes] | None:
        self.send_raw(b"\r")
        if line[:1] in (b"O", b"C"):
            self.opened = line == b"O"
        elif line[:1] == b"S":
            self.speed = line
        elif line[:1] == b"t" and self.opened:
            data = bytes.fromhex(line[5:].decode())
            assert len(data) == int(line[4:5])
            return int(line[1:4], 16), data
        elif line:
            self.send_raw(b"\a")
        return None

    def form(self, identifier: int, data: bytes) -> bytes:
        return f"t{identifier:03X}{len(data)}{data.hex().upper()}\r".encode() if self.opened else b""


class SocketEnd:
    """The other side of a CAN interface: struct canfd_frame and struct can_frame on a socket.

    Args:
        far: a socket that carries them, of a virtual CAN interface or of a pair.
        near: the other one of the pair.
        fd: whether it sends CAN-FD.
    """

    def __init__(self, far: socket.socket, near: socket.socket | None, fd: bool) -> None:
        self._socket = far
        self._near = near
        self._fd = fd
        far.setblocking(False)

    def receive(self, timeout_s: float) -> Frames:
        ready, _, _ = select.select([self._socket], [], [], timeout_s)
        frames = []
        while ready:
            try:
                raw = self._socket.recv(128)
            except OSError:
                break
            if not raw:
                break
            identifier, size = struct.unpack_from("=IB", raw)
            assert len(raw) == (72 if self._fd else 16)
            assert bool(identifier & 0x80000000) == (identifier & 0x1FFFFFFF > 0x7FF)
            frames.append((identifier & 0x1FFFFFFF, raw[8 : 8 + size]))
        return frames

    def send(self, identifier: int, data: bytes) -> None:
        tagged = identifier | (0x80000000 if identifier > 0x7FF else 0)
        form = "=IB3x64s" if self._fd else "=IB3x8s"
        self.send_raw(struct.pack(form, tagged, len(data), data))

    def send_raw(self, raw: bytes) -> None:
        with contextlib.suppress(OSError):
            self._socket.send(raw)

    def close(self) -> None:
        """Take it away."""
        self._socket.close()
        if self._near is not None:
            self._near.close()
