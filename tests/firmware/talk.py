"""A host that is as simple as can be: one message, a millisecond of simulated time, the answers."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType

import serial

from hapticd_drivers.rig import messages
from hapticd_drivers.rig.frames import FrameReader, framed
from tests.firmware.board import Board


class Talk:
    """Speaks with a board that runs at the pace of steps and has just been plugged in.

    Args:
        board: the board.
        sequence: of the first message.
    """

    def __init__(self, board: Board, sequence: int = 1) -> None:
        self.board = board
        self.sequence = sequence
        self.reader = FrameReader()
        self._port = serial.Serial(str(board.port), 1_000_000, timeout=60.0, exclusive=True)
        self._written = 0
        self._read = 0

    def __enter__(self) -> Talk:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._port.close()

    def raw(self, data: bytes, us: float = 1000.0) -> list[messages.Message]:
        """Send bytes, let time pass, and decode what has come."""
        self._written += self._port.write(data)
        sent = self.board.run(us, self._written)
        heard = [messages.decode(message) for message in self.reader.feed(self._port.read(sent - self._read))]
        self._read = sent
        assert None not in heard
        return [message for message in heard if message is not None]

    def say(self, make: Callable[[int], bytes], us: float = 1000.0) -> list[messages.Message]:
        """Send the message that `make` builds with the next sequence."""
        message = make(self.sequence)
        self.sequence = self.sequence + 1 & 0xFFFF
        return self.raw(framed(message), us)

    def greet(self) -> messages.Identity:
        """Say HELLO to a board just switched on."""
        self.raw(b"", 5000)
        heard = self.say(messages.hello, 2000)
        assert isinstance(heard[-1], messages.Identity)
        return heard[-1]

    def state(self, make: Callable[[int], bytes]) -> messages.State:
        """Send a message that is answered by a STATE, and by nothing else."""
        (heard,) = self.say(make)
        assert isinstance(heard, messages.State)
        return heard

    def poll(self) -> messages.State:
        """Where it is."""
        return self.state(lambda sequence: messages.poll(sequence, 0))

    def push(self, newton: float) -> messages.State:
        """One tick with a force [N]."""
        return self.state(lambda sequence: messages.force(sequence, 0, [round(newton * 1e6)]))
