"""Take the force away after a loop that died or hangs: `python -m hapticd.supervisor.force_release`.

A process of its own, so that a driver that hangs cannot hang the supervisor. It is ready from the start with
everything imported, since the device holds its last force until it is released, and the start of an interpreter would
be most of that time. A byte on its standard output says that it is ready; it then reads its standard input to the end:
lines that name the device, and a mark which means release. Without the mark the supervisor has died, for who does not
need it any more kills it. The loop lets go at that death by itself; where it is stopped or hangs, it is killed and the
device released, and so it is where the loop has died before it let go; the daemon's log says what came of it. Where
the loop is a real-time process so is this, so that a computer with more work than processors does not make it late.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import logging
import os
import select
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import IO, Any

from hapticd.config.loading import LoadedConfig, parse
from hapticd.driver import Driver
from hapticd.errors import DeviceNotFoundError
from hapticd.loop.force_mark import ForceMark
from hapticd.loop.realtime import become_realtime
from hapticd.loop.resume import identity
from hapticd.supervisor.orphans import kill_orphans
from hapticd.supervisor.systemd import log_handler

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

_ALONE = "the daemon was killed under force: %s"

_RELEASE = b"!"
"""What the helper reads last where it is to release the device."""


class ForceRelease:
    """A helper that is ready.

    Args:
        config: names the device; what of it a reload may change is of no matter here.

    Attributes:
        mark: says whether a loop may have left a force.
        force_left: why a force may be left since the last release, a line for people; "" when there is none.
    """

    def __init__(self, config: LoadedConfig) -> None:
        self.force_left = ""
        self.mark = ForceMark()
        self._config = config
        self._device = ""
        self._helper, self._ready = _start(config, self.mark), False
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

    def name(self, device: str) -> None:
        """Have no other device let go of: with two of a kind, and no serial number configured, one may be found first.

        Args:
            device: `identity` of the one that has the force.
        """
        self._device = device
        self._tell()

    def _tell(self) -> None:
        """At once, for the helper may outlive this process."""
        said = self._helper.stdin
        assert said is not None
        with contextlib.suppress(OSError, ValueError):  # it has ended or is closed, which `release` sees
            said.write(json.dumps(self._device).encode() + b"\n")

    def release(self) -> str:
        """Open the device in the helper and disable it; where that cannot be, in this process. Never raises.

        Returns:
            What came of it, a line for people.
        """
        said, released = self._release()
        if released:
            self.mark.clear()
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
            _, said = self._helper.communicate(_RELEASE, TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return _NO_ANSWER
        return said.decode(errors="replace").strip() if self._helper.returncode else _RELEASED

    def _here(self) -> str:
        """Where a driver that hangs hangs a thread of the daemon, which ends anyway."""
        said = [_NO_ANSWER]

        def let_go() -> None:
            try:
                said[0] = _let_go(self._config.make_driver(), self._device) or _RELEASED
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
        self._helper, self._ready = _start(self._config, self.mark), False
        self._tell()
        self._ready_by_s = time.monotonic() + READY_TIMEOUT_S

    def close(self) -> None:
        """The helper is not needed any more."""
        self._helper.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):  # it waits inside the kernel for its hardware
            self._helper.communicate(timeout=TIMEOUT_S)


def _start(config: LoadedConfig, mark: ForceMark) -> subprocess.Popen[bytes]:
    with os.fdopen(os.memfd_create("configuration"), "w+b") as file, _daemons_log() as log:
        file.write(config.text.encode())
        file.seek(0)
        return subprocess.Popen(
            [
                *(sys.executable, "-P", "-m", "hapticd.supervisor.force_release"),
                *("--config", str(file.fileno()), "--parent", str(os.getpid())),
                *("--mark", str(mark.descriptor), "--log", str(log.fileno())),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            pass_fds=[file.fileno(), mark.descriptor, log.fileno()],
            bufsize=0,
            start_new_session=True,
        )


def _daemons_log() -> IO[bytes]:
    """Where the daemon's lines go, or nowhere if it has no standard error."""
    try:
        return os.fdopen(os.dup(2), "wb")
    except OSError:
        return Path(os.devnull).open("wb")


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
    parser.add_argument("--parent", type=int, required=True)
    parser.add_argument("--mark", type=int, required=True)
    parser.add_argument("--log", type=int, required=True)
    arguments = parser.parse_args()
    alone = False
    try:
        with os.fdopen(arguments.config, "rb") as file:
            config = parse(file.read().decode(), "configuration")
        loop = config.config.loop
        driver = config.make_driver()
        cpus = os.sched_getaffinity(0)
        become_realtime(loop.model_copy(update={"realtime": "off" if loop.realtime == "off" else "preferred"}))
        os.sched_setaffinity(0, cpus)  # behind a real-time loop that never waits it would not run
        os.write(sys.stdout.fileno(), b"r")
        *named, mark = sys.stdin.buffer.read().split(b"\n")
        if mark != _RELEASE:
            if not (kill_orphans(arguments.parent) or ForceMark(arguments.mark).is_set):
                return 0
            alone = True
            signal.setitimer(signal.ITIMER_REAL, TIMEOUT_S)  # ends this; no one is left who would, if the driver hangs
        problem = _let_go(driver, json.loads(named[-1]) if named else "")
    except Exception as error:  # noqa: BLE001 - a driver is anybody's code; its exception becomes one line
        problem = f"{_NOT_OPENED}{error}"
    if alone:
        os.dup2(arguments.log, sys.stderr.fileno())
        said = logging.LogRecord("hapticd", logging.ERROR, "", 0, _ALONE, (problem or _RELEASED,), None)
        log_handler().handle(said)
    else:
        with contextlib.suppress(OSError):
            sys.stderr.write(problem)
    return 1 if problem else 0


if __name__ == "__main__":
    sys.exit(main())
