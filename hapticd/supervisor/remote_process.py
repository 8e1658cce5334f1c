"""The remote process as the supervisor sees it: there while the scene has something that clients may drive."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from typing import Any

import msgpack

from hapticd import version
from hapticd.config.loading import LoadedConfig
from hapticd.config.ports import PortLimits, port_limits
from hapticd.errors import HapticdError
from hapticd.keys.store import KeyRing
from hapticd.paths import SCENE, STATE
from hapticd.remote.delays import DelayHistogram
from hapticd.remote.settings import LARGEST_PACKET, SETTINGS, RemoteSettings
from hapticd.supervisor.child import LoopProcess
from hapticd.supervisor.lock import InstanceLock

READY_TIMEOUT_S = 10.0
"""How long it may take to bind its sockets when the daemon starts [s]."""

SILENT_S = 5.0
"""After how much silence it is taken for one that hangs [s]; it says something each second."""

FIRST_S = 0.5
LONGEST_S = 30.0
"""Waits before it is started again: none at first, then these, each twice the one before [s]."""

STEADY_S = 60.0
"""One that has lived for this long is started again as if it died for the first time [s]."""

_END_TIMEOUT_S = 1.0  # that a killed process may take to be gone


class RemoteProcess:
    """Starts it, restarts it, ends it.

    Made and used in the main thread only: the kernel tells a child of its parent's death when the thread that made it
    ends.

    Args:
        lock: of the instance, in whose directory its sockets lie.

    Attributes:
        counts: what it counted, by the fields of the status.
        news: a client has come or gone since this was last set to False.
    """

    def __init__(self, lock: InstanceLock) -> None:
        self.counts: dict[str, Any] = _none_of([])
        self.news = False
        self._lock = lock
        self._ports: list[PortLimits] = []
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: socket.socket | None = None
        self._settings = b""
        self._descriptor = -1
        self._wait_s = 0.0
        self._due_s = 0.0
        self._started_s = 0.0
        self._heard_s = 0.0
        self._looked_s = time.monotonic()

    def prepare(self, config: LoadedConfig) -> None:
        """Start it before the loop is there, when it is going to be needed: it imports while the device opens."""
        if port_limits(config.config.scene):
            self._start()

    def serve(self, config: LoadedConfig, loop: LoopProcess, ring: KeyRing | None, epoch_offset_ns: int) -> None:
        """Have it serve this scene, or end where clients have nothing to drive; returns at once.

        Args:
            config: what is in force.
            loop: the process of the loop.
            ring: the keys that TCP endpoints take.
            epoch_offset_ns: what to add to CLOCK_MONOTONIC to get nanoseconds since the epoch.
        """
        self._ports = port_limits(config.config.scene)
        if not self._ports:
            self.close()
            return
        if [port.name for port in self._ports] != list(self.counts["remote_name"]):
            self.counts = _none_of(self._ports)
        remote = config.config.remote
        cpus = os.sched_getaffinity(0)
        with contextlib.suppress(ProcessLookupError):
            cpus -= os.sched_getaffinity(loop.process.pid)
        self._settings = RemoteSettings(
            version=version.__version__,
            directory=str(self._lock.directory),
            scene_tcp=remote.scene_tcp,
            state_tcp=remote.state_tcp,
            ring=ring,
            lease_s=remote.lease_s,
            rate_hz=config.config.loop.rate_hz,
            axes=loop.info.axes,
            has_orientation=loop.info.has_orientation,
            epoch_offset_ns=epoch_offset_ns,
            ports=tuple(self._ports),
            cpus=tuple(sorted(cpus)),
            realtime=loop.realtime and bool(cpus),
        ).packed()
        self._descriptor = loop.shared.descriptor
        if self._process is None or self._channel is None:
            return  # `turn` starts it
        try:
            self._send()
        except OSError:  # no room for the settings, and it must not go on with those before: it ends, `turn` sees that
            self._channel.shutdown(socket.SHUT_RDWR)

    def wait_ready(self) -> None:
        """Return when clients can come, at once where it is not needed.

        Raises:
            HapticdError: it does not get there; the message says why.
        """
        if self._channel is None:
            return
        waiting = select.poll()
        waiting.register(self._channel, select.POLLIN)
        said = self._said() if waiting.poll(READY_TIMEOUT_S * 1e3) else {}
        if "ready" not in said:
            self.close()
            raise HapticdError(said.get("error") or "the process that hears clients did not start")

    def turn(self) -> Iterator[str]:
        """Look after it; returns at once.

        Yields:
            What became of it, a line for people.
        """
        now_s = time.monotonic()
        # Only time in which this process itself ran counts.
        self._heard_s += max(0.0, now_s - self._looked_s - 0.1)
        self._looked_s = now_s
        if not self._settings:
            return
        trouble = self._trouble(now_s)
        if not trouble:
            return
        self._end()
        if now_s - self._started_s > STEADY_S:
            self._wait_s = 0.0
        self._due_s = now_s + self._wait_s
        again = f"is started again in {self._wait_s:g} s" if self._wait_s else "is started again"
        self._wait_s = min(max(FIRST_S, 2.0 * self._wait_s), LONGEST_S)
        yield f"the process that hears clients {trouble}; it {again}, until then what they drive is let go"

    def _trouble(self, now_s: float) -> str:
        """Start it where that is due, else look how it is: what is wrong, "" when nothing is."""
        if self._process is None:
            try:
                if now_s >= self._due_s:
                    self._start()
                    self._send()
            except OSError as error:  # no room for one more: no reason to end
                return f"cannot be started ({error.strerror})"
            return ""
        trouble = ""
        while said := self._said():
            self._heard_s = now_s
            if "error" in said:
                trouble = said["error"]
            elif said.get("remote_name") == self.counts["remote_name"]:  # else it is of the scene before
                self.news = self.news or said["remote_owner"] != self.counts["remote_owner"]
                self.counts = said
        code = self._process.poll()
        if code is None:
            return f"stood still for more than {SILENT_S:g} s" if now_s - self._heard_s > SILENT_S else ""
        return trouble or (f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}")

    def close(self) -> None:
        """Have it end; its sockets go."""
        self._settings = b""
        self._end()

    def _start(self) -> None:
        self._started_s = self._heard_s = self._looked_s = time.monotonic()
        self._channel, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [
                    *(sys.executable, "-P", "-m", "hapticd.remote.process"),
                    *("--socket", str(theirs.fileno()), "--parent", str(os.getpid())),
                ],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )

    def _send(self) -> None:
        assert self._channel is not None
        # When it has ended, or takes nothing any more, `turn` sees that and starts another, which gets this first.
        with (
            os.fdopen(os.memfd_create("settings"), "w+b") as file,  # it may be larger than a packet
            contextlib.suppress(ConnectionError, BlockingIOError),
        ):
            file.write(self._settings)
            file.flush()
            socket.send_fds(self._channel, [SETTINGS], [file.fileno(), self._descriptor], socket.MSG_DONTWAIT)

    def _said(self) -> dict[str, Any]:
        """The next thing that it has said; empty when there is none."""
        assert self._channel is not None
        try:
            packet = self._channel.recv(LARGEST_PACKET, socket.MSG_DONTWAIT)
        except (BlockingIOError, ConnectionError):
            return {}
        said: dict[str, Any] = msgpack.unpackb(packet, unicode_errors="surrogateescape") if packet else {}
        return said

    def _end(self) -> None:
        if self._channel is None:
            return
        self._channel.close()
        if self._process is not None:
            self._process.kill()  # it holds nothing that it would have to put away
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_END_TIMEOUT_S)
        self._process = self._channel = None
        self.counts = _none_of(self._ports)
        for name in (SCENE, STATE) if self._lock.keep() else ():  # else they may be another daemon's
            (self._lock.directory / name).unlink(missing_ok=True)


def _none_of(ports: Sequence[PortLimits]) -> dict[str, Any]:
    """What is counted of ports that have heard nothing yet."""
    bins = len(DelayHistogram().counts)
    return {
        "remote_name": [port.name for port in ports],
        "remote_kind": [port.kind for port in ports],
        "remote_owner": [""] * len(ports),
        "remote_messages": [0] * len(ports),
        "remote_refused": [0] * len(ports),
        "remote_late": [0] * len(ports),
        "remote_age_histogram": [0] * (bins * len(ports)),
        "remote_round_trip_histogram": [0] * (bins * len(ports)),
        "remote_strays": 0,
    }
