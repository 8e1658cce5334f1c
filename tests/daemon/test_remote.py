"""A daemon and its users on different computers: whose key is listed watches and commands, nobody else does."""

from __future__ import annotations

import json
import os
import random
import socket
import subprocess
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest

from hapticd.client import Client, Position, RefusedKeyError
from hapticd.keys.file import new_pair, write
from hapticd.keys.store import KeyDirectory
from hapticd.tick.event import EventCode
from tests.daemon.computers import Computers, two_computers
from tests.daemon.running import HAPTICD, PATIENCE_S, Daemon, Subscriber, wait_until
from tests.daemon.test_deaths import PRESSED
from tests.ports import free_port


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Keys of a daemon, and files of its clients: two that are listed, one that is not, one for another daemon."""
    monkeypatch.setenv("HAPTICD_KEYS_DIR", str(tmp_path / "keys"))
    monkeypatch.delenv("HAPTICD_KEYS", raising=False)
    monkeypatch.chdir(tmp_path)
    keys = KeyDirectory(tmp_path / "keys")
    server = keys.make().public
    laptop, wall = new_pair(server), new_pair(server)
    keys.add("laptop", laptop)
    keys.add("wall", replace(wall, watch_only=True))
    for name, pair in (
        ("laptop", laptop),
        ("wall", wall),
        ("stranger", new_pair(server)),
        ("deceived", replace(laptop, server=new_pair().public)),
    ):
        write(tmp_path / f"{name}.key_secret", pair)
    return tmp_path


def hapticd(*arguments: str, on: Computers | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command, on the second computer if there are two."""
    prefix = on.second if on is not None else ()
    return subprocess.run(
        [*prefix, HAPTICD, *arguments], capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )


