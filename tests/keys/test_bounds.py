"""What the page says that an endpoint bears, who reaches it without a key, and what is logged of both."""

from __future__ import annotations

import os
import socket as sockets
import stat
import time
from dataclasses import replace
from pathlib import Path

import pytest
import zmq

from hapticd.config.loading import parse
from hapticd.errors import ConfigError
from hapticd.keys.connections import DESCRIPTORS, MOST_CONNECTIONS, MOST_ODD, ConnectionBound, has_ended, inode_of
from hapticd.keys.file import new_pair, read, write
from hapticd.keys.heartbeat import expect_signs_of_life
from hapticd.keys.policy import key_ring, stays_here, takes_keys, tcp_endpoints
from hapticd.keys.store import KeyDirectory

PAGE = " ".join((Path(__file__).parents[2] / "docs" / "telemetry.md").read_text().split())


def test_the_page_has_the_bounds() -> None:
    assert f"at most {MOST_CONNECTIONS} clients" in PAGE
    assert f"more than {MOST_ODD} of them" in PAGE
    assert f"{DESCRIPTORS} descriptors" in PAGE


@pytest.mark.parametrize(
    "address", ["*", "eth0", "0.0.0.0", "192.168.1.5", "[::]", "[2001:db8::1]", "haptics.example.org", "127.0.0.1.org"]
)
def test_what_another_computer_may_reach_takes_keys(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every address that is not surely one of this computer alone: a name, a wildcard, an interface."""
    monkeypatch.setenv("HAPTICD_KEYS_DIR", str(tmp_path))
    assert not stays_here(f"tcp://{address}:9872")
    assert takes_keys("telemetry.tcp", f"tcp://{address}:9872")
    with pytest.raises(ConfigError, match=r"takes keys, and there are none in|must be an address and a port"):
        key_ring(parse(f"[telemetry]\ntcp = 'tcp://{address}:9872'\n", "lab"))


@pytest.mark.parametrize("address", ["127.0.0.1", "127.3.2.1", "localhost", "[::1]"])
def test_on_this_computer_alone_what_commands_and_drives_takes_keys_and_measurements_do_not(address: str) -> None:
    endpoint = f"tcp://{address}:9872"
    assert stays_here(endpoint)
    assert not takes_keys("telemetry.tcp", endpoint)
    for name in ("control.tcp", "remote.scene_tcp", "remote.state_tcp"):
        assert takes_keys(name, endpoint)


def test_a_port_for_what_drives_is_there_only_where_something_is_driven() -> None:
    ports = "[remote]\nscene_tcp = 'tcp://127.0.0.1:1'\nstate_tcp = 'tcp://127.0.0.1:2'\n"
    thing = '[[scene.objects]]\nname = "b"\nshape = "sphere"\nradius_m = 0.01\nposition_m = [0.0, 0.0, -0.1]\n'
    driven = {
        "couplings": '[[scene.couplings]]\nname = "t"\nstiffness_n_per_m = 1.0\nmax_force_n = 1.0\n',
        "forces": '[[scene.forces]]\nname = "f"\nmax_force_n = 1.0\n',
        "objects": f"{thing}stiffness_n_per_m = 1.0\nremote = true\n",
    }
    device = "[device.options]\nmodel = 'omega7'\naxes = 3\n"
    for scene in driven.values():
        assert set(tcp_endpoints(parse(device + ports + scene, "x").config)) == {"remote.scene_tcp", "remote.state_tcp"}
    still = f"{thing}stiffness_n_per_m = 1.0\n"
    assert tcp_endpoints(parse(device + ports + still, "x").config) == {}


def test_a_flood_is_logged_once_a_minute_for_each_endpoint_from_the_first_minute_on(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A computer that has just started counts its time from nothing."""
    now_s = [0.5]
    with zmq.Context() as context:
        socket = context.socket(zmq.ROUTER)
        bound = ConnectionBound(socket, 7)
        try:
            monkeypatch.setattr(time, "monotonic", lambda: now_s[0])
            for at_s, endpoint in [(0.5, "a"), (1.0, "b"), (60.4, "a"), (60.6, "a"), (60.9, "b"), (120.0, "a")]:
                now_s[0] = at_s
                bound._tell(endpoint, "too many")
        finally:
            monkeypatch.undo()
            socket.close(0)
            bound.close()
    told = [record.getMessage() for record in caplog.records]
    assert told == [f"{endpoint}: too many" for endpoint in "aba"]


def test_a_connection_has_ended_when_either_end_has_or_its_number_is_anothers() -> None:
    ours, theirs = sockets.socketpair()
    with ours, theirs:
        inode = inode_of(ours.fileno())
        assert inode != 0
        assert not has_ended(ours.fileno(), inode)
        theirs.send(b"what waits to be read ends nothing")
        assert not has_ended(ours.fileno(), inode)
        assert has_ended(ours.fileno(), inode_of(theirs.fileno()))
        assert has_ended(ours.fileno(), 0)
        theirs.close()
        assert has_ended(ours.fileno(), inode)
        number = ours.fileno()
        ours.close()
        assert inode_of(number) == 0
        assert has_ended(number, inode)
        assert has_ended(number, 0)


def test_a_key_has_its_group_and_its_rights_before_it_has_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "server.key_secret"
    done: list[tuple[str, int, bool]] = []
    chmod = os.fchmod
    monkeypatch.setattr(os, "fchown", lambda _at, user, group: done.append((f"owner {user}", group, path.exists())))

    def give_rights(at: int, mode: int) -> None:
        done.append(("mode", mode, path.exists()))
        chmod(at, mode)

    monkeypatch.setattr(os, "fchmod", give_rights)
    write(path, new_pair(), mode=0o640, group=77)
    assert done == [("owner -1", 77, False), ("mode", 0o640, False)]


def test_a_directory_of_keys_is_closed_to_others_from_its_first_moment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the umask, before it has its group and its rights."""
    seen: list[int] = []
    monkeypatch.setattr(os, "chown", lambda path, _user, _group: seen.append(stat.S_IMODE(path.stat().st_mode)))
    before = os.umask(0)
    try:
        KeyDirectory(tmp_path / "keys").make()
    finally:
        os.umask(before)
    assert seen == [0o700, 0o700]


@pytest.mark.parametrize("rights", ["", "all", "Watch", "watch,command", "command watch"])
def test_a_key_of_which_it_is_not_clear_what_it_may_is_refused(tmp_path: Path, rights: str) -> None:
    path = tmp_path / "some.key"
    write(path, replace(new_pair(), secret="", watch_only=True))
    assert read(path).watch_only
    path.write_text(path.read_text().replace('rights = "watch"', f'rights = "{rights}"'))
    with pytest.raises(ConfigError, match='must be "command" or "watch"'):
        read(path)


def test_signs_of_life_are_sent_each_second_and_missed_after_four() -> None:
    with zmq.Context() as context, context.socket(zmq.DEALER) as socket:
        expect_signs_of_life(socket)
        assert socket.getsockopt(zmq.HEARTBEAT_IVL) == 1000
        assert socket.getsockopt(zmq.HEARTBEAT_TIMEOUT) == 4000
        assert socket.getsockopt(zmq.CONNECT_TIMEOUT) == 4000
