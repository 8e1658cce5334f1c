"""What one client sends without an end fills no memory, and keeps no one else away."""

from __future__ import annotations

import contextlib
import os
import socket
import struct
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import msgpack
import pytest
import zmq

from hapticd.client.commands import command
from hapticd.keys.connections import MOST_CONNECTIONS
from tests.daemon.running import PATIENCE_S, Daemon, Subscriber, wait_until
from tests.remote.stage import CONFIG, remote_pid
from tests.remote.test_life import classes

LARGEST_MB = 450.0
"""Of the 512 MB that the unit allows; connections are ended at some 160, and a busy computer ends them later."""

MOST_HELD = 200 << 20
"""What each client would fill, were it not stopped: three of them more than the unit allows [bytes]."""

CASES = (("control", b"DEALER", 0), ("telemetry", b"SUB", 0), ("scene", b"DEALER", 2000))
SENDERS = 3
FILLS_PER_S = 32e6
"""By each of them: as fast as it can, and what is held would say how busy the computer is [bytes/s]."""

FRAME_COSTS = 64
"""ZeroMQ keeps this for each, whatever is in it [bytes]."""


@pytest.fixture(scope="module")
def daemon() -> Iterator[Daemon]:
    with Daemon(CONFIG) as daemon, pytest.MonkeyPatch.context() as patch:
        patch.setenv("HAPTICD_RUNTIME_DIR", str(daemon.directory / "run"))
        yield daemon.wait_ready()


def connected(daemon: Daemon, endpoint: str, kind: bytes) -> socket.socket:
    """A connection to a socket of the daemon that has said hello as ZeroMQ does (ZMTP 3.1, NULL), and heard its hello.

    What came before ZeroMQ has said its own is no message to it, and ends the connection at once.
    """
    raw = socket.socket(socket.AF_UNIX)
    raw.settimeout(PATIENCE_S)
    raw.connect(str(daemon.directory / "run/default" / endpoint))
    said = b"\x05READY\x0bSocket-Type" + struct.pack(">I", len(kind)) + kind
    raw.sendall(b"\xff" + bytes(7) + b"\x01\x7f\x03\x01NULL".ljust(24, b"\0") + bytes(32))
    raw.sendall(b"\x04" + bytes([len(said)]) + said)
    heard(raw, 64)
    heard(raw, heard(raw, 2)[1])
    return raw


def heard(raw: socket.socket, size: int) -> bytes:
    """The next so many bytes of a connection."""
    said = b""
    while len(said) < size:
        piece = raw.recv(size - len(said))
        assert piece, "the connection was ended"
        said += piece
    return said


