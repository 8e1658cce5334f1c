"""Whoever has no listed key gets nothing, whatever it sends; whoever has one is served as on this computer."""

from __future__ import annotations

import logging
import shlex
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from urllib.parse import urlsplit

import msgpack
import pytest
import zmq
from hypothesis import given
from hypothesis import strategies as st

from hapticd.errors import InstanceError
from hapticd.keys import server
from hapticd.keys.file import Key, new_pair
from hapticd.supervisor.commands import CommandSocket
from tests.daemon.running import wait_until
from tests.examples import examples
from tests.keys.endpoints import Client, Endpoints, ring_of
from tests.telemetry.sockets import PATIENCE_S, ticks

SERVER = new_pair()
LAPTOP = new_pair(SERVER.public)
WALL = replace(new_pair(SERVER.public), watch_only=True)
STRANGER = new_pair(SERVER.public)
DECEIVED = replace(LAPTOP, server=new_pair().public)
ARM = msgpack.packb({"do": "arm"})
HANDSHAKE_BEGINS = b"\xff" + bytes(8) + b"\x7f\x03\x01"


@contextmanager
def served(**clients: Key) -> Iterator[Endpoints]:
    with Endpoints(ring_of(SERVER, **(clients or {"laptop": LAPTOP, "wall": WALL}))) as endpoints:
        yield endpoints


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def publish(endpoints: Endpoints) -> None:
    endpoints.publisher.publish(ticks(20))


def test_a_listed_key_subscribes_and_commands() -> None:
    with served() as endpoints:
        subscriber = endpoints.client(zmq.SUB, endpoints.telemetry, LAPTOP)
        endpoints.turn_until(lambda: subscriber.received() > 0, "the status")
        commander = endpoints.client(zmq.DEALER, endpoints.control, LAPTOP)
        commander.socket.send(ARM)
        endpoints.turn_until(lambda: bool(commander.socket.poll(0)), "an answer")
        assert msgpack.unpackb(commander.socket.recv()) == {"ok": True, "text": "arm"}


@pytest.mark.parametrize("keys", [None, STRANGER, DECEIVED], ids=["no key", "unlisted key", "wrong server key"])
def test_whoever_has_no_listed_key_gets_nothing_and_asks_in_vain(keys: Key | None) -> None:
    with served() as endpoints:
        subscriber = endpoints.client(zmq.SUB, endpoints.telemetry, keys)
        commander = endpoints.client(zmq.DEALER, endpoints.control, keys)
        commander.socket.send(ARM)
        endpoints.turn_until(lambda: subscriber.turned_away() and commander.turned_away(), "two refusals")
        listed = endpoints.client(zmq.SUB, endpoints.telemetry, LAPTOP)
        endpoints.turn_until(lambda: listed.received() > 0, "the status")
        publish(endpoints)
        endpoints.turn_until(lambda: listed.received() > 0, "ticks")
        assert not subscriber.socket.poll(50)
        assert not commander.socket.poll(0)
        assert endpoints.asked == []
        assert not subscriber.came_in()
        assert not commander.came_in()


def test_a_key_that_may_only_watch_does() -> None:
    with served() as endpoints:
        subscriber = endpoints.client(zmq.SUB, endpoints.telemetry, WALL)
        commander = endpoints.client(zmq.DEALER, endpoints.control, WALL)
        commander.socket.send(ARM)
        endpoints.turn_until(commander.turned_away, "a refusal")
        endpoints.turn_until(lambda: subscriber.received() > 0, "the status")
        assert endpoints.asked == []


def test_this_computers_own_sockets_take_no_keys() -> None:
    with served() as endpoints:
        subscriber = endpoints.client(zmq.SUB, f"ipc://{endpoints.directory}/telemetry")
        commander = endpoints.client(zmq.DEALER, f"ipc://{endpoints.directory}/control")
        commander.socket.send(ARM)
        endpoints.turn_until(lambda: endpoints.asked == ["arm"], "the request")
        endpoints.turn_until(lambda: subscriber.received() > 0, "the status")


