"""A program of any user connects again and again to a loopback port: the daemon lives and obeys."""

from __future__ import annotations

import contextlib
import resource
import socket
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zmq

from hapticd.client.commands import command
from hapticd.keys.connections import MOST_CONNECTIONS
from hapticd.keys.store import KeyDirectory
from tests.daemon.running import PATIENCE_S, Daemon, Subscriber, wait_until
from tests.ports import free_port

CONNECTIONS = 1500
LARGEST_MB = 150.0
"""Of the 512 MB that the unit allows; it needs 50."""

FEW_DESCRIPTORS = ("sh", "-c", 'ulimit -S -n 1024; exec "$0" "$@"')
"""A shell as most users have it: 1024 descriptors, and more for who asks."""


@contextlib.contextmanager
def flood(where: tuple[str, int] | str, count: int) -> Iterator[list[socket.socket]]:
    """So many connections that never say a word, all opened before this returns and held until the end."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard < count + 500:
        pytest.skip(f"this user may have only {hard} descriptors")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, count + 500), hard))
    opened: list[socket.socket] = []
    try:
        for _ in range(count):
            one = socket.socket(socket.AF_UNIX if isinstance(where, str) else socket.AF_INET)
            opened.append(one)
            one.settimeout(None if isinstance(where, str) else PATIENCE_S)
            one.connect(where)
        yield opened
    finally:
        for one in opened:
            one.close()
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def descriptors(pid: int) -> int:
    return sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir())


def resident_mb(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith("VmRSS")).split()[1]) / 1024.0


@pytest.mark.parametrize("endpoint", ["port", "keyed port", "telemetry", "control"])
def test_idle_connections_neither_end_the_daemon_nor_keep_disarm_away(
    endpoint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, record_property: Callable[[str, object], None]
) -> None:
    """S1: a thousand used up the descriptors, and the next client of the control socket met an abort in libzmq."""
    port = free_port()
    table = "control" if endpoint == "keyed port" else "telemetry"  # commands take keys on this computer too
    monkeypatch.setenv("HAPTICD_KEYS_DIR", str(tmp_path))
    KeyDirectory(tmp_path).make()
    config = f'[{table}]\ntcp = "tcp://127.0.0.1:{port}"\n'
    with Daemon(config, prefix=FEW_DESCRIPTORS) as daemon:
        daemon.wait_ready()
        monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(daemon.directory / "run"))
        command("arm")
        run = daemon.directory / "run/default"
        where = ("127.0.0.1", port) if endpoint.endswith("port") else str(run / endpoint)
        before = descriptors(daemon.process.pid)
        with flood(where, CONNECTIONS), Subscriber(daemon.endpoint, "hapticd/status") as subscriber:
            asked_s = time.monotonic()
            command("disarm", timeout_s=PATIENCE_S)
            answered_s = time.monotonic() - asked_s
            wait_until(lambda: descriptors(daemon.process.pid) < before + MOST_CONNECTIONS + 20, "descriptors again")
            subscriber.until("hapticd/status", armed=False)
        record_property("disarm_s", f"{answered_s:.3f}")
        sys.stdout.write(f"disarm answered after {1e3 * answered_s:.0f} ms\n")
        assert daemon.process.poll() is None
        assert resident_mb(daemon.process.pid) < LARGEST_MB
        assert f"more than {MOST_CONNECTIONS} connections" in daemon.output()


def test_a_subscriber_that_has_subscribed_is_not_dropped_for_those_that_come_later() -> None:
    port = free_port()
    with Daemon(f'[telemetry]\ntcp = "tcp://127.0.0.1:{port}"\n') as daemon:
        daemon.wait_ready()
        with Subscriber(f"tcp://127.0.0.1:{port}", "hapticd/position") as subscriber:
            maps = subscriber.maps()
            last = next(maps)[1]["seq"]
            with flood(("127.0.0.1", port), 2 * MOST_CONNECTIONS):
                until = last + 2000
                for _, fields in maps:
                    assert fields["seq"] == last + 1
                    last = fields["seq"]
                    if last > until:
                        break


@pytest.mark.parametrize("size", [1000, 100])
def test_subscriptions_to_what_there_is_not_do_not_fill_the_memory(size: int) -> None:
    """S2: 20 000 of 1 kB took the daemon from 46 to 1012 MB."""
    with Daemon("") as daemon:
        daemon.wait_ready()
        before_mb = resident_mb(daemon.process.pid)
        with Subscriber(daemon.endpoint, "hapticd/event") as rude:
            rude.socket.setsockopt(zmq.SNDHWM, 0)
            for number in range(20_000):
                rude.socket.setsockopt(zmq.SUBSCRIBE, f"{number:06d}".encode() + b"x" * (size - 6))
            # Another client's subscription comes after: it has been served, so those were looked at.
            with Subscriber(daemon.endpoint, "hapticd/status") as polite:
                polite.until("hapticd/status")
            time.sleep(2.0)
            after_mb = resident_mb(daemon.process.pid)
        sys.stdout.write(f"{before_mb:.0f} -> {after_mb:.0f} MB\n")
        assert after_mb < LARGEST_MB
