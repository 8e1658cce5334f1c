"""Both doors for clients, with real sockets on TCP: a key opens the one that it is listed for, and no other."""

from __future__ import annotations

import socket
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import msgpack
import pytest
import zmq

from hapticd.errors import InstanceError
from hapticd.keys.connections import MOST_ODD
from hapticd.keys.file import Key, new_pair
from hapticd.keys.store import KeyRing
from hapticd.loop.memory import SharedMemory
from hapticd.loop.remote_slots import SlotReader, SlotWriter
from hapticd.remote.scene_socket import SceneSocket
from hapticd.remote.state_socket import StateSocket
from hapticd.tick.record import RecordLayout
from tests.keys.endpoints import Client, ring_of
from tests.ports import free_port
from tests.remote.heard import TOOL, HeardPort

PATIENCE_S = 20.0
SERVER = new_pair()
DRIVER = new_pair(SERVER.public)
WATCHER = replace(new_pair(SERVER.public), watch_only=True)
RING = ring_of(SERVER, driver=DRIVER, watcher=WATCHER)


class Doors:
    """A scene socket and a state socket, on this computer and on TCP, and what came to the loop."""

    def __init__(self, ring: KeyRing | None = RING) -> None:
        self.directory = Path(tempfile.mkdtemp(prefix="hapticd-"))
        self.scene_tcp, self.state_tcp = (f"tcp://127.0.0.1:{free_port()}" for _ in range(2))
        self.scene = SceneSocket(self.directory / "scene", self.scene_tcp, ring)
        self.state = StateSocket(self.directory / "state", self.state_tcp, ring)
        self.shared = SharedMemory(RecordLayout(1, False, 1), 100.0)
        self.port = HeardPort(TOOL)
        self.loop = SlotReader(self.shared)
        self.loop.serve([self.port], 0)
        self.scene.serve([TOOL], SlotWriter(self.shared, [(TOOL.name, TOOL.kind)]), 3600.0, ("x",), 1000.0)
        self.context = zmq.Context()
        self.clients: list[Client] = []
        self.seq = 0

    def turn(self) -> None:
        self.scene.receive()
        self.scene.turn()
        self.state.turn()
        self.loop.take(0)
        self.seq += 1
        self.state.send({"seq": self.seq})

    def until(self, condition: Callable[[], object]) -> None:
        end_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end_s
            self.turn()
            time.sleep(1e-3)

    def client(self, kind: int, endpoint: str, keys: Key | None = None) -> Client:
        client = Client(self.context, kind, endpoint, keys)
        self.clients.append(client)
        return client

    def driver(self, endpoint: str, keys: Key | None, position_m: float, seq: int = 1) -> Client:
        """One that has said where the target is, or would have."""
        client = self.client(zmq.DEALER, endpoint, keys)
        client.socket.send(msgpack.packb({"name": "tool", "seq": seq, "position_m": [position_m]}))
        return client

    def heard_m(self) -> list[float]:
        return [update.position_m[0] for update in self.port.heard]

    def close(self) -> None:
        for client in self.clients:
            client.close()
        self.context.term()
        self.scene.close()
        self.state.close()
        self.shared.close()
        self.directory.rmdir()


@contextmanager
def opened(ring: KeyRing | None = RING) -> Iterator[Doors]:
    with ExitStack() as stack:
        doors = Doors(ring)
        stack.callback(doors.close)
        yield doors


def test_a_driver_drives_and_watches_and_a_watcher_only_watches() -> None:
    with opened() as doors:
        doors.driver(doors.scene_tcp, DRIVER, 0.01)
        doors.until(lambda: doors.heard_m() == [0.01])
        watching = doors.client(zmq.SUB, doors.state_tcp, WATCHER)
        driving = doors.client(zmq.SUB, doors.state_tcp, DRIVER)
        doors.until(lambda: watching.received() and driving.received())
        doors.scene.serve([TOOL], SlotWriter(doors.shared, [(TOOL.name, TOOL.kind)]), 0.0, ("x",), 1000.0)
        refused = doors.driver(doors.scene_tcp, WATCHER, 0.05)
        doors.until(refused.turned_away)
        assert not refused.came_in()
        assert doors.heard_m() == [0.01]
        assert doors.scene.owners() == [""]


@pytest.mark.parametrize("keys", [None, new_pair(SERVER.public), replace(DRIVER, server=new_pair().public)])
def test_without_a_listed_key_there_is_no_way_in(keys: Key | None) -> None:
    with opened() as doors:
        scene = doors.driver(doors.scene_tcp, keys, 0.05)
        state = doors.client(zmq.SUB, doors.state_tcp, keys)
        doors.until(lambda: scene.turned_away() and state.turned_away())
        assert not state.socket.poll(0)
        assert doors.heard_m() == []


