"""A bound on connections: what it promises of ZeroMQ, and whom it drops."""

from __future__ import annotations

import contextlib
import errno
import os
import resource
import socket as sockets
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import zmq

from hapticd.keys import connections
from hapticd.keys.connections import DESCRIPTORS, ConnectionBound, descriptor_of, local_peer
from hapticd.keys.memory import Culprits
from tests.daemon.test_flood import descriptors, flood
from tests.remote.test_no_room import no_descriptor_left
from tests.telemetry.sockets import wait_until

MOST = 20
KNOCKS = 4000


@contextlib.contextmanager
def bounded() -> Iterator[tuple[ConnectionBound, zmq.Socket[bytes], tuple[str, int]]]:
    """A socket with a bound, and where it listens."""
    context = zmq.Context()
    socket = context.socket(zmq.ROUTER)
    bound = ConnectionBound(socket, MOST)
    socket.bind("tcp://127.0.0.1:0")
    port = int(socket.getsockopt_string(zmq.LAST_ENDPOINT).rpartition(":")[2])
    try:
        yield bound, socket, ("127.0.0.1", port)
    finally:
        socket.close(0)
        bound.close()
        context.term()


@contextlib.contextmanager
def knocking(where: tuple[str, int], count: int) -> Iterator[list[sockets.socket]]:
    """Connections that are asked for and not waited for: those that ZeroMQ does not take stay in the kernel."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, min(hard, 2 * count + 500)), hard))
    opened: list[sockets.socket] = []
    try:
        for _ in range(count):
            one = sockets.socket()
            one.setblocking(False)
            one.connect_ex(where)
            opened.append(one)
        yield opened
    finally:
        for one in opened:
            one.close()
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def taken() -> int:
    return descriptors(os.getpid())


def test_nothing_grows_while_the_thread_stands_still() -> None:
    """It is why so many descriptors are enough: ZeroMQ takes no further connection until its news are read."""
    with bounded() as (bound, _, where):
        before = taken()
        bound._lock.acquire()
        try:
            with knocking(where, KNOCKS) as opened:
                held, earlier = taken() - before - len(opened), -1
                while held != earlier:
                    time.sleep(0.5)
                    held, earlier = taken() - before - len(opened), held
        finally:
            bound._lock.release()
        assert MOST < held <= DESCRIPTORS // 4
        wait_until(lambda: taken() <= before, "descriptors again")


def test_the_oldest_that_say_nothing_are_dropped(caplog: pytest.LogCaptureFixture) -> None:
    with bounded() as (_, _, where), flood(where, 2 * MOST) as opened:
        wait_until(lambda: all(ended(one) for one in opened[:MOST]), "the end of the oldest")
        assert not any(ended(one) for one in opened[MOST:])
        wait_until(lambda: "more than 20 connections; the oldest that say nothing are dropped" in caplog.text, "a line")


def test_who_was_heard_stays_and_the_next_oldest_goes() -> None:
    """However many come later."""
    with bounded() as (bound, _, where), sockets.create_connection(where) as first:
        wait_until(lambda: any(bound._endpoints.values()), "news of the connection")
        for descriptor in [descriptor for clients in bound._endpoints.values() for descriptor in clients]:
            bound.heard(descriptor)
        with sockets.create_connection(where) as second, flood(where, 2 * MOST) as opened:
            wait_until(lambda: ended(second) and all(ended(one) for one in opened[:MOST]), "the end of the oldest")
            assert not ended(first)


def test_who_says_what_makes_no_sense_is_dropped_in_the_end_and_no_other() -> None:
    with bounded() as (bound, socket, where), zmq.Context() as context:
        odd, other = (context.socket(zmq.DEALER) for _ in range(2))
        with odd, other:
            for client in (odd, other):
                client.setsockopt(zmq.LINGER, 0)
                client.setsockopt(zmq.RECONNECT_IVL, -1)
                client.connect(f"tcp://{where[0]}:{where[1]}")
            odd.send(b"odd")
            who, frame = socket.recv_multipart(copy=False)
            at = int(frame.get(zmq.SRCFD))  # a message may be there before the news that somebody has connected
            wait_until(lambda: any(at in clients for clients in bound._endpoints.values()), "news of the connection")
            said = [bound.odd(at) for _ in range(connections.MOST_ODD + 1)]
            assert said == [False] * connections.MOST_ODD + [True]
            other.send(b"still here")
            assert socket.recv_multipart()[1] == b"still here"
            assert who.bytes


def test_who_has_left_counts_no_more() -> None:
    with bounded() as (bound, _, where):
        with sockets.create_connection(where), sockets.create_connection(where):
            wait_until(lambda: sum(map(len, bound._endpoints.values())) == 2, "news of both connections")
        wait_until(lambda: not any(bound._endpoints.values()), "news of their ends")


def test_of_an_endpoint_that_is_given_up_nothing_is_kept() -> None:
    """Its port may be bound again, with all its connections to come."""
    with bounded() as (bound, socket, where), sockets.create_connection(where):
        wait_until(lambda: any(bound._endpoints.values()), "news of the connection")
        socket.unbind(socket.getsockopt_string(zmq.LAST_ENDPOINT))
        wait_until(lambda: not any(bound._endpoints.values()), "news of its end")


def test_a_connection_is_shut_also_where_no_descriptor_is_free(tmp_path: Path) -> None:
    """It was left open, in the moment in which most of them have to go."""
    path = tmp_path / "here"
    with sockets.socket(sockets.AF_UNIX) as listening, sockets.socket(sockets.AF_UNIX) as theirs:
        listening.bind(str(path))
        listening.listen()
        theirs.connect(str(path))
        ours, _ = listening.accept()
        with ours, no_descriptor_left():
            connections._shut(ours.fileno(), "ipc:///elsewhere")
            kept = not ended(theirs)
            connections._shut(ours.fileno(), f"ipc://{path}")
            assert kept
            assert ended(theirs)
            assert local_peer(ours.fileno()) == f"user {os.geteuid()}, process {os.getpid()}"
            ours.getsockname()  # its descriptor is ZeroMQ's to close


def test_the_kernel_knows_who_is_at_the_other_end(tmp_path: Path) -> None:
    ours, theirs = sockets.socketpair(sockets.AF_UNIX)
    with ours, theirs:
        assert local_peer(ours.fileno()) == f"user {os.geteuid()}, process {os.getpid()}"
    with (tmp_path / "file").open("w") as file:
        before = taken()
        assert local_peer(file.fileno()) == ""
        assert taken() == before


def test_of_what_came_by_no_connection_none_is_known() -> None:
    assert descriptor_of(zmq.Frame(b"said by this process itself")) == -1


def test_the_memory_is_looked_at_also_while_no_one_comes_or_goes_and_no_thread_is_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What fills it is sent by those who are there already."""
    looks: list[float] = []

    def look(now_s: float) -> Culprits:
        looks.append(now_s)
        return Culprits.NO_ONE

    before = set(threading.enumerate())
    with bounded() as (bound, _, _):
        monkeypatch.setattr(bound._memory, "turn", look)
        wait_until(lambda: len(looks) > 2, "a third look")
    assert set(threading.enumerate()) <= before


