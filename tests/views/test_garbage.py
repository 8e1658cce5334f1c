"""Any bytes at every door of a daemon and of the programs beside it: all live, and no subscriber misses a tick."""

from __future__ import annotations

import contextlib
import re
import socket
import struct
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.client.commands import command
from hapticd_views.knocking import MOST_WAITING
from tests.daemon.running import HAPTICD, PATIENCE_S, Daemon, Subscriber, wait_until
from tests.daemon.test_flood import descriptors, flood, resident_mb
from tests.examples import examples
from tests.ports import free_port
from tests.remote.stage import remote_pid
from tests.views.dashboard.served import Served as Dashboard
from tests.views.gateway.served import Served as Gateway
from tests.views.gateway.test_pushing import CONFIG

LARGEST_MB = 150.0
"""Of what the service may take 512, and a page's server of 64 MB of history besides what it is itself."""

HALF_OPEN = 20
"""Connections on which something was begun, and which are kept."""

DOORS = ("control", "telemetry", "scene", "state", "port", "metrics", "dashboard", "gateway")


@dataclass
class Door:
    """Where something listens, and the process that does."""

    where: tuple[str, int] | str
    pid: int

    def knock(self) -> socket.socket:
        raw = socket.socket(socket.AF_UNIX if isinstance(self.where, str) else socket.AF_INET)
        raw.settimeout(PATIENCE_S)
        raw.connect(self.where)
        return raw


@contextlib.contextmanager
def metrics() -> Iterator[Door]:
    listening = [HAPTICD, "metrics", "--listen", "127.0.0.1:0"]
    with subprocess.Popen(listening, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            assert process.stdout is not None
            said = process.stdout.readline()
            port = re.search(r":(\d+)/metrics", said)
            assert port, said
            yield Door(("127.0.0.1", int(port[1])), process.pid)
        finally:
            process.terminate()


@pytest.fixture(scope="module")
def house() -> Iterator[tuple[Daemon, dict[str, Door]]]:
    port = free_port()
    with (
        Daemon(f'{CONFIG}[telemetry]\ntcp = "tcp://127.0.0.1:{port}"\n') as daemon,
        pytest.MonkeyPatch.context() as patch,
        contextlib.ExitStack() as beside,
    ):
        daemon.wait_ready()
        run = daemon.directory / "run"
        patch.setenv("HAPTICD_RUNTIME_DIR", str(run))
        dashboard = beside.enter_context(Dashboard(run))
        gateway = beside.enter_context(Gateway(run))
        doors = {name: Door(str(run / "default" / name), daemon.process.pid) for name in ("control", "telemetry")}
        doors |= {name: Door(str(run / "default" / name), remote_pid(daemon)) for name in ("scene", "state")}
        doors["port"] = Door(("127.0.0.1", port), daemon.process.pid)
        doors["metrics"] = beside.enter_context(metrics())
        doors["dashboard"] = Door(("127.0.0.1", dashboard.port), dashboard.process.pid)
        doors["gateway"] = Door(("127.0.0.1", gateway.port), gateway.process.pid)
        yield daemon, doors


def zmtp(kind: bytes) -> bytes:
    """What a client of ZeroMQ says before its first message (ZMTP 3.1, NULL)."""
    ready = b"\x05READY\x0bSocket-Type" + struct.pack(">I", len(kind)) + kind
    return (
        b"\xff"
        + bytes(7)
        + b"\x01\x7f\x03\x01NULL".ljust(24, b"\0")
        + bytes(32)
        + b"\x04"
        + bytes([len(ready)])
        + ready
    )


def page(path: str) -> bytes:
    """What a browser says to have a WebSocket; `PORT` stands for the port."""
    return (
        f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nOrigin: http://127.0.0.1:PORT\r\nConnection: Upgrade\r\n"
        "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    ).encode()


BEGINNINGS = st.sampled_from(
    [
        b"",
        *(zmtp(kind) for kind in (b"DEALER", b"SUB", b"XSUB", b"PUB", b"REQ")),
        zmtp(b"DEALER") + b"\x04\x09\x04PING\0\xff\xff\xff",
        zmtp(b"SUB") + b"\x00\x09\x01hapticd/",
        zmtp(b"DEALER") + b"\x02" + b"\xff" * 8,
        page("/live") + b"\x81\xfe\xff\xff",
        page("/") + b"\x81\x80\0\0\0\0" * 3,
        b"GET /metrics HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nX: ",
        b"POST / HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n",
        b"GET " + b"/" * 70_000,
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
    ]
)


@pytest.mark.parametrize("name", DOORS)
def test_no_bytes_at_any_door_end_what_listens_or_cost_a_subscriber_a_tick(
    house: tuple[Daemon, dict[str, Door]], name: str
) -> None:
    daemon, doors = house
    door = doors[name]
    port = str(door.where[1]) if isinstance(door.where, tuple) else "1"
    before = descriptors(door.pid)
    with Subscriber(daemon.endpoint, "hapticd/position") as subscriber, contextlib.ExitStack() as closing:
        ticks = (fields["seq"] for _, fields in subscriber.maps())
        first = next(ticks)
        kept: list[socket.socket] = []

        @examples(60)
        @given(BEGINNINGS, st.binary(max_size=300), st.booleans())
        def throw(beginning: bytes, rest: bytes, keeps: bool) -> None:
            raw = door.knock()
            said = beginning.replace(b"PORT", port.encode()) + rest
            with contextlib.suppress(ConnectionError):
                for at in range(0, len(said), 1 + len(said) // 3):  # in pieces, as a slow network brings it
                    raw.sendall(said[at : at + 1 + len(said) // 3])
            if keeps:
                kept.append(raw)
            if not keeps or len(kept) > HALF_OPEN:
                (kept.pop(0) if keeps else raw).close()

        throw()
        for raw in kept:
            closing.enter_context(raw)
        command("disarm", timeout_s=PATIENCE_S)
        command("arm", timeout_s=PATIENCE_S)
        last = command("status")["status"]["ticks"]
        seqs = [first]
        while len(seqs) < 200 or seqs[-1] < last:
            seqs.append(next(ticks))
        assert seqs == list(range(first, first + len(seqs)))
    wait_until(lambda: descriptors(door.pid) <= before, "descriptors again")
    assert resident_mb(door.pid) < LARGEST_MB
    assert daemon.process.poll() is None
    assert remote_pid(daemon) == doors["scene"].pid
    assert all(Path(f"/proc/{other.pid}").exists() for other in doors.values())


@pytest.mark.parametrize("name", ["dashboard", "gateway"])
def test_of_connections_that_say_nothing_the_oldest_are_ended(house: tuple[Daemon, dict[str, Door]], name: str) -> None:
    """With a shell's 1024 descriptors used up, a page that was there already got no answer any more."""
    where = house[1][name].where
    with flood(where, 3 * MOST_WAITING) as opened:
        for one in opened[: 2 * MOST_WAITING]:
            one.settimeout(PATIENCE_S)
            with contextlib.suppress(ConnectionError):
                assert one.recv(1) == b""
        for one in opened[2 * MOST_WAITING + 1 :]:
            one.setblocking(False)
            with pytest.raises(BlockingIOError):
                one.recv(1)