def test_who_is_at_the_door_is_known_by_the_name_of_its_key_or_of_its_process() -> None:
    with opened() as doors:
        doors.driver(doors.scene_tcp, DRIVER, 0.01)
        doors.until(lambda: doors.heard_m() == [0.01])
        assert doors.scene.owners() == ["driver at 127.0.0.1"]
        owner = doors.scene.ports["tool"].owner
        assert owner is not None
        assert not owner.local, "its clock is not ours, wherever it is"
        doors.scene.admit(ring_of(SERVER, renamed=DRIVER, driver=WATCHER))
        doors.scene.ports["tool"].owner = None
        doors.clients[0].socket.send(msgpack.packb({"name": "tool", "seq": 2, "position_m": [0.02]}))
        doors.until(lambda: doors.heard_m() == [0.01, 0.02])
        assert doors.scene.owners() == ["renamed at 127.0.0.1"]


def test_a_key_that_is_listed_no_longer_drives_no_longer() -> None:
    with opened() as doors:
        client = doors.driver(doors.scene_tcp, DRIVER, 0.01)
        watcher = doors.client(zmq.SUB, doors.state_tcp, WATCHER)
        doors.until(lambda: doors.heard_m() == [0.01] and watcher.received())
        client.forget()
        watcher.forget()
        without = ring_of(SERVER, watcher=WATCHER)
        doors.scene.admit(without)
        doors.state.admit(without)
        doors.until(client.turned_away)
        assert not client.came_in()
        assert doors.heard_m() == [0.01]
        doors.until(lambda: watcher.came_in() and watcher.received())


def test_a_door_without_tcp_takes_no_keys_over_and_one_on_tcp_keeps_those_that_it_has() -> None:
    """The list is the same for both doors, of which one may be for this computer alone."""
    with opened() as doors:
        local = SceneSocket(doors.directory / "local", None, RING)
        local.admit(RING)
        local.turn()
        local.close()
        doors.scene.admit(None)
        doors.driver(doors.scene_tcp, DRIVER, 0.01)
        doors.until(lambda: doors.heard_m() == [0.01])
        assert doors.scene.owners() == ["driver at 127.0.0.1"]


def test_on_this_computer_no_key_is_asked_for_and_the_directory_decides() -> None:
    with opened() as doors:
        local = doors.client(zmq.SUB, f"ipc://{doors.directory}/state")
        doors.driver(f"ipc://{doors.directory}/scene", None, 0.03)
        doors.until(lambda: doors.heard_m() == [0.03] and local.received())
        for name in ("scene", "state"):
            mode = (doors.directory / name).stat().st_mode
            assert stat.filemode(mode) == "srw-rw----"
        owner = doors.scene.ports["tool"].owner
        assert owner is not None
        assert owner.local
    assert not doors.directory.exists(), "nothing is left lying about"


@pytest.mark.parametrize(("door", "key"), [(SceneSocket, "remote.scene_tcp"), (StateSocket, "remote.state_tcp")])
def test_a_door_that_cannot_be_opened_says_what_to_change_and_leaves_nothing(
    door: type[SceneSocket | StateSocket], key: str, tmp_path: Path
) -> None:
    path = tmp_path / "door"
    with pytest.raises(InstanceError, match=f"{key} = .*: takes keys: make them with `hapticd keys make`"):
        door(path, f"tcp://127.0.0.1:{free_port()}", None)
    with (
        taken() as endpoint,
        pytest.raises(InstanceError, match=f"{endpoint}: Address already in use; set another {key}"),
    ):
        door(path, endpoint, RING)
    with pytest.raises(InstanceError, match=r"door: No such file or directory$"):
        door(tmp_path / "none" / "door", None, None)
    assert not list(tmp_path.iterdir())
    for _ in range(2):  # what the first has let go of is there for the second
        door(path, None, None).close()
    assert not path.exists()


@contextmanager
def taken() -> Iterator[str]:
    """An endpoint at which there is another socket."""
    with zmq.Context() as context, context.socket(zmq.ROUTER) as socket:
        socket.bind("tcp://127.0.0.1:*")
        yield socket.getsockopt_string(zmq.LAST_ENDPOINT)