def test_without_an_answer_about_its_key_nobody_comes_in() -> None:
    """A supervisor that stands still lets nobody in, and serves those that wait when it goes on."""
    with served() as endpoints:
        subscriber = endpoints.client(zmq.SUB, endpoints.telemetry, LAPTOP)
        assert not subscriber.socket.poll(200)
        assert not subscriber.came_in()
        endpoints.turn_until(lambda: subscriber.received() > 0, "the status")


def test_a_key_that_is_removed_is_disconnected_and_the_others_come_back() -> None:
    with served() as endpoints:
        laptop = endpoints.client(zmq.SUB, endpoints.telemetry, LAPTOP)
        wall = endpoints.client(zmq.SUB, endpoints.telemetry, WALL)
        local = endpoints.client(zmq.SUB, f"ipc://{endpoints.directory}/telemetry")
        for client in (laptop, wall, local):
            endpoints.turn_until(partial(client.socket.poll, 0), "the status")
            client.received()
            client.forget()
        endpoints.admit(ring_of(SERVER, laptop=LAPTOP))
        endpoints.turn_until(wall.turned_away, "a refusal")
        endpoints.turn_until(lambda: laptop.came_in() and laptop.received() > 0, "the status again")
        local.received()
        publish(endpoints)
        endpoints.turn_until(lambda: laptop.received() > 0, "ticks through the gate")
        endpoints.turn_until(lambda: local.received() > 0, "ticks beside it")
        wall.received()  # what was on its way when it was disconnected
        publish(endpoints)
        endpoints.turn_until(lambda: laptop.received() > 0, "ticks")
        assert not wall.socket.poll(50)
        assert local.came_in() is False, "a subscriber of this computer was disconnected"


def test_a_key_that_is_added_comes_in_and_nobody_is_disconnected() -> None:
    with served(laptop=LAPTOP) as endpoints:
        laptop = endpoints.client(zmq.SUB, endpoints.telemetry, LAPTOP)
        endpoints.turn_until(lambda: laptop.received() > 0, "the status")
        laptop.forget()
        endpoints.admit(ring_of(SERVER, laptop=LAPTOP, stranger=STRANGER))
        stranger = endpoints.client(zmq.SUB, endpoints.telemetry, STRANGER)
        endpoints.turn_until(lambda: stranger.received() > 0, "the status")
        assert not laptop.came_in()
        publish(endpoints)
        endpoints.turn_until(lambda: laptop.received() > 0, "ticks")


def test_who_commands_the_removal_of_a_key_gets_the_answer() -> None:
    with served() as endpoints:
        commander = endpoints.client(zmq.DEALER, endpoints.control, LAPTOP)
        commander.socket.send(ARM)
        endpoints.granting = lambda: endpoints.admit(ring_of(SERVER, wall=WALL))
        endpoints.turn_until(lambda: bool(commander.socket.poll(0)), "an answer")
        assert msgpack.unpackb(commander.socket.recv()) == {"ok": True, "text": "arm"}
        commander.forget()
        endpoints.turn_until(commander.turned_away, "a refusal")


def test_who_commands_is_known_by_the_name_of_its_key() -> None:
    """S10: the log never said who armed."""
    with served() as endpoints:
        commander = endpoints.client(zmq.DEALER, endpoints.control, LAPTOP)
        for listed in ("laptop", "renamed"):
            endpoints.admit(ring_of(SERVER, **{listed: LAPTOP}))
            commander.socket.send(ARM)
            endpoints.turn_until(partial(commander.socket.poll, 0), "an answer")
            commander.socket.recv()
    assert endpoints.askers == ["laptop at 127.0.0.1", "renamed at 127.0.0.1"]


def test_with_a_new_pair_of_the_daemon_clients_need_its_new_key() -> None:
    with served() as endpoints:
        laptop = endpoints.client(zmq.SUB, endpoints.telemetry, LAPTOP)
        endpoints.turn_until(lambda: laptop.received() > 0, "the status")
        laptop.forget()
        renewed = new_pair()
        endpoints.admit(ring_of(renewed, laptop=LAPTOP))
        endpoints.turn_until(laptop.turned_away, "a refusal")
        again = endpoints.client(zmq.SUB, endpoints.telemetry, replace(LAPTOP, server=renewed.public))
        endpoints.turn_until(lambda: again.received() > 0, "the status")


