"""Drive something in the scene of a running daemon, and answer what the device does.

    with hapticd.connect() as daemon, daemon.remote("tool") as tool:
        while True:
            state = tool.state()
            tool.move(position_m=[0.01 * math.sin(6.28 * state.timestamp)])

The protocol behind it is docs/remote.md; any language with ZeroMQ and msgpack can do the same.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import msgpack
import zmq

from hapticd.client.commands import TIMEOUT_S, RefusedError
from hapticd.errors import ClientError, EndpointError, SchemaError, SilenceError
from hapticd.keys.client import ENVIRONMENT, CurveClient, RefusedKeyError, client_keys

SCHEMA = 1
"""Version of the protocol that this client speaks."""

LONGEST_MEAN_S = 0.5
"""A mean force is taken over no more than this; after a longer pause the force now stands for it [s]."""

_LAST_WORDS_MS = 200
_LARGEST_MESSAGE = 1 << 16
_SCALARS = ("stiffness_n_per_m", "damping_n_s_per_m")
_MOTION = ("position_m", "velocity_m_per_s", "orientation", "angular_velocity_rad_per_s")


@dataclass(frozen=True, slots=True)
class DrivenState:
    """What a coupling, a force or an object that clients drive did in one tick.

    Attributes:
        force_n: its force on the device, one element an axis [N].
        impulse_n_s: what pulls at the target, summed over time since the daemon has it [N s].
        since_ns: since when that is, on the daemon's CLOCK_MONOTONIC; another number: the sum began anew [ns].
        target_m: where the target or the object was in this tick, behind what was sent for it by the limits [m].
        seq: the client's number of the message in force; -1 when there is none.
        age_s: how old what it says was: since it was sent, or the daemon took it where that is not known [s].
        state: `idle`, `held` and the like: docs/remote.md has them all.
        work_j: what moving it has put into its spring so far [J].
    """

    force_n: tuple[float, ...]
    impulse_n_s: tuple[float, ...]
    target_m: tuple[float, ...]
    seq: int
    age_s: float
    state: str
    work_j: float
    since_ns: int = 0


@dataclass(frozen=True, slots=True)
class RemoteState:
    """The device in one tick, and what was driven in it.

    Attributes:
        seq: number of the tick.
        timestamp: seconds since the epoch at which it was due [s].
        deadline_ns: the same on the daemon's CLOCK_MONOTONIC [ns].
        dt_s: time since the tick before [s].
        armed: forces are let through.
        position_m, velocity_m_per_s, force_n: of the device, one element an axis; the force of everything on it.
        buttons: bit i is button i.
        orientation: rotation matrix of a wrist, row by row; empty without one.
        port: what this client drives; None in the moment after a reload in which the daemon does not tell.
        ports: everything that clients drive, by name.
    """

    seq: int
    timestamp: float
    deadline_ns: int
    dt_s: float
    armed: bool
    position_m: tuple[float, ...]
    velocity_m_per_s: tuple[float, ...]
    force_n: tuple[float, ...]
    buttons: int
    orientation: tuple[float, ...]
    port: DrivenState | None
    ports: dict[str, DrivenState]


class RemotePort:
    """Something in the scene that this client drives, made by `DaemonClient.remote`.

    What is sent belongs to this client as long as it goes on sending; leaving the `with` lets go. Sending never blocks,
    and of what waits to be sent the latest wins. Every message says everything that was said before, so that none is
    missed. The daemon may be restarted: ZeroMQ connects again by itself. One thread at a time may use it.

    Args:
        name: of the object, coupling or force.
        scene: endpoint to send to.
        state: endpoint to hear from.
        keys: key file for a daemon on another computer.

    Attributes:
        name: of what it drives.
        kind: `object`, `coupling` or `force`.
        axes: names of the device's axes, in the order of every vector.
        limits: of it, as the configuration has them: hold_s, max_force_n and more.
        seq: number of the last message sent, 0 before the first.

    Raises:
        ClientError: the scene has no such name, an endpoint cannot be used, or it is used after `close`.
        RefusedKeyError: the daemon does not list this key.
        SchemaError: the daemon speaks another version of the protocol.
        SilenceError: nothing answers.
    """

    def __init__(self, name: str, scene: str, state: str, keys: Path | str | None = None) -> None:
        own = client_keys(scene, keys)
        if own is None and scene.startswith("tcp://"):
            raise RefusedKeyError(f"{scene}: takes keys: name your key file with keys= or ${ENVIRONMENT}")
        self.name = name
        self.seq = 0
        self._endpoint = scene
        self._said: dict[str, Any] = {}
        self._moved_seq = 0  # of the message that said last how it moves
        self._newest: RemoteState | None = None
        self._since: RemoteState | None = None
        self._mean_n: tuple[float, ...] = ()
        self._context = zmq.Context(io_threads=1)
        self._sending = self._socket(zmq.DEALER, _LAST_WORDS_MS)
        # By which the daemon knows this client again when the connection was lost.
        self._sending.setsockopt(zmq.ROUTING_ID, b"\x01" + os.urandom(15))
        self._hearing = self._socket(zmq.SUB, 0)
        self._hearing.setsockopt(zmq.SUBSCRIBE, b"")
        self._to_scene = CurveClient(self._sending, scene, own)
        self._from_state = CurveClient(self._hearing, state, client_keys(state, keys))
        try:
            self._to_scene.connect()
            self._from_state.connect()
            hello = self._hello()
        except zmq.ZMQError as error:
            self._close()
            raise EndpointError(f"{scene}: {error.strerror}; an endpoint is ipc://PATH or tcp://HOST:PORT") from error
        except BaseException:
            self._close()
            raise
        self.axes: tuple[str, ...] = tuple(hello["axes"])
        self.limits: dict[str, Any] = next(port for port in hello["ports"] if port["name"] == name)
        self.kind: str = self.limits["kind"]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def state(self, timeout_s: float = 1.0) -> RemoteState:
        """The newest state, newer than the one before; waits for it.

        Args:
            timeout_s: how long [s].

        Raises:
            RefusedError: the daemon has refused what was sent.
            SilenceError: none came.
        """
        self._look()
        if not self._from_state.wait(timeout_s):
            raise SilenceError(f"{self._endpoint}: no state for {timeout_s:g} s{self._from_state.doubt}")
        return self._take()

    def move(
        self,
        position_m: Sequence[float],
        velocity_m_per_s: Sequence[float] | None = None,
        orientation: Sequence[float] | None = None,
        angular_velocity_rad_per_s: Sequence[float] | None = None,
    ) -> None:
        """Say where the target or the object is now.

        Args:
            position_m: one element an axis of the device, three for an object [m].
            velocity_m_per_s: with which it moves on until the next message; None: it stands still [m/s].
            orientation: of an object, a quaternion w x y z.
            angular_velocity_rad_per_s: with which it turns on, in the frame of the world [rad/s].

        Raises:
            RefusedError: the daemon has refused something sent before.
            ValueError: what is to be numbers is not.
        """
        self._say(
            moves=True,
            position_m=position_m,
            velocity_m_per_s=velocity_m_per_s,
            orientation=orientation,
            angular_velocity_rad_per_s=angular_velocity_rad_per_s,
        )

    def push(self, force_n: Sequence[float]) -> None:
        """Say what force the device is to feel.

        Args:
            force_n: one element an axis [N]; the daemon scales down what is beyond the limit.

        Raises:
            RefusedError: the daemon has refused something sent before.
            ValueError: what is to be numbers is not.
        """
        self._say(force_n=force_n)

    def change(self, stiffness_n_per_m: float | None = None, damping_n_s_per_m: float | None = None) -> None:
        """Change the spring and the damper; the daemon blends from what they were.

        Args:
            stiffness_n_per_m: at most what the configuration has [N/m]; None: as it is.
            damping_n_s_per_m: at most what the configuration has [N s/m]; None: as it is.

        Raises:
            RefusedError: the daemon has refused something sent before.
            ValueError: what is to be numbers is not.
        """
        said = {"stiffness_n_per_m": stiffness_n_per_m, "damping_n_s_per_m": damping_n_s_per_m}
        self._say(**{**self._said, **{key: value for key, value in said.items() if value is not None}})

    def mean_force_n(self) -> tuple[float, ...]:
        """Its force on the device, one element an axis, the mean since this was called last [N].

        A simulator applies the opposite to its own body: over a step of its time that is what the device got. The time
        is that up to the newest state; without a newer one the mean is the same again.

        Raises:
            RefusedError: the daemon has refused what was sent.
            SilenceError: there is no state.
        """
        self._need_open()
        if self._newest is None:
            self.state()
        elif self._from_state.wait(0.0):
            self._take()
        now, since = self._newest, self._since
        if now is None or now.port is None or now is since:
            return self._mean_n or (0.0,) * len(self.axes)
        self._since = now
        self._mean_n = now.port.force_n
        span_s = (now.deadline_ns - since.deadline_ns) * 1e-9 if since and since.seq < now.seq else 0.0
        if since and since.port and since.port.since_ns == now.port.since_ns and 0.0 < span_s <= LONGEST_MEAN_S:
            pairs = zip(now.port.impulse_n_s, since.port.impulse_n_s, strict=True)
            self._mean_n = tuple((after - before) / span_s for after, before in pairs)
        return self._mean_n

    def release(self) -> None:
        """Let go: the daemon ramps its force out, and another client may have it."""
        self._need_open()
        self._said = {}
        self._sending.send(msgpack.packb({"name": self.name, "release": True}), zmq.NOBLOCK)

    def close(self) -> None:
        """Let go and disconnect. May be called twice."""
        if not self._sending.closed:
            if self.seq:
                self.release()
            self._close()

    def _socket(self, kind: int, linger_ms: int) -> zmq.Socket[bytes]:
        socket: zmq.Socket[bytes] = self._context.socket(kind)
        socket.setsockopt(zmq.CONFLATE, 1)  # the latest message, either way
        socket.setsockopt(zmq.LINGER, linger_ms)
        socket.setsockopt(zmq.MAXMSGSIZE, _LARGEST_MESSAGE)
        return socket

    def _close(self) -> None:
        self._to_scene.close(_LAST_WORDS_MS)
        self._from_state.close()
        self._context.term()

    def _hello(self) -> dict[str, Any]:
        self._sending.send(msgpack.packb({"hello": True}))
        if not self._to_scene.wait(TIMEOUT_S):
            raise SilenceError(f"{self._endpoint}: no daemon answers{self._to_scene.doubt}")
        hello: dict[str, Any] = msgpack.unpackb(self._sending.recv())
        if hello.get("schema") != SCHEMA:
            raise SchemaError(
                f"{self._endpoint}: speaks schema {hello.get('schema')}, this client {SCHEMA}; install the release "
                "that the daemon runs"
            )
        names = [port["name"] for port in hello["ports"]]
        if self.name not in names:
            raise ClientError(f'{self._endpoint}: no "{self.name}" in the scene; there is {", ".join(names)}')
        return hello

    def _say(self, *, moves: bool = False, **values: Any) -> None:
        self._look()
        self._said.update((key, _numbers(key, value)) for key, value in values.items() if value is not None)
        for key in [key for key, value in values.items() if value is None]:
            self._said.pop(key, None)
        self.seq += 1
        if moves:
            self._moved_seq = self.seq
        message = {"name": self.name, "seq": self.seq, "sent_ns": time.monotonic_ns(), **self._said}
        if 0 < self._moved_seq < self.seq:
            message["moved_seq"] = self._moved_seq
        if self._newest is not None:
            message["state_seq"] = self._newest.seq
        self._sending.send(msgpack.packb(message), zmq.NOBLOCK)

    def _need_open(self) -> None:
        if self._sending.closed:
            raise ClientError(f"{self.name}: was let go and is closed; open it again with daemon.remote({self.name!r})")

    def _look(self) -> None:
        """See whether the daemon has refused something."""
        self._need_open()
        if self._to_scene.wait(0.0):
            answer = msgpack.unpackb(self._sending.recv())
            if not answer["ok"]:
                key = answer.get("key")
                for each in _MOTION if key in _MOTION else (key,):  # a velocity says nothing without its place
                    self._said.pop(each, None)  # or all that is said from now on would be refused with it
                raise RefusedError(f"{self.name}: {answer['text']}")

    def _take(self) -> RemoteState:
        fields = msgpack.unpackb(self._hearing.recv(), use_list=False)
        ports = {name: DrivenState(**_known(DrivenState, port)) for name, port in fields.pop("ports").items()}
        known = {"orientation": (), **_known(RemoteState, fields), "port": ports.get(self.name), "ports": ports}
        self._newest = RemoteState(**known)
        return self._newest


def _numbers(key: str, value: Any) -> list[float] | float:
    """A vector or a number of any kind, as of numpy or torch, in those that a message is made of.

    Raises:
        ValueError: it is neither.
    """
    wanted = "a number" if key in _SCALARS else "a list of numbers"
    try:
        return float(value) if key in _SCALARS else [float(each) for each in value]
    except (TypeError, ValueError):
        raise ValueError(f"{key} = {value!r}: must be {wanted}") from None


def _known(kind: type[Any], fields: dict[str, Any]) -> dict[str, Any]:
    """The keys that this client knows; a newer daemon may send more."""
    return {key: value for key, value in fields.items() if key in kind.__dataclass_fields__}
