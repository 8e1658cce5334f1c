"""What clients say of the scene: a ROUTER, with a lease a name and a bound on everything.

A message is one msgpack map. What is refused is counted and answered, once a second a client at most, and nothing that
arrives can raise. A client whose connection has ended has no lease: the next one may be the same program, started
again.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgpack
import zmq

from hapticd.config.ports import PortLimits
from hapticd.keys.connections import descriptor_of, has_ended, inode_of
from hapticd.keys.frames import FirstFrame, FrameReader
from hapticd.keys.store import KeyRing
from hapticd.loop.remote_slots import SlotWriter
from hapticd.remote.bound_socket import BoundSocket
from hapticd.remote.leased_port import LeasedPort, NotTakenError, Sender
from hapticd.remote.message import WrongMessageError
from hapticd.remote.refusals import Refusal, Refusals

SCHEMA = 1
"""Version of what scene and state sockets speak; goes up only when a key changes its meaning or goes."""

MOST_AT_ONCE = 50
"""Messages of a turn: behind them a tick may wait to be told."""

_LARGEST_MESSAGE = 1 << 12  # bytes
_MOST_UNREAD = 100  # messages of a client


class SceneSocket:
    """The scene socket.

    Args:
        path: where it lies.
        tcp: its TCP endpoint; None for none.
        ring: the keys that this takes.

    Attributes:
        ports: by their names, in the order of the scene.
        strays: messages that made no sense or named no port.
        descriptor: readable when something may have come; only then, so look before waiting for it.

    Raises:
        InstanceError: it cannot be bound.
    """

    def __init__(self, path: Path, tcp: str | None, ring: KeyRing | None) -> None:
        self.ports: dict[str, LeasedPort] = {}
        self.strays = 0
        self._bound = BoundSocket(
            zmq.ROUTER,
            path,
            None if tcp is None else (tcp, "remote.scene_tcp"),
            ring,
            watch_only=False,
            largest=_LARGEST_MESSAGE,
            unread=_MOST_UNREAD,
            # A client that lost its connection and says who it is has its name back at once.
            options={zmq.ROUTER_HANDOVER: 1},
        )
        self._frames = FrameReader(self._bound.socket)
        self.descriptor = int(self._bound.socket.getsockopt(zmq.FD))
        self._slots: dict[str, int] = {}
        self._writer: SlotWriter | None = None
        self._axes: tuple[str, ...] = ()
        self._hello: dict[str, Any] = {}
        self._refusals = Refusals(self._refuse)

    def serve(
        self, limits: Sequence[PortLimits], writer: SlotWriter, lease_s: float, axes: tuple[str, ...], rate_hz: float
    ) -> None:
        """Go on with these ports; one that was there keeps its owner and what was said.

        The first time what another process has heard before is known: a client that comes back goes on with that.

        Args:
            limits: the ports, in the order of the scene.
            writer: where to hand on what is said.
            lease_s: how long a client that says nothing keeps a name [s].
            axes: of the device.
            rate_hz: ticks a second [Hz].
        """
        before = self.ports
        self.ports = {}
        for index, each in enumerate(limits):
            port = before.get(each.name)
            if port is None or port.limits.kind != each.kind:
                port = LeasedPort(each, lease_s, writer.written(index) if self._writer is None else None)
            port.limits = each
            port.lease_s = lease_s
            self.ports[each.name] = port
        self._slots = {each.name: index for index, each in enumerate(limits)}
        self._writer = writer
        self._axes = axes
        self._hello = {
            "ok": True,
            "schema": SCHEMA,
            "rate_hz": rate_hz,
            "axes": list(axes),
            "lease_s": lease_s,
            "ports": [asdict(each) for each in limits],
        }

    def admit(self, ring: KeyRing | None) -> None:
        """Take other keys over."""
        self._bound.admit(ring)

    def turn(self) -> None:
        """Let those in who have a key, and tell refusals that have waited. Returns at once."""
        self._bound.turn()
        self._refusals.turn(time.monotonic_ns())

    def owners(self) -> list[str]:
        """Whom each port belongs to now, for people; "" where there is no one."""
        now_ns = time.monotonic_ns()
        found = []
        for port in self.ports.values():
            owner = port.owner_at(now_ns)
            if owner is not None and has_ended(owner.descriptor, owner.inode):
                port.owner = owner = None
            found.append(owner.name if owner is not None else "")
        return found

    def receive(self) -> bool:
        """Take what has come, at most `MOST_AT_ONCE` messages; whether more may wait."""
        for _ in range(MOST_AT_ONCE):
            message = self._frames.read() if self._bound.waits() else None
            if message is None:
                return self._bound.waits()
            self._take(message)
        return True

    def close(self) -> None:
        """Let go of the path."""
        self._bound.close()

    def _take(self, message: FirstFrame) -> None:
        now_ns = time.monotonic_ns()
        identity, frame, single = message
        descriptor = descriptor_of(frame)
        fields = _decoded(frame.bytes) if single else None
        if fields is None:
            self.strays += 1
            self._bound.connections.odd(descriptor)
            self._refusals.add(identity, Refusal("", "a message is one msgpack map with texts as keys"), now_ns)
            return
        self._bound.connections.heard(descriptor)
        if "hello" in fields:
            self._send(identity, self._hello)
            return
        name = fields.get("name")
        port = self.ports.get(name) if isinstance(name, str) else None
        if port is None:
            self.strays += 1
            text = f"no such name in the scene; there is {', '.join(self.ports) or 'nothing'}"
            self._refusals.add(identity, Refusal(str(name)[:40], text), now_ns)
            return
        sender = self._sender(port, identity, descriptor, frame)
        if fields.get("release") is not True and has_ended(sender.descriptor, sender.inode):
            port.late += 1  # it waited, and who said it has gone
            return
        try:
            if port.take(fields, sender, len(self._axes), now_ns):
                self._write(port)
            self._refusals.taken(identity, port.limits.name)
        except NotTakenError as error:
            port.refused += 1
            self._refusals.add(identity, Refusal(port.limits.name, str(error), passing=True), now_ns)
        except WrongMessageError as error:
            port.refused += 1
            self._refusals.add(identity, Refusal(port.limits.name, str(error), error.key), now_ns)

    def _sender(self, port: LeasedPort, identity: bytes, descriptor: int, frame: zmq.Frame) -> Sender:
        """Who sent a message; looked up only where it is not the owner of its port, whom we know.

        An owner whose connection is another one's by now, or is closed, has gone, and so has its lease.
        """
        owner = port.owner
        if owner is not None and owner.identity == identity and owner.descriptor == descriptor:
            return owner
        if (
            owner is not None
            and owner.identity != identity
            and (owner.descriptor == descriptor or has_ended(owner.descriptor, owner.inode))
        ):
            port.owner = None
        local, name = self._bound.peer(frame)
        return Sender(identity, descriptor, inode_of(descriptor), local, name)

    def _write(self, port: LeasedPort) -> None:
        assert self._writer is not None
        self._writer.write(self._slots[port.limits.name], port.update)

    def _refuse(self, identity: bytes, refusal: Refusal) -> None:
        self._send(identity, {"ok": False, "name": refusal.name, "text": refusal.text, "key": refusal.key})

    def _send(self, identity: bytes, answer: Mapping[str, Any]) -> None:
        with contextlib.suppress(zmq.ZMQError):  # who is answered has gone
            self._bound.socket.send_multipart((identity, msgpack.packb(answer)), zmq.NOBLOCK)


def _decoded(sent: bytes) -> dict[str, Any] | None:
    """The map in these bytes; None when there is none."""
    try:
        said = msgpack.unpackb(sent)
    except Exception:  # noqa: BLE001 - msgpack has many ways to say that bytes make no sense
        return None
    return said if isinstance(said, dict) and all(isinstance(key, str) for key in said) else None