@pytest.mark.parametrize(
    ("door", "kind", "rights"), [("telemetry", zmq.SUB, " --watch-only"), ("control", zmq.DEALER, "")]
)
def test_a_stranger_is_told_of_once_with_the_command_that_lists_it(
    caplog: pytest.LogCaptureFixture, door: str, kind: int, rights: str
) -> None:
    """S10: who had knocked at telemetry was to be listed with the right to command."""
    with served() as endpoints, caplog.at_level(logging.WARNING, "hapticd"):
        for _ in range(3):
            stranger = endpoints.client(kind, getattr(endpoints, door), STRANGER)
            endpoints.turn_until(stranger.turned_away, "a refusal")
    (line,) = caplog.messages
    assert "refused 127.0.0.1" in line
    assert line.endswith(f"hapticd keys add NAME {shlex.quote(STRANGER.public)}{rights}"), (
        "ready for a shell, whatever is in it"
    )


def test_a_port_that_is_taken_is_named_and_nothing_is_left_behind() -> None:
    with served() as endpoints:
        path = endpoints.directory / "another"
        taken = str(endpoints.commands.endpoint)
        with pytest.raises(InstanceError, match=f"{taken}: Address already in use; set another control.tcp"):
            CommandSocket(path, taken, ring_of(SERVER))
        with pytest.raises(InstanceError, match="takes keys: make them with `hapticd keys make`"):
            CommandSocket(path, "tcp://127.0.0.1:0")
        assert not path.exists()


def greeting(mechanism: bytes) -> bytes:
    """The first 64 bytes of a ZeroMQ connection (ZMTP 3.1)."""
    return HANDSHAKE_BEGINS + mechanism.ljust(20, b"\0") + bytes(32)


def command(body: bytes) -> bytes:
    """A ZMTP command frame, long form."""
    return b"\x06" + len(body).to_bytes(8, "big") + body


BEGINNINGS = st.sampled_from(
    [
        b"",
        HANDSHAKE_BEGINS,
        greeting(b"NULL"),
        greeting(b"PLAIN"),
        greeting(b"CURVE"),
        greeting(b"CURVE") + command(b"\x05HELLO\x01\x00" + bytes(192)),
        greeting(b"CURVE") + command(b"\x08INITIATE" + bytes(200)),
        greeting(b"CURVE") + b"\x06" + b"\xff" * 8,  # a frame of 2^64 - 1 bytes
    ]
)


def test_garbage_at_either_port_disturbs_nobody_and_leaves_no_file_handle() -> None:
    with served() as endpoints:
        laptop = endpoints.client(zmq.SUB, endpoints.telemetry, LAPTOP)
        endpoints.turn_until(lambda: laptop.received() > 0, "the status")
        before = open_files()

        @examples(100)
        @given(st.sampled_from([endpoints.telemetry, endpoints.control]), BEGINNINGS, st.binary(max_size=300))
        def throw(endpoint: str, beginning: bytes, rest: bytes) -> None:
            address = urlsplit(endpoint)
            assert address.hostname is not None
            assert address.port is not None
            with socket.create_connection((address.hostname, address.port)) as raw:
                raw.sendall(beginning + rest)
            endpoints.turn()

        throw()
        endpoints.turn_until(lambda: open_files() <= before, "closed connections")
        publish(endpoints)
        endpoints.turn_until(lambda: laptop.received() > 0, "ticks")
        commander = endpoints.client(zmq.DEALER, endpoints.control, LAPTOP)
        commander.socket.send(ARM)
        endpoints.turn_until(lambda: endpoints.asked == ["arm"], "a request")
        endpoints.turn_until(lambda: bool(commander.socket.poll(0)), "an answer")


def test_whoever_says_nothing_is_disconnected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "_HANDSHAKE_MS", 100)
    with served() as endpoints:
        for endpoint in (endpoints.telemetry, endpoints.control):
            with socket.create_connection(("127.0.0.1", urlsplit(endpoint).port or 0), timeout=PATIENCE_S) as raw:
                while raw.recv(100):
                    pass