def test_there_are_subscribers_from_the_first_to_the_last() -> None:
    with opened() as doors:
        path = f"ipc://{doors.directory}/state"
        assert not doors.state.subscribed
        one, two = doors.client(zmq.SUB, path), doors.client(zmq.SUB, path)
        doors.until(lambda: one.received() and two.received())
        doors.until(lambda: doors.state.subscribed)  # what comes in while a tick is sent is looked at in the next turn
        one.socket.setsockopt(zmq.UNSUBSCRIBE, b"")
        quiet = iter(range(20))
        doors.until(lambda: two.received() and not one.received() and next(quiet, None) is None)
        assert doors.state.subscribed
        two.socket.setsockopt(zmq.UNSUBSCRIBE, b"")
        doors.until(lambda: not doors.state.subscribed)


def test_one_that_ends_what_it_has_never_subscribed_to_takes_nothing_from_the_others() -> None:
    """ZeroMQ tells of the end of a subscription then, as it does of the last one: no subscriber heard anything more."""
    with opened() as doors, socket.socket(socket.AF_UNIX) as raw:
        path = str(doors.directory / "state")
        good = doors.client(zmq.SUB, f"ipc://{path}")
        doors.until(lambda: good.received() and doors.state.subscribed)
        raw.connect(path)
        raw.sendall(b"\xff" + bytes(7) + b"\x01\x7f\x03\x00NULL".ljust(24, b"\0") + bytes(32))  # ZMTP 3.0
        raw.sendall(b"\x04\x19\x05READY\x0bSocket-Type\0\0\0\x03SUB")
        assert len(raw.recv(66, socket.MSG_WAITALL)) == 66  # what is said before it has said hello ends a connection
        raw.sendall(b"\x00\x01\x00" + b"\x00\x04\x01odd" * (MOST_ODD + 1))  # at the last of which it is disconnected
        raw.setblocking(False)
        doors.until(lambda: ended(raw))
        assert doors.state.subscribed
        good.received()
        doors.until(good.received)
        doors.clients.remove(good)
        good.close()
        doors.until(lambda: not doors.state.subscribed)


def ended(raw: socket.socket) -> bool:
    """Whether the other end of a connection has closed it."""
    try:
        return not raw.recv(1 << 16)
    except BlockingIOError:
        return False
    except ConnectionError:
        return True


def test_who_subscribes_to_what_there_is_not_is_disconnected_and_others_are_not() -> None:
    """Each subscription is kept in memory for as long as its client is there."""
    with opened() as doors:
        path = f"ipc://{doors.directory}/state"
        good, bad = doors.client(zmq.SUB, path), Knocking(doors, path)
        doors.until(good.received)
        for number in range(MOST_ODD):
            bad.socket.send(b"\x01%d" % number)
        bad.socket.send(b"\x01")
        doors.until(lambda: bad.socket.poll(0))
        assert not bad.disconnected()
        bad.socket.send(b"\x01one more")
        doors.until(bad.disconnected)
        good.received()
        doors.until(good.received)
        bad.close()


class Knocking:
    """A subscriber that says itself what it subscribes to."""

    def __init__(self, doors: Doors, endpoint: str) -> None:
        self.socket = doors.context.socket(zmq.XSUB)
        self.socket.setsockopt(zmq.LINGER, 0)
        self._news = self.socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)
        self.socket.connect(endpoint)

    def disconnected(self) -> bool:
        return bool(self._news.poll(0))

    def close(self) -> None:
        self.socket.disable_monitor()
        self._news.close(0)
        self.socket.close()


def test_each_door_bounds_what_waits_and_expects_signs_of_life_from_other_computers(tmp_path: Path) -> None:
    """A power cut ends no connection by itself, and what ZeroMQ collects has no bound of its own."""
    bounds = (zmq.MAXMSGSIZE, zmq.RCVHWM, zmq.HEARTBEAT_IVL, zmq.HEARTBEAT_TIMEOUT)
    with opened() as doors:
        sockets = (doors.scene._bound.socket, doors.state._bound.socket)
        assert [[socket.getsockopt(bound) for bound in bounds] for socket in sockets] == [
            [4096, 100, 1000, 4000],
            [1024, 10, 1000, 4000],
        ]
        assert sockets[1].getsockopt(zmq.SNDHWM) == 1000
        assert [socket.context.get(zmq.IO_THREADS) for socket in sockets] == [1, 1]
    local = StateSocket(tmp_path / "state", None, None)
    try:
        assert [local._bound.socket.getsockopt(bound) for bound in bounds[:3]] == [128, 10, 0]
    finally:
        local.close()
