"""The start of a control process: it opens the device, which takes as long as it takes, and then says what it found."""

from __future__ import annotations

import os
import select
import socket
import subprocess
import sys
import time
from dataclasses import asdict

import msgpack

from hapticd.config.loading import LoadedConfig
from hapticd.contracts.errors import ConfigError, HapticdError
from hapticd.control.predecessor import NOBODY, Predecessor
from hapticd.control.process import LARGEST_ANSWER
from hapticd.supervisor.controlled import Control, end

TIMEOUT_S = 30.0
"""How long the device may take to open before the start counts as failed [s]."""


class Start:
    """A control process on its way.

    Made in the main thread only: the kernel tells a child of its parent's death when the thread that made it ends.

    Args:
        config: what it shall run.
        before: where the loop before stopped, when this one goes on for it.
    """

    def __init__(self, config: LoadedConfig, before: Predecessor = NOBODY) -> None:
        self._config = config
        self._give_up_s = time.monotonic() + TIMEOUT_S
        request = msgpack.packb({"text": config.text, "name": str(config.path), "before": asdict(before)})
        self._channel, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        # The request lies in a file, so that nobody waits for the other side to read it.
        with theirs, os.fdopen(os.memfd_create("request"), "w+b") as file:
            file.write(request)
            file.seek(0)
            # In a session of its own, so that the terminal's interrupt reaches the supervisor alone.
            self._process = subprocess.Popen(
                [
                    *(sys.executable, "-m", "hapticd.control.process"),
                    *("--socket", str(theirs.fileno()), "--parent", str(os.getpid())),
                ],
                stdin=file,
                stdout=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )

    def poll(self, timeout_s: float = 0.0) -> Control | None:
        """The running control process; None while it is not ready.

        Args:
            timeout_s: how long to wait for it [s].

        Raises:
            HapticdError: it refused to start, with its own message and exit code; nothing is left of it.
        """
        waiting = select.poll()
        waiting.register(self._channel, select.POLLIN)
        if not waiting.poll(timeout_s * 1e3):
            if time.monotonic() < self._give_up_s:
                return None
            self.end()
            raise HapticdError(f"the device did not open within {TIMEOUT_S:g} s")
        answer, descriptors, _, _ = socket.recv_fds(self._channel, LARGEST_ANSWER, 1)
        if not descriptors:
            self.end()
            if not answer:
                raise HapticdError("the control process died while it started; its last words are above")
            refusal = msgpack.unpackb(answer)
            if refusal["exit_code"] == ConfigError.exit_code:
                raise ConfigError(*refusal["error"].split("\n"))
            raise HapticdError(refusal["error"])
        self._channel.close()
        return Control(self._process, msgpack.unpackb(answer), descriptors[0], self._config)

    def wait(self) -> Control:
        """Return when it is ready.

        Raises:
            HapticdError: it refused to start; nothing is left of it.
        """
        try:
            while True:
                control = self.poll(TIMEOUT_S)
                if control is not None:
                    return control
        except BaseException:
            self.end()
            raise

    def end(self) -> None:
        """Give up: the process ends, without force."""
        self._channel.close()
        end(self._process)