def test_whatever_a_listed_client_sends_is_answered() -> None:
    with served() as endpoints:

        @examples(50)
        @given(st.lists(st.binary(max_size=200), min_size=1, max_size=4))
        def is_answered(frames: list[bytes]) -> None:
            commander = endpoints.client(zmq.DEALER, endpoints.control, LAPTOP)
            commander.socket.send_multipart(frames)
            endpoints.turn_until(lambda: bool(commander.socket.poll(0)), "an answer")
            assert set(msgpack.unpackb(commander.socket.recv())) >= {"ok", "text"}
            endpoints.clients.remove(commander)
            commander.close()

        is_answered()


def test_an_address_of_ipv6_takes_keys_as_any_other() -> None:
    context = zmq.Context()
    socket = context.socket(zmq.ROUTER)
    bound = server.CurveServer(socket, "tcp://[::1]:0", SERVER, frozenset({LAPTOP.public}))
    client = Client(context, zmq.DEALER, bound.endpoint, LAPTOP)
    try:
        client.socket.send(ARM)

        def came() -> bool:
            bound.turn()
            return bool(socket.poll(0))

        wait_until(came, "a request")
        assert socket.recv_multipart()[1] == ARM
    finally:
        client.close()
        socket.close(0)
        bound.close()
        context.term()


def test_who_has_shown_no_key_after_ten_seconds_is_disconnected_and_none_comes_in_where_no_one_is_asked() -> None:
    """T6: its questions are closed before its socket is, and between the two lies a moment."""
    context = zmq.Context()
    socket = context.socket(zmq.ROUTER)
    bound = server.CurveServer(socket, "tcp://127.0.0.1:0", SERVER, frozenset({LAPTOP.public}))
    assert socket.getsockopt(zmq.HANDSHAKE_IVL) == 10_000
    bound.close()
    client = Client(context, zmq.DEALER, bound.endpoint, LAPTOP)
    try:
        wait_until(client.turned_away, "a refusal")
    finally:
        client.close()
        socket.close(0)
        context.term()


def test_a_hundred_strangers_are_told_of_and_the_log_grows_no_further(caplog: pytest.LogCaptureFixture) -> None:
    """T6: a stranger has as many keys and addresses as it likes."""
    with zmq.Context() as context, context.socket(zmq.ROUTER) as socket:
        bound = server.CurveServer(socket, "tcp://127.0.0.1:0", SERVER, frozenset())
        with caplog.at_level(logging.WARNING, "hapticd"):
            for number in range(150):
                bound._tell(f"10.0.0.{number}", STRANGER.public)
        bound.close()
    assert len(caplog.records) == 100
    assert "10.0.0.99" in caplog.records[-1].getMessage()


class Reluctant(server.CurveServer):
    """One whose port another program can take.

    Attributes:
        taken: it is taken.
        bound: how often it was bound.
    """

    taken = False
    bound = 0

    def _bind(self) -> None:
        if self.taken:
            raise zmq.ZMQError(zmq.EADDRINUSE)
        super()._bind()
        self.bound += 1


def test_a_port_that_does_not_come_free_is_told_of_once_after_two_hundred_tries(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """T6: ZeroMQ lets go of it a moment later, so that the first tries mean nothing."""
    context = zmq.Context()
    socket = context.socket(zmq.XPUB)
    made = Reluctant(socket, "tcp://127.0.0.1:0", SERVER, frozenset({LAPTOP.public}))

    def told(turns: int) -> int:
        caplog.clear()
        for _ in range(turns):
            made.turn()
        return len([record for record in caplog.records if "no client comes in there" in record.message])

    def bound_again() -> bool:
        made.turn()
        return made.bound == 2

    try:
        for _ in range(2):  # once more when it has been free in between
            made.taken, made.bound = True, 1
            made.renew(new_pair(), frozenset())
            assert [told(199), told(1), told(300)] == [0, 1, 0]
            made.taken = False
            wait_until(bound_again, "the port, which ZeroMQ lets go of in a thread of its own")
    finally:
        socket.close(0)
        made.close()
        context.term()
