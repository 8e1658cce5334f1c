"""Whose connections are ended: those that send while the memory is full, the longest silent, and no other socket's."""

from __future__ import annotations

import contextlib
import mmap
import socket as sockets
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import zmq

from hapticd.keys import connections, memory
from hapticd.keys.connections import ConnectionBound, _Client
from hapticd.keys.memory import Culprits, resident_bytes


@contextlib.contextmanager
def bound_of(most: int, *, keep_heard: bool) -> Iterator[ConnectionBound]:
    with zmq.Context() as context, context.socket(zmq.ROUTER) as socket:
        bound = ConnectionBound(socket, most, keep_heard=keep_heard)
        try:
            yield bound
        finally:
            socket.close(0)
            bound.close()


@contextlib.contextmanager
def listening() -> Iterator[tuple[sockets.socket, sockets.socket, str]]:
    """Both ends of a connection to an endpoint, the one that was taken first."""
    with sockets.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with sockets.create_connection(("127.0.0.1", port)) as client, server.accept()[0] as taken:
            yield taken, client, f"tcp://0.0.0.0:{port}"


def test_what_a_process_takes_is_resident_and_what_it_shares_with_files_is_not_all() -> None:
    before = resident_bytes()
    with mmap.mmap(-1, 64 << 20, flags=mmap.MAP_PRIVATE) as taken:
        for at in range(0, len(taken), mmap.PAGESIZE):
            taken[at] = 1
        assert 60 << 20 < resident_bytes() - before < 72 << 20
    said = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    assert resident_bytes() == pytest.approx(int(said["VmRSS"].split()[0]) << 10, rel=0.05)


def test_the_bound_leaves_room_for_what_the_page_says() -> None:
    page = (Path(__file__).parents[2] / "docs" / "telemetry.md").read_text()
    assert f"has {memory.MOST_MORE_BYTES >> 20} MB more than before its first client" in page


def test_only_those_send_of_whom_something_has_come_that_is_not_read() -> None:
    pairs = [sockets.socketpair() for _ in range(3)]
    try:
        known = [(ours.fileno(), f"ipc://{at}") for at, (ours, _) in enumerate(pairs)]
        assert connections._sending(known) == []
        pairs[1][1].send(b"x")
        assert connections._sending(known) == [known[1]]
        pairs[0][1].send(b"x" * 256)
        assert sorted(connections._sending(known)) == sorted(known[:2])
        gone = (pairs[2][0].fileno(), "ipc://2")
        pairs[2][0].close()
        assert gone not in connections._sending(known)
    finally:
        for pair in pairs:
            for one in pair:
                one.close()


@pytest.mark.parametrize(("culprits", "ended"), [(Culprits.SENDERS, [True, False]), (Culprits.ALL, [True, True])])
def test_while_the_memory_is_full_senders_are_ended_and_then_all(
    culprits: Culprits, ended: list[bool], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with bound_of(9, keep_heard=True) as bound, listening() as one, listening() as two:
        (sender, far, sends_at), (quiet, other, silent_at) = one, two
        far.send(b"x")
        bound._closed.set()
        bound._thread.join()
        bound._endpoints = {sends_at: {sender.fileno(): _Client()}, silent_at: {quiet.fileno(): _Client()}}
        monkeypatch.setattr(bound._memory, "turn", lambda _now_s: culprits)
        bound._looked_s = 0.0
        bound._look_at_memory()
        assert [has_ended(far), has_ended(other)] == ended
        assert [not clients for clients in bound._endpoints.values()] == ended
        told = [record.getMessage() for record in caplog.records]
        assert len(told) == sum(ended)
        assert all("fills the memory; those that send were disconnected" in line for line in told)


def test_the_memory_is_looked_at_every_fifty_milliseconds(monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[float] = []

    def look(now_s: float) -> Culprits:
        looks.append(now_s)
        return Culprits.NO_ONE

    with bound_of(9, keep_heard=True) as bound:
        bound._closed.set()
        bound._thread.join()
        bound._looked_s = 0.0
        monkeypatch.setattr(bound._memory, "turn", look)
        with monkeypatch.context() as clock:
            for at_ms in range(1000, 1206):
                clock.setattr(time, "monotonic", lambda now_s=at_ms / 1e3: now_s)
                bound._look_at_memory()
    assert looks == pytest.approx([1.0, 1.05, 1.1, 1.15, 1.2], abs=1.1e-3)


def has_ended(client: sockets.socket) -> bool:
    client.settimeout(0.2)
    try:
        return client.recv(1) == b""
    except TimeoutError:
        return False


def test_the_longest_silent_goes_where_being_heard_keeps_no_place() -> None:
    """So that there is always a way in; but the newest has had no time to say anything."""
    clients = {number: _Client() for number in (5, 3, 9, 7)}
    with bound_of(3, keep_heard=False) as bound:
        assert bound._victim(clients) == 5
        for heard_s, number in ((1.0, 5), (4.0, 9), (2.0, 3)):
            clients[number].heard_s = heard_s
        assert bound._victim(clients) == 5
        clients[5].heard_s = 5.0
        assert bound._victim(clients) == 3
    with bound_of(3, keep_heard=True) as bound:
        assert bound._victim(clients) == 7, "all others were heard"
        clients[9].heard_s = 0.0
        assert bound._victim(clients) == 9


def test_what_has_the_number_of_a_connection_by_now_is_left_alone() -> None:
    with listening() as (taken, client, endpoint), listening() as (other, _, _):
        connections._shut(other.fileno(), endpoint)
        connections._shut(taken.fileno(), endpoint.replace("tcp", "ipc"))
        assert not has_ended(client)
        connections._shut(taken.fileno(), endpoint)
        assert has_ended(client)
        connections._shut(9999, endpoint)


def test_a_connection_within_this_computer_is_known_by_its_path(tmp_path: Path) -> None:
    path = tmp_path / "socket"
    with sockets.socket(sockets.AF_UNIX) as server, sockets.socket(sockets.AF_UNIX) as client:
        server.bind(str(path))
        server.listen()
        client.connect(str(path))
        with server.accept()[0] as taken:
            connections._shut(taken.fileno(), f"ipc://{path}2")
            assert not has_ended(client)
            connections._shut(taken.fileno(), f"ipc://{path}")
            assert has_ended(client)


def test_who_is_not_known_is_neither_heard_nor_ended_and_who_is_is_ended_once() -> None:
    with bound_of(3, keep_heard=True) as bound, listening() as (taken, client, endpoint):
        bound._endpoints = {endpoint: {taken.fileno(): _Client()}}
        bound.heard(taken.fileno() + 1)
        assert bound._endpoints[endpoint][taken.fileno()].heard_s == 0.0
        before_s = time.monotonic()
        bound.heard(taken.fileno())
        assert before_s <= bound._endpoints[endpoint][taken.fileno()].heard_s <= time.monotonic()
        assert not any(bound.odd(taken.fileno() + 1) for _ in range(2 * connections.MOST_ODD))
        assert not has_ended(client)
        said = [bound.odd(taken.fileno()) for _ in range(connections.MOST_ODD + 3)]
        assert said == [False] * connections.MOST_ODD + [True, False, False], "it is not known any more"
        assert has_ended(client)
