"""The files of the local endpoints: open to owner and group alone, also in the moment in which they are made."""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import zmq

from hapticd.config.models import TelemetryConfig
from hapticd.errors import InstanceError
from hapticd.remote.bound_socket import BoundSocket
from hapticd.supervisor.commands import CommandSocket
from hapticd.telemetry.publisher import Publisher
from hapticd_bench.telemetry import synthetic_info

Open = Callable[[Path], Any]


def remote(path: Path) -> BoundSocket:
    return BoundSocket(zmq.ROUTER, path, None, None, watch_only=False, largest=1000, unread=10, options={})


def telemetry(path: Path) -> Publisher:
    return Publisher(TelemetryConfig(), path, synthetic_info(), 0)


@pytest.fixture
def short_path() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="hapticd-") as directory:  # an ipc path has at most 107 bytes
        yield Path(directory) / "here"


@pytest.fixture(params=[0o000, 0o022, 0o777], ids=oct)
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


@pytest.mark.parametrize("opened", [CommandSocket, telemetry, remote])
def test_no_one_else_may_connect_at_any_time(
    opened: Open, short_path: Path, umask: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a umask of 000 the socket was open to all between its binding and the setting of its mode.

    Where the directory has a default list of rights, that takes the place of the umask.
    """
    bind, modes = zmq.Socket.bind, []

    def bind_and_look(socket: zmq.Socket[bytes], endpoint: str) -> object:
        bound = bind(socket, endpoint)
        modes.append(stat.S_IMODE(short_path.stat().st_mode))
        short_path.chmod(0o666)  # as such a list would have it
        return bound

    monkeypatch.setattr(zmq.Socket, "bind", bind_and_look)
    endpoint = opened(short_path)
    assert modes == [0o660]
    assert stat.S_IMODE(short_path.stat().st_mode) == 0o660
    assert os.umask(umask) == umask
    endpoint.close()


@pytest.mark.parametrize("opened", [CommandSocket, telemetry, remote])
def test_a_path_that_is_refused_leaves_the_umask_as_it_was(opened: Open, short_path: Path, umask: int) -> None:
    with pytest.raises(InstanceError):
        opened(short_path / "nowhere")
    assert os.umask(umask) == umask


@pytest.mark.parametrize("opened", [CommandSocket, telemetry, remote])
def test_a_directory_that_is_a_file_is_refused_by_name(opened: Open, short_path: Path) -> None:
    """It ended in a NotADirectoryError."""
    short_path.touch()
    with pytest.raises(InstanceError, match=f"ipc://{short_path}/socket: "):
        opened(short_path / "socket")
    assert short_path.is_file()


@pytest.mark.parametrize("opened", [CommandSocket, telemetry, remote])
def test_only_its_own_file_is_removed_in_the_end(opened: Open, short_path: Path) -> None:
    first = opened(short_path)
    second = opened(short_path)  # ZeroMQ puts it over the first
    first.close()
    assert short_path.is_socket()
    second.close()
    assert not short_path.exists()
