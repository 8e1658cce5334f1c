"""Take the force away after a loop that died or hangs: `python -m hapticd.supervisor.force_release`.

A process of its own, so that a driver that hangs cannot hang the supervisor. It is ready from the start with
everything imported, since the device holds its last force until it is released, and the start of an interpreter would
be most of that time. A byte on its standard output says that it is ready; it then reads one from its standard input:
one means release, none that it is not needed. Where the loop is a real-time process so is this, so that a computer
with more work than processors does not make it late.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import select
import signal
import subprocess
import sys

from hapticd.config.loading import LoadedConfig, parse
from hapticd.errors import HapticdError
from hapticd.loop.realtime import become_realtime

READY_TIMEOUT_S = 10.0
"""How long the helper may take to import what it needs [s]."""

TIMEOUT_S = 2.0
"""How long the device may take to let go [s]."""

_NO_HELPER = (
    "no helper is ready to take the force away if the loop dies: its process did not start, or was "
    "ended; restart hapticd"
)


class ForceRelease:
    """A helper that is ready.

    Args:
        config: names the device; what of it a reload may change is of no matter here.
    """

    def __init__(self, config: LoadedConfig) -> None:
        self._config = config
        self._helper = _start(config)
        self._ready = False

    @property
    def problem(self) -> str:
        """Why the force would not be taken away at once, a line for people; "" while the helper is ready."""
        return "" if self._helper.poll() is None and self.wait_ready(0.0) else _NO_HELPER

    def wait_ready(self, timeout_s: float = READY_TIMEOUT_S) -> bool:
        """Return when the helper is ready, or False when it does not get there.

        Args:
            timeout_s: how long it may take [s].
        """
        output = self._helper.stdout
        assert output is not None
        if not self._ready:
            waiting = select.poll()
            waiting.register(output, select.POLLIN)
            self._ready = bool(waiting.poll(timeout_s * 1e3)) and bool(output.read(1))
        return self._ready

    def release(self) -> str:
        """Open the device in the helper and disable it.

        Returns:
            What came of it, a line for people.
        """
        if self._helper.poll() is not None:  # somebody has killed it
            self.close()
            self._helper, self._ready = _start(self._config), False
        with contextlib.suppress(ProcessLookupError):
            self._helper.send_signal(signal.SIGCONT)  # somebody may have stopped it
        if not self.wait_ready():
            return "the helper that takes the force away did not start; the device's own watchdog has to release it"
        try:
            _, said = self._helper.communicate(b"!", TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return f"the device did not answer within {TIMEOUT_S:g} s; its own watchdog has to release it"
        if self._helper.returncode:
            return f"the device could not be opened: {said.decode(errors='replace').strip()}"
        return "the device is without force"

    def close(self) -> None:
        """The helper is not needed any more."""
        self._helper.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):  # it waits inside the kernel for its hardware
            self._helper.communicate(timeout=TIMEOUT_S)


def _start(config: LoadedConfig) -> subprocess.Popen[bytes]:
    with os.fdopen(os.memfd_create("configuration"), "w+b") as file:
        file.write(config.text.encode())
        file.seek(0)
        return subprocess.Popen(
            [sys.executable, "-P", "-m", "hapticd.supervisor.force_release", "--config", str(file.fileno())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            pass_fds=[file.fileno()],
            bufsize=0,
            start_new_session=True,
        )


def main() -> int:
    """Be ready; then open, disable, close."""
    # systemd tells all at once; the supervisor's end is the end of this.
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    parser = argparse.ArgumentParser()
    parser.add_argument("--config", type=int, required=True)
    arguments = parser.parse_args()
    try:
        with os.fdopen(arguments.config, "rb") as file:
            config = parse(file.read().decode(), "configuration")
        loop = config.config.loop
        driver = config.driver(config.options, loop.period_s)
        become_realtime(loop.model_copy(update={"realtime": "off" if loop.realtime == "off" else "preferred"}))
        os.write(sys.stdout.fileno(), b"r")
        if not sys.stdin.buffer.read(1):
            return 0
        driver.open()
        driver.close()
    except HapticdError as error:
        with contextlib.suppress(OSError):
            sys.stderr.write(f"{error}\n")
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