def send_until_ended(raw: socket.socket, size: int) -> None:
    """Frames of one message, each followed by more; then wait for the end of the connection."""
    frame = b"\x03" + struct.pack(">Q", size) + bytes(size) if size > 255 else bytes([1, size]) + bytes(size)
    frames = max(1, (1 << 16) // len(frame))
    with contextlib.suppress(ConnectionError):
        for _ in range(MOST_HELD // (frames * (size + FRAME_COSTS))):
            raw.sendall(frame * frames)
            time.sleep(frames * (size + FRAME_COSTS) / FILLS_PER_S)
        while raw.recv(1 << 16):
            pass


def peak_mb(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1]) / 1024.0


@pytest.mark.parametrize(("endpoint", "kind", "size"), CASES)
def test_a_message_without_an_end_is_ended_before_it_fills_the_memory(
    daemon: Daemon, endpoint: str, kind: bytes, size: int
) -> None:
    """S10: frames of one message peaked at 590 MB; 28 MB of empty ones took 880."""
    pid = remote_pid(daemon) if endpoint == "scene" else daemon.process.pid
    command("arm")
    with contextlib.ExitStack() as held:
        raws = [held.enter_context(connected(daemon, endpoint, kind)) for _ in range(SENDERS)]
        senders = [threading.Thread(target=send_until_ended, args=(raw, size)) for raw in raws]
        with Subscriber(daemon.endpoint, "hapticd/status") as subscriber:
            for sender in senders:
                sender.start()
            asked_s = time.monotonic()
            command("disarm", timeout_s=PATIENCE_S)
            answered_s = time.monotonic() - asked_s
            for sender in senders:
                sender.join(PATIENCE_S)
            assert not any(sender.is_alive() for sender in senders), "a connection that was not ended"
            subscriber.until("hapticd/status", armed=False)
    sys.stdout.write(f"disarm answered after {1e3 * answered_s:.0f} ms; at most {peak_mb(pid):.0f} MB\n")
    assert peak_mb(pid) < LARGEST_MB
    if endpoint != "telemetry":  # that has ended them for what they say, or for what it takes
        wait_until(lambda: f"{endpoint}: what clients have sent fills the memory" in daemon.output(), "the log")
    assert command("status")["ok"]


def test_of_a_message_of_many_frames_the_first_is_refused_and_the_next_message_answered(daemon: Daemon) -> None:
    with zmq.Context() as context, context.socket(zmq.DEALER) as client:
        client.setsockopt(zmq.LINGER, 0)
        client.connect(f"ipc://{daemon.directory}/run/default/control")
        client.send_multipart([msgpack.packb({"do": "stop"})] * 20_000)
        client.send(msgpack.packb({"do": "status"}))
        answers = []
        for _ in range(2):
            assert client.poll(int(PATIENCE_S * 1e3))
            answers.append(msgpack.unpackb(client.recv()))
    assert [answer["ok"] for answer in answers] == [False, True]
    assert "one msgpack map" in answers[0]["text"]


def test_programs_that_leave_their_connections_open_do_not_keep_disarm_away(daemon: Daemon) -> None:
    """A script that makes one anew for each request: with 256 that had asked something, the next was dropped."""
    with zmq.Context(io_threads=1) as context, contextlib.ExitStack() as held:
        context.setsockopt(zmq.MAX_SOCKETS, MOST_CONNECTIONS + 100)
        for _ in range(MOST_CONNECTIONS + 10):
            client = held.enter_context(context.socket(zmq.DEALER))
            client.setsockopt(zmq.LINGER, 0)
            client.setsockopt(zmq.RECONNECT_IVL, -1)
            client.connect(f"ipc://{daemon.directory}/run/default/control")
            client.send(msgpack.packb({"do": "status"}))
            assert client.poll(int(PATIENCE_S * 1e3))
        command("disarm", timeout_s=PATIENCE_S)


def heard_as(daemon: Daemon) -> set[int]:
    """Scheduling classes of the process that hears clients; none while one that stood still is started again."""
    try:
        return classes(remote_pid(daemon))
    except OSError:  # the process has ended
        return set()


def test_a_flood_that_never_becomes_a_message_does_not_keep_a_processor_at_real_time(daemon: Daemon) -> None:
    """Signs of life, which ZeroMQ answers by itself: the process that hears clients would see nothing of them."""
    before = heard_as(daemon)
    assert before
    over = threading.Event()

    def ping(raw: socket.socket) -> None:
        with contextlib.suppress(PermissionError):  # senders that get no processor time are no flood
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), -10)
        with contextlib.suppress(OSError):
            while not over.is_set():
                raw.sendall(b"\x04\x07\x04PING\0\0" * 6000)

    def pong(raw: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while not over.is_set() and raw.recv(1 << 20):
                pass

    with contextlib.ExitStack() as held:
        raws = [held.enter_context(connected(daemon, "scene", b"DEALER")) for _ in range(SENDERS)]
        threads = [threading.Thread(target=say, args=(raw,)) for raw in raws for say in (ping, pong)]
        for thread in threads:
            thread.start()
        try:
            wait_until(lambda: heard_as(daemon) == {os.SCHED_OTHER}, "an ordinary process")
        finally:
            over.set()
            for raw in raws:
                with contextlib.suppress(OSError):  # it was ended
                    raw.shutdown(socket.SHUT_RDWR)
            for thread in threads:
                thread.join()
    wait_until(lambda: heard_as(daemon) == before, "the flood to be over")
