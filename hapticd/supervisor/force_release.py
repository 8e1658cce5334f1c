"""Take the force away after a loop that died or hangs: `python -m hapticd.supervisor.force_release`.

A process of its own, so that a driver that hangs cannot hang the supervisor. It is ready from the start with
everything imported, since the device holds its last force until it is released, and the start of an interpreter would
be most of that time. A byte on its standard output says that it is ready; it then reads its standard input: a mark and
the identity of the device mean release, nothing that it is not needed. Where the loop is a real-time process so is
this, so that a computer with more work than processors does not make it late.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import select
import signal
import subprocess
import sys
import threading
import time
from typing import Any

from hapticd.config.loading import LoadedConfig, parse
from hapticd.driver import Driver
from hapticd.errors import DeviceNotFoundError
from hapticd.loop.realtime import become_realtime
from hapticd.loop.resume import identity

READY_TIMEOUT_S = 10.0
"""How long the helper may take to import what it needs [s]."""

TIMEOUT_S = 2.0
"""How long the device may take to let go [s]."""

_NO_HELPER = (
    "no helper is ready to take the force away if the loop dies: its process did not start, or was "
    "ended; restart hapticd"
)

_NO_ANSWER = f"the device did not answer within {TIMEOUT_S:g} s; its own watchdog has to release it"
_NOT_OPENED = "the device could not be opened: "
_NOT_LET_GO = "the device did not let go: "
_RELEASED = "the device is without force"

_RELEASE = "!"
"""What the helper reads before the identity, which may be empty."""


class ForceRelease:
    """A helper that is ready.

    Args:
        config: names the device; what of it a reload may change is of no matter here.

    Attributes:
        device: `identity` of the device that has the force: with two of a kind, and no serial number configured,
            another may be the first to be found. "": any.
        force_left: why the last release may have left a force, a line for people; "" when it did not.
    """

    def __init__(self, config: LoadedConfig) -> None:
        self.device = ""
        self.force_left = ""
        self._config = config
        self._helper, self._ready = _start(config), False
        self._ready_by_s = time.monotonic() + READY_TIMEOUT_S

    @property
    def problem(self) -> str:
        """Why the force would not be taken away at once, a line for people; "" while the helper is ready, or nearly."""
        starting = time.monotonic() < self._ready_by_s
        return "" if self._helper.poll() is None and (self.wait_ready(0.0) or starting) else _NO_HELPER

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
        """Open the device in the helper and disable it; where that cannot be, in this process. Never raises.

        Returns:
            What came of it, a line for people.
        """
        said, released = self._release()
        self.force_left = "" if released else said
        return said

    def _release(self) -> tuple[str, bool]:
        """What came of it, and whether the force is gone."""
        why = "it was not ready in time"
        try:
            if self._helper.poll() is not None:  # somebody has killed it
                self.renew()
            with contextlib.suppress(ProcessLookupError):
                self._helper.send_signal(signal.SIGCONT)  # somebody may have stopped it
            if self.wait_ready():
                said = self._by_helper()
                if not said.startswith(_NOT_LET_GO):
                    return said, said == _RELEASED
                here = self._here()
                return f"{said}; without the helper, {here}", here == _RELEASED
        except Exception as error:  # noqa: BLE001 - whatever keeps a process from being started, a hand holds the device
            why = str(error)
        here = self._here()
        return f"the helper that takes the force away did not start ({why}); without it, {here}", here == _RELEASED

    def _by_helper(self) -> str:
        try:
            _, said = self._helper.communicate(_encoded(self.device), TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return _NO_ANSWER
        return said.decode(errors="replace").strip() if self._helper.returncode else _RELEASED

    def _here(self) -> str:
        """Where a driver that hangs hangs a thread of the daemon, which ends anyway."""
        said = [_NO_ANSWER]

        def let_go() -> None:
            try:
                said[0] = _let_go(self._config.make_driver(), self.device) or _RELEASED
            except Exception as error:  # noqa: BLE001 - a driver is anybody's code
                said[0] = f"{_NOT_OPENED}{error}"

        thread = threading.Thread(target=let_go, daemon=True)
        try:
            thread.start()
            thread.join(TIMEOUT_S)
        except RuntimeError:  # no more threads either
            let_go()
        return said[0]

    def renew(self) -> None:
        """Have another helper in the place of one that has done its work or has ended; it is not ready yet.

        Raises:
            OSError: no process can be started.
        """
        self.close()
        self._helper, self._ready = _start(self._config), False
        self._ready_by_s = time.monotonic() + READY_TIMEOUT_S

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


def _encoded(device: str) -> bytes:
    return f"{_RELEASE}{device}".encode(errors="surrogateescape")


def _let_go(driver: Driver[Any], device: str) -> str:
    """Open the device and take the force away; "" when it is gone, else what was in the way, a line for people.

    Raises:
        DeviceNotFoundError: another device was found; the one meant may still have its force.
    """
    found = identity(driver.open())
    driver.close()
    if device not in ("", found):
        raise DeviceNotFoundError(f"found {found} instead of {device}")
    return f"{_NOT_LET_GO}{driver.force_left}" if driver.force_left else ""


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
        driver = config.make_driver()
        become_realtime(loop.model_copy(update={"realtime": "off" if loop.realtime == "off" else "preferred"}))
        os.write(sys.stdout.fileno(), b"r")
        asked = sys.stdin.buffer.read().decode(errors="surrogateescape")
        if not asked:
            return 0
        problem = _let_go(driver, asked.removeprefix(_RELEASE))
    except Exception as error:  # noqa: BLE001 - a driver is anybody's code; its exception becomes one line
        problem = f"{_NOT_OPENED}{error}"
    with contextlib.suppress(OSError):
        sys.stderr.write(problem)
    return 1 if problem else 0


if __name__ == "__main__":
    sys.exit(main())