class Remote:
    """A daemon whose two ports every address of its computer has."""

    def __init__(self, computers: Computers) -> None:
        self.computers = computers
        self.ports = free_port(), free_port()
        ports = "".join(
            f'[{table}]\ntcp = "tcp://0.0.0.0:{port}"\n'
            for table, port in zip(("telemetry", "control"), self.ports, strict=True)
        )
        self.daemon = Daemon(PRESSED + ports, prefix=computers.first)
        self.telemetry, self.control = (f"tcp://{computers.address}:{port}" for port in self.ports)

    def watch(self, *keys: str) -> subprocess.CompletedProcess[str]:
        return self._answered("watch", "--once", "--json", "--connect", self.telemetry, *keys)

    def command(self, do: str, *keys: str) -> subprocess.CompletedProcess[str]:
        return self._answered(do, "--connect", self.control, *keys)

    def _answered(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Ask again where a busy computer was too slow to answer."""
        for _ in range(5):
            done = hapticd(*arguments, on=self.computers)
            if "no daemon answers" not in done.stderr or "; what answers" in done.stderr:
                break
        return done

    def local(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(self.daemon.directory / "run")}
        return subprocess.run(
            [HAPTICD, *arguments], env=environment, capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )


@pytest.fixture
def remote(place: Path) -> Iterator[Remote]:
    """Both ends on this computer."""
    remote = Remote(Computers())
    with remote.daemon.wait_ready():
        yield remote


@pytest.mark.usefixtures("place")
def test_from_another_computer_a_listed_key_watches_and_commands_and_nobody_else_does() -> None:
    with ExitStack() as stack:
        remote = Remote(stack.enter_context(two_computers()))
        stack.enter_context(remote.daemon.wait_ready())
        local = stack.enter_context(Subscriber(remote.daemon.endpoint, "hapticd/status", "hapticd/event"))
        assert local.until("hapticd/status", armed=True)

        seen = remote.watch("--keys", "laptop.key_secret")
        assert json.loads(seen.stdout)["law"] == "ring-damping", seen.stderr
        assert remote.watch("--keys", "wall.key_secret").returncode == 0
        for keys, why in (
            ((), "takes keys"),
            (("--keys", "stranger.key_secret"), "does not let your key in"),
            (("--keys", "deceived.key_secret"), "lacks the server-key of your key file"),
        ):
            refused = remote.watch(*keys)
            assert (refused.returncode, refused.stdout) == (1, "")
            assert why in refused.stderr
            assert refused.stderr.count("\n") == 1
        for keys, why in (
            ((), "take keys"),
            (("--keys", "stranger.key_secret"), "does not let your key in"),
            (("--keys", "wall.key_secret"), "does not let your key in"),
        ):
            refused = remote.command("disarm", *keys)
            assert refused.returncode == 1
            assert why in refused.stderr

        assert remote.command("disarm", "--keys", "laptop.key_secret").returncode == 0
        assert local.until("hapticd/event", code=EventCode.DISARMED)
        assert local.until("hapticd/status", armed=False)
        assert remote.command("arm", "--keys", "laptop.key_secret").returncode == 0
        assert local.until("hapticd/status", armed=True)


def test_a_removed_key_is_shut_out_at_the_next_reload_and_the_others_go_on(remote: Remote) -> None:
    with (
        Client(remote.telemetry, topics=[Position], keys="laptop.key_secret") as laptop,
        Client(remote.telemetry, topics=[Position], timeout_s=PATIENCE_S, keys="wall.key_secret") as wall,
    ):
        assert laptop.receive(PATIENCE_S)
        assert wall.receive(PATIENCE_S)
        assert hapticd("keys", "remove", "wall").returncode == 0
        assert wall.receive(PATIENCE_S), "it was shut out before the reload"
        done = remote.command("reload", "--keys", "laptop.key_secret")
        assert done.returncode == 0, done.stderr
        with pytest.raises(RefusedKeyError, match="does not let your key in"):
            deque(wall, maxlen=0)
        seq = max(record.seq for record in laptop.receive(PATIENCE_S))
        with Subscriber(remote.daemon.endpoint, "hapticd/position") as local:
            seq = max(seq, next(local.maps())[1]["seq"])
        while max(record.seq for record in laptop.receive(PATIENCE_S)) <= seq:
            pass


def test_an_added_key_comes_in_after_a_reload(remote: Remote) -> None:
    assert "does not let your key in" in remote.watch("--keys", "stranger.key_secret").stderr
    assert hapticd("keys", "add", "stranger", "stranger.key_secret").returncode == 0
    assert remote.local("reload").returncode == 0
    assert remote.watch("--keys", "stranger.key_secret").returncode == 0
    assert "stranger" not in remote.daemon.output()
    wait_until(lambda: "refused 127.0.0." in remote.daemon.output(), "the refusal in the log")


def test_a_reload_with_a_broken_key_file_names_it_and_changes_nothing(remote: Remote, place: Path) -> None:
    broken = place / "keys" / "clients" / "broken.key"
    broken.write_text("nonsense")
    assert hapticd("keys", "remove", "wall").returncode == 0
    done = remote.local("reload")
    assert done.returncode == 2
    assert f"{broken}: no public-key in it" in done.stderr
    assert remote.watch("--keys", "wall.key_secret").returncode == 0


def test_a_daemon_with_an_endpoint_for_others_and_no_keys_does_not_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HAPTICD_KEYS_DIR", str(tmp_path / "none"))
    with Daemon(PRESSED + '[control]\ntcp = "tcp://127.0.0.1:9873"\n') as daemon:
        assert daemon.wait_exit() == 2
        (line,) = daemon.output().splitlines()
        assert "control.tcp" in line
        assert "`hapticd keys make`" in line


def test_garbage_on_both_ports_disturbs_no_tick_and_leaves_no_file_handle(remote: Remote) -> None:
    rng = random.Random(11)
    files = Path(f"/proc/{remote.daemon.process.pid}/fd")
    with Subscriber(remote.daemon.endpoint, "hapticd/position") as local:
        ticks = (fields["seq"] for _, fields in local.maps())
        first = next(ticks)
        before = len(list(files.iterdir()))
        for _ in range(300):
            with socket.create_connection(("127.0.0.1", rng.choice(remote.ports))) as raw:
                raw.sendall(
                    rng.choice([b"", b"\xff" + bytes(8) + b"\x7f\x03\x01CURVE"]) + rng.randbytes(rng.randrange(300))
                )
        wait_until(lambda: len(list(files.iterdir())) <= before, "closed connections")
        last = remote.watch("--keys", "laptop.key_secret")
        seqs = range(first + 1, json.loads(last.stdout)["seq"])
        assert seqs
        assert list(islice(ticks, len(seqs))) == list(seqs)
    assert remote.command("disarm", "--keys", "laptop.key_secret").returncode == 0
