"""A process that measures, at the other end of a pipe."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from typing import Any

from hapticd.errors import HapticdError


class Spawned:
    """A function in a fresh process of its own.

    Args:
        name: what to call it in an error.
        serve: the function; its first argument is its end of the pipe.
        arguments: the rest of them.
    """

    def __init__(self, name: str, serve: Callable[..., None], *arguments: Any) -> None:
        self._name = name
        spawn = multiprocessing.get_context("spawn")
        self._connection, theirs = spawn.Pipe()
        self._process = spawn.Process(target=serve, args=(theirs, *arguments))
        self._process.start()
        theirs.close()

    def receive(self, timeout_s: float | None = None) -> Any:
        """What it sends next.

        Args:
            timeout_s: how long to wait for it [s]; None: for ever.

        Raises:
            HapticdError: it sent this error, nothing in time, or has died.
        """
        try:
            if not self._connection.poll(timeout_s):
                raise HapticdError(f"{self._name} did not answer within {timeout_s:g} s")
            message = self._connection.recv()
        except EOFError:
            raise HapticdError(f"{self._name} died; its last words are above") from None
        if isinstance(message, HapticdError):
            raise message
        return message

    def terminate(self) -> None:
        """Ask it to end."""
        self._process.terminate()

    def join(self, timeout_s: float) -> None:
        """Wait for its end."""
        self._process.join(timeout_s)

    def kill(self) -> None:
        """End it whatever it does; harmless when it has ended."""
        self._process.kill()
        self._process.join()