def test_a_look_that_fails_ends_no_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without it ZeroMQ stood still once a thousand had come and gone, and no `disarm` was heard any more."""
    looks: list[float] = []

    def look(now_s: float) -> Culprits:
        looks.append(now_s)
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    with bounded() as (bound, _, where):
        monkeypatch.setattr(bound._memory, "turn", look)
        wait_until(lambda: len(looks) > 2, "a third look")
        with sockets.create_connection(where):
            wait_until(lambda: any(bound._endpoints.values()), "news of the connection")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_thread_that_ended_before_its_time_does_not_keep_the_context(monkeypatch: pytest.MonkeyPatch) -> None:
    def look(_now_s: float) -> Culprits:
        raise ZeroDivisionError

    with bounded() as (bound, socket, _):
        monkeypatch.setattr(bound._memory, "turn", look)
        bound._thread.join()
        socket.close(0)
        bound.close()
        closed = bound._news.closed
        bound._news.close(0)  # or the end of the context waits
    assert closed


def test_few_descriptors_are_said_when_no_more_can_be_had(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (1024, 1024))
    monkeypatch.setattr(resource, "setrlimit", lambda *_: None)
    assert "only 1024 file descriptors" in connections.raise_descriptor_limit()
    monkeypatch.setattr(resource, "getrlimit", lambda _: (1024, resource.RLIM_INFINITY))
    assert connections.raise_descriptor_limit() == ""


LIMITS = """
import resource, sys
from hapticd.keys.connections import raise_descriptor_limit
for soft, hard in eval(sys.argv[1]):
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    said = raise_descriptor_limit()
    print(*resource.getrlimit(resource.RLIMIT_NOFILE), said.partition(";")[0], sep="|")
"""
"""What becomes of a process with such limits; a hard one only ever falls."""


@pytest.mark.skipif(resource.getrlimit(resource.RLIMIT_NOFILE)[1] < DESCRIPTORS + 1, reason="too few may be had here")
def test_a_process_gets_as_many_descriptors_as_are_enough_and_no_more() -> None:
    most = DESCRIPTORS
    limits = [(most + 1, most + 1), (1000, most + 1), (most, most), (most - 1, most), (500, 4000), (300, 300)]
    done = subprocess.run(
        [sys.executable, "-c", LIMITS, repr(limits)], check=True, timeout=60.0, text=True, stdout=subprocess.PIPE
    )
    assert done.stdout.splitlines() == [
        f"{most + 1}|{most + 1}|",
        f"{most}|{most + 1}|",
        f"{most}|{most}|",
        f"{most}|{most}|",
        f"4000|4000|only 4000 file descriptors, of {most}: a flood of connections could end the daemon",
        f"300|300|only 300 file descriptors, of {most}: a flood of connections could end the daemon",
    ]


def ended(connection: sockets.socket) -> bool:
    """Whether the other side has closed it; the greeting that ZeroMQ sends first is passed over."""
    connection.setblocking(False)
    try:
        while connection.recv(4096):
            pass
    except BlockingIOError:
        return False
    except ConnectionError:
        return True
    return True


def test_a_program_that_ends_without_closing_the_bound_ends() -> None:
    program = (
        "import zmq; from hapticd.keys.connections import ConnectionBound as B; c = zmq.Context(); b = B(c.socket(6))"
    )
    assert zmq.ROUTER == 6
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60.0)
