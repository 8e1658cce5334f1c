"""The remote process: what runs behind `python -m hapticd.remote.process`.

It hears the clients of the scene and streams them each tick, off the loop's processor where there is another. There it
has the lowest real-time priority, so that no ordinary program comes between a tick and those who wait for it; while it
is flooded it is an ordinary one. The supervisor starts it with one end of a socket pair as its descriptor `--socket`:
settings come in over that, the loop's memory with them, and a sign of life with what was counted goes out each second.

One thread. It sleeps until the next tick ought to be done and then looks, in naps of a few microseconds, whether it is,
so that the loop need not wake it; a message of a client ends any sleep.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import os
import select
import signal
import socket
import sys
import time
from pathlib import Path
from typing import Any

import msgpack

from hapticd.config.walls import MAX_WALLS
from hapticd.errors import HapticdError
from hapticd.keys.connections import raise_descriptor_limit
from hapticd.loop.memory import RecordReader, SharedMemory
from hapticd.loop.realtime import die_with_parent, sleep_exactly
from hapticd.loop.remote_slots import SlotWriter
from hapticd.paths import SCENE, STATE
from hapticd.remote.priority import Priority
from hapticd.remote.scene_socket import SceneSocket
from hapticd.remote.settings import SETTINGS, RemoteSettings, unpacked
from hapticd.remote.state_map import ports_of, state_map
from hapticd.remote.state_socket import StateSocket
from hapticd.tick.record import RecordLayout, TickRecord

NAP_S = 2e-5
"""How long to sleep between two looks for a tick that is due [s]; for one that is late a tenth of how late it is."""

IDLE_S = 0.01
"""The same at most, and while it is not told to any client [s]."""

STATUS_S = 1.0
"""Time between two reports of the counts to the supervisor [s]."""

SOONEST_S = 0.1
"""The same when a client has come or gone [s]."""

_MOST_BEHIND = 100  # ticks that are told late; of those before them clients see the gap
_EARLY_NS = 20_000


class _Memory:
    """The memory of a loop, with what is read from it and written into it."""

    def __init__(self, settings: RemoteSettings, descriptor: int) -> None:
        layout = RecordLayout(len(settings.axes), settings.has_orientation, MAX_WALLS)
        self.shared = SharedMemory(layout, settings.rate_hz, descriptor)
        self.reader = RecordReader(self.shared, newest=True)
        self.slots = SlotWriter(self.shared, ((port.name, port.kind) for port in settings.ports))


class RemoteServer:
    """Both sockets and the memory of the loop.

    Args:
        channel: to the supervisor.
        settings: what to serve.
        descriptor: of the memory.

    Raises:
        HapticdError: a socket cannot be bound.
    """

    def __init__(self, channel: socket.socket, settings: RemoteSettings, descriptor: int) -> None:
        self._channel = channel
        self._priority = Priority(settings.realtime)  # before ZeroMQ has threads, which inherit it
        directory = Path(settings.directory)
        self._scene = SceneSocket(directory / SCENE, settings.scene_tcp, settings.ring)
        try:
            self._state = StateSocket(directory / STATE, settings.state_tcp, settings.ring)
        except BaseException:
            self._scene.close()
            raise
        self._priority.settle()
        self._memory = _Memory(settings, descriptor)
        self._serve(settings)
        self._reported_ns = 0
        self._owners: list[str] = []
        self._house_due_ns = 0
        self._due_ns = time.monotonic_ns()
        self._lead_ns = 0.0

    def run(self) -> None:
        """Serve until the supervisor has gone."""
        channel = self._channel.fileno()
        waiting = [self._scene.descriptor, channel]
        while True:
            more = self._scene.receive()
            looked_ns = time.monotonic_ns()
            self._tell()
            now_ns = time.monotonic_ns()
            if now_ns >= self._house_due_ns:
                self._house_due_ns = now_ns + int(IDLE_S * 1e9)
                self._scene.turn()
                self._state.turn()
                self._priority.turn(now_ns)
                self._report(now_ns)
            if more:
                self._priority.flooded(now_ns)
                continue
            ready, _, _ = select.select(waiting, (), (), self._pause_s(looked_ns))
            if channel in ready and not self._hear():
                return

    def close(self) -> None:
        """Let go of the sockets."""
        self._scene.close()
        self._state.close()

    def _serve(self, settings: RemoteSettings) -> None:
        self._settings = settings
        self._period_ns = round(1e9 / settings.rate_hz)
        self._scene.serve(settings.ports, self._memory.slots, settings.lease_s, settings.axes, settings.rate_hz)
        self._scene.admit(settings.ring)
        self._state.admit(settings.ring)

    def _tell(self) -> None:
        """Tell the ticks that are done."""
        records = self._memory.reader.read()
        if not records:
            return
        for record in records:
            if not self._memory.slots.recorded(record.deadline_ns):
                record.ports = None  # of another list
        ports = list(self._scene.ports.values())
        if self._state.subscribed:
            names = [(name, port.since_ns) for name, port in self._scene.ports.items()]
            for record in records[-_MOST_BEHIND:]:
                self._state.send(state_map(record, names, self._settings.epoch_offset_ns))
        for record in records:
            done_ns = record.deadline_ns + int((record.late_us + record.busy_us) * 1e3)
            for recorded in ports_of(record):
                ports[recorded.index].now_in_force(recorded.seq, record.seq, done_ns, self._period_ns)
        self._expect(records[-1])

    def _expect(self, last: TickRecord) -> None:
        """Learn when the next tick ought to be done."""
        took_ns = (last.late_us + last.busy_us) * 1e3
        self._lead_ns += 0.1 * (min(took_ns, 0.5 * self._period_ns) - self._lead_ns)
        self._due_ns = last.deadline_ns + self._period_ns + max(0, int(self._lead_ns) - _EARLY_NS)

    def _pause_s(self, looked_ns: int) -> float:
        """How long to sleep [s].

        Args:
            looked_ns: when the last look for a tick was taken; how late a tick is says that, and not how late we are.
        """
        if not self._state.subscribed:
            return IDLE_S
        left_ns = self._due_ns - time.monotonic_ns()
        if left_ns > 0:
            return left_ns * 1e-9
        return min(max(NAP_S, (looked_ns - self._due_ns) * 1e-10), IDLE_S)

    def _hear(self) -> bool:
        """Go on as the supervisor says, with another list of ports, loop or keys; False when it has gone."""
        said = _settings(self._channel)
        if said is None:
            return False
        before, self._memory = self._memory, _Memory(*said)
        self._serve(said[0])
        self._reported_ns = 0
        before.shared.close()
        return True

    def _report(self, now_ns: int) -> None:
        """Show the supervisor that we live, what was counted, and soon when a client has come or gone."""
        if now_ns - self._reported_ns < SOONEST_S * 1e9:
            return
        owners = self._scene.owners()
        if owners == self._owners and now_ns - self._reported_ns < STATUS_S * 1e9:
            return
        self._reported_ns = now_ns
        self._owners = owners
        ports = list(self._scene.ports.values())
        said: dict[str, Any] = {
            "remote_name": [port.limits.name for port in ports],
            "remote_kind": [port.limits.kind for port in ports],
            "remote_owner": owners,
            "remote_messages": [port.messages for port in ports],
            "remote_refused": [port.refused for port in ports],
            "remote_late": [port.late for port in ports],
            "remote_age_histogram": [count for port in ports for count in port.ages.counts],
            "remote_round_trip_histogram": [count for port in ports for count in port.round_trips.counts],
            "remote_strays": self._scene.strays,
        }
        with contextlib.suppress(BlockingIOError):  # the supervisor stands still; the next one will do
            self._channel.send(msgpack.packb(said), socket.MSG_DONTWAIT)


def main() -> int:
    """Run the remote process; the exit code says how it went."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--socket", type=int, required=True)
    parser.add_argument("--parent", type=int, required=True)
    arguments = parser.parse_args()
    # The supervisor alone decides when this ends: at its own end, which takes the force out first.
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    die_with_parent(arguments.parent, signal.SIGKILL)
    channel = socket.socket(fileno=arguments.socket)
    try:
        try:
            said = _settings(channel)
            if said is None:
                return 1  # the supervisor is gone
            server = _ready(channel, *said)
        except HapticdError as error:
            channel.send(msgpack.packb({"error": str(error)}, unicode_errors="surrogateescape"))
            return error.exit_code
        try:
            server.run()
        finally:
            server.close()
    except ConnectionError:
        return 1  # the supervisor is gone
    return 0


def _settings(channel: socket.socket) -> tuple[RemoteSettings, int] | None:
    """The settings that come next, and the memory with them; None when the supervisor has gone.

    Raises:
        HapticdError: another version of hapticd has sent them.
    """
    packet, descriptors, _, _ = socket.recv_fds(channel, len(SETTINGS), 2)
    if packet != SETTINGS:
        return None
    with os.fdopen(descriptors[0], "rb") as file:
        file.seek(0)
        return unpacked(file.read()), descriptors[1]


def _ready(channel: socket.socket, settings: RemoteSettings, descriptor: int) -> RemoteServer:
    if settings.cpus:  # before ZeroMQ has threads
        with contextlib.suppress(OSError):
            os.sched_setaffinity(0, settings.cpus)
    sleep_exactly()
    raise_descriptor_limit()
    server = RemoteServer(channel, settings, descriptor)
    channel.send(msgpack.packb({"ready": True}))
    gc.collect()
    gc.freeze()
    return server


if __name__ == "__main__":
    sys.exit(main())
