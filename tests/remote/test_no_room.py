"""A computer with no room for another process: what clients drive waits, and the daemon goes on."""

from __future__ import annotations

import contextlib
import errno
import os
import resource
import subprocess
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from hapticd.config.loading import parse
from hapticd.config.walls import MAX_WALLS
from hapticd.loop.memory import SharedMemory
from hapticd.simulation.options import SimulationOptions
from hapticd.supervisor import remote_process
from hapticd.supervisor.lock import InstanceLock
from hapticd.supervisor.remote_process import RemoteProcess
from hapticd.tick.record import RecordLayout
from hapticd_drivers.loopback import Loopback
from tests.daemon.running import wait_until
from tests.remote.stage import CONFIG


@pytest.fixture
def loop() -> Iterator[Any]:
    """What the supervisor knows of a loop."""
    shared = SharedMemory(RecordLayout(1, False, MAX_WALLS), 1000.0)
    info = Loopback(SimulationOptions(), 1e-3).open()
    yield SimpleNamespace(process=SimpleNamespace(pid=os.getpid()), info=info, realtime=False, shared=shared)
    shared.close()


@pytest.fixture
def lock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[InstanceLock]:
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(tmp_path))
    lock = InstanceLock("lab")
    yield lock
    lock.close()


@contextlib.contextmanager
def no_descriptor_left() -> Iterator[None]:
    """A process, this one, that has as many files open as it may."""
    before, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    free = os.open(os.devnull, os.O_RDONLY)
    os.close(free)
    resource.setrlimit(resource.RLIMIT_NOFILE, (free, most))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (before, most))


def test_one_that_cannot_be_started_is_told_tried_again_later_and_ends_no_daemon(
    loop: Any, lock: InstanceLock, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = SimpleNamespace(now_s=1000.0)
    remote = RemoteProcess(lock)
    tries = []

    def refuse(*_arguments: object, **_more: object) -> None:
        tries.append(clock.now_s)
        raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))

    with monkeypatch.context() as full:
        full.setattr(remote_process, "time", SimpleNamespace(monotonic=lambda: clock.now_s))
        full.setattr(subprocess, "Popen", refuse)
        remote.serve(parse(CONFIG, "lab.toml"), loop, None, 0)
        told: list[str] = []
        while len(tries) < 5:
            told += remote.turn()
            clock.now_s = round(clock.now_s + 0.01, 2)
    assert [round(after - tries[0], 1) for after in tries] == [0.0, 0.0, 0.5, 1.5, 3.5]
    assert "cannot be started (Resource temporarily unavailable); it is started again" in told[-1]
    assert len(told) == 5
    monkeypatch.setattr(remote, "_due_s", 0.0)
    wait_until(lambda: not list(remote.turn()) and (lock.directory / "scene").exists(), "its sockets")
    remote.close()
    assert [file.name for file in lock.directory.iterdir()] == ["lock"]


def test_one_that_cannot_be_told_of_a_scene_ends_and_another_serves_that_scene(loop: Any, lock: InstanceLock) -> None:
    """The daemon ended: where no file can be opened there is none to hand the settings over in."""
    edited = parse(CONFIG.replace('"tool"', '"other"'), "lab.toml")
    remote = RemoteProcess(lock)
    remote.serve(parse(CONFIG, "lab.toml"), loop, None, 0)
    wait_until(lambda: not list(remote.turn()) and (lock.directory / "scene").exists(), "its sockets")
    with no_descriptor_left():
        remote.serve(edited, loop, None, 0)
    told: list[str] = []

    def has_ended() -> bool:
        told.extend(remote.turn())
        return told != []

    wait_until(has_ended, "its end")
    assert "the process that hears clients ended with exit code" in told[0]
    before = remote.counts
    wait_until(lambda: not list(remote.turn()) and remote.counts is not before, "counts of the next one")
    assert remote.counts["remote_name"] == ["other"]
    remote.close()
