"""Daemon and clients find each other without being told where, and never in somebody else's directory."""

from __future__ import annotations

import contextlib
import fcntl
import os
import resource
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import pytest

from hapticd import paths
from hapticd.errors import ConfigError, InstanceError
from hapticd.faults.store import FaultStore
from hapticd.keys.store import KeyDirectory, key_directory
from hapticd.paths import (
    fault_directory,
    living_instances,
    locate,
    make_runtime_directory,
    named_directory,
    runtime_directory,
    telemetry_endpoint,
)
from hapticd.supervisor.lock import InstanceLock


@pytest.fixture
def user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Nothing in the environment, and a /run and /tmp of our own."""
    for name in ("HAPTICD_RUNTIME_DIR", "RUNTIME_DIRECTORY", "XDG_RUNTIME_DIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(paths, "_RUN", tmp_path / "run" / "hapticd")
    monkeypatch.setattr(paths, "_temporary", lambda: tmp_path / "tmp" / "hapticd-1000")
    return tmp_path


@pytest.fixture
def not_root(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)


def sockets_of(directory: Path) -> Path:
    directory.mkdir(parents=True)
    (directory / "telemetry").touch()
    return directory / "telemetry"


@pytest.mark.usefixtures("not_root")
def test_the_environment_comes_first(user: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", "/session")
    assert runtime_directory("lab") == Path("/session/hapticd/lab")
    monkeypatch.setenv("RUNTIME_DIRECTORY", "/run/hapticd/lab:/run/other")
    assert runtime_directory("lab") == Path("/run/hapticd/lab")
    assert telemetry_endpoint("lab") == "ipc:///run/hapticd/lab/telemetry"
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(user / "mine"))
    assert runtime_directory("lab") == user / "mine" / "lab"


def test_a_unit_may_own_the_directory_of_one_or_of_all_instances(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HAPTICD_RUNTIME_DIR", raising=False)
    monkeypatch.setenv("RUNTIME_DIRECTORY", "/run/hapticd")
    assert runtime_directory("default") == Path("/run/hapticd/default")


def test_root_serves_the_system(user: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    assert runtime_directory() == user / "run" / "hapticd" / "default"


@pytest.mark.usefixtures("not_root")
def test_a_user_serves_the_session_or_else_below_tmp(user: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert runtime_directory() == user / "tmp" / "hapticd-1000" / "default"
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(user / "session"))
    assert runtime_directory() == user / "session" / "hapticd" / "default"


@pytest.mark.usefixtures("not_root")
def test_a_client_prefers_the_systems_daemon_then_the_users(user: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(user / "session"))
    assert locate("telemetry") == user / "session" / "hapticd" / "default" / "telemetry"
    own = sockets_of(user / "session" / "hapticd" / "default")
    assert locate("telemetry") == own
    system = sockets_of(user / "run" / "hapticd" / "default")
    assert locate("telemetry") == system
    assert locate("telemetry", "other").parent.name == "other"


@contextlib.contextmanager
def living_in(directory: Path) -> Iterator[None]:
    directory.mkdir(parents=True, exist_ok=True)
    with (directory / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@pytest.mark.usefixtures("not_root")
def test_what_a_killed_daemon_left_behind_does_not_shadow_the_one_that_lives(
    user: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """S6: a user's `disarm` failed while their own daemon ran."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(user / "session"))
    system = sockets_of(user / "run" / "hapticd" / "default")
    (system.parent / "lock").touch()
    own = sockets_of(user / "session" / "hapticd" / "default")
    assert locate("telemetry") == system
    with living_in(own.parent):
        assert locate("telemetry") == own
    with living_in(system.parent):
        assert locate("telemetry") == system


@pytest.mark.usefixtures("not_root")
def test_of_two_daemons_that_live_none_is_chosen_for_the_user(user: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """S6: a member of the group who tried a simulation could have armed the real device."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(user / "session"))
    system, own = user / "run" / "hapticd" / "lab", user / "session" / "hapticd" / "lab"
    with living_in(system), living_in(own):
        with pytest.raises(InstanceError, match="--instance system/lab or --instance user/lab"):
            locate("control", "lab")
        assert locate("control", "system/lab") == system / "control"
        assert locate("control", "user/lab") == own / "control"
        with pytest.raises(ConfigError, match="instance = "):
            locate("control", "root/lab")


@pytest.mark.usefixtures("not_root")
def test_a_directory_that_somebody_else_made_in_tmp_is_not_trusted(user: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """S10: a client talked to whatever listened in a /tmp/hapticd-UID of somebody else."""
    foreign = user / "tmp" / "hapticd-1000"
    sockets_of(foreign / "default")
    with living_in(foreign / "default"):
        user_id = foreign.stat().st_uid
        monkeypatch.setattr(os, "geteuid", lambda: user_id + 1)
        with pytest.raises(InstanceError, match="belongs to somebody else"):
            locate("telemetry")
        system = sockets_of(user / "run" / "hapticd" / "default")
        assert locate("telemetry") == system


@pytest.mark.usefixtures("not_root")
def test_every_instance_that_lives_or_is_closed_to_this_user_is_listed(
    user: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(user / "session"))
    run, own = user / "run" / "hapticd", user / "session" / "hapticd"
    for dead in (run / "dead", own / "dead"):
        dead.mkdir(parents=True)
        (dead / "lock").touch()
    look = paths.alive

    def closed(directory: Path) -> bool:
        if directory.name == "closed":
            raise PermissionError
        return look(directory)

    monkeypatch.setattr(paths, "alive", closed)
    (run / "closed").mkdir()
    assert living_instances() == ["system/closed"]
    with living_in(run / "left"), living_in(own / "left"):
        assert living_instances() == ["system/closed", "system/left", "user/left"]
    with pytest.raises(InstanceError, match="not open to you"):
        locate("control", "system/closed")


def test_a_daemon_starts_although_a_client_is_just_looking(user: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(user / "run"))
    directory = make_runtime_directory()
    with (directory / "lock").open("w") as looking:
        fcntl.flock(looking, fcntl.LOCK_SH)
        threading.Timer(0.05, fcntl.flock, (looking, fcntl.LOCK_UN)).start()
        InstanceLock("default").close()
        time.sleep(0.1)


def test_a_directory_is_made_once_and_below_tmp_for_its_user_alone(user: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(user / "tmp" / "hapticd-1000"))
    (user / "tmp").mkdir()
    directory = make_runtime_directory("lab")
    assert directory == make_runtime_directory("lab")
    assert directory.parent.stat().st_mode & 0o777 == 0o700
    assert directory.stat().st_mode & 0o777 == 0o700


def test_somebody_elses_directory_below_tmp_is_not_used(user: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(user / "tmp" / "hapticd-1000"))
    (user / "elsewhere").mkdir()
    (user / "tmp").mkdir()
    (user / "tmp" / "hapticd-1000").symlink_to(user / "elsewhere")
    with pytest.raises(InstanceError, match="belongs to somebody else; set HAPTICD_RUNTIME_DIR"):
        make_runtime_directory()
    assert list((user / "elsewhere").iterdir()) == []


def test_a_directory_that_cannot_be_made_is_one_line(user: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (user / "file").touch()
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(user / "file"))
    with pytest.raises(InstanceError, match=r"file/default: cannot be made \(.+\); set HAPTICD_RUNTIME_DIR"):
        make_runtime_directory()


@pytest.mark.parametrize("name", ["", "..", "a/b", "-x", ".hidden", "a b", "x" * 33, "é"])
def test_a_name_that_is_no_directory_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match="instance = "):
        runtime_directory(name)


@pytest.mark.parametrize("kind", ["directory", "link", "endless link", "pipe", "socket"])
def test_what_lies_in_the_place_of_the_lock_is_no_daemon_and_stays_as_it_is(
    kind: str, user: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pipe let commands wait for ever, links and sockets ended them as a defect; a daemon wrote behind a link."""
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(user / "lab"))
    lock, behind = user / "lab" / "left" / "lock", user / "precious"
    lock.parent.mkdir(parents=True)
    behind.write_text("diary")
    with socket.socket(socket.AF_UNIX) as bound:
        match kind:
            case "directory":
                lock.mkdir()
            case "link":
                lock.symlink_to(behind)
            case "endless link":
                lock.symlink_to(lock)
            case "pipe":
                os.mkfifo(lock)
            case "socket":
                bound.bind(str(lock))
        assert living_instances() == []
        assert locate("control", "left") == lock.parent / "control"
        with pytest.raises(InstanceError, match="lock: what lies there is no file of a daemon; remove it"):
            InstanceLock("left")
    assert behind.read_text() == "diary"
    assert os.path.lexists(lock)


def test_a_lock_in_use_is_not_old(user: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What cleans /tmp up would remove it after some days, and the daemon would end."""
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(user / "lab"))
    lock = InstanceLock("left")
    os.utime(lock.directory / "lock", (0.0, 0.0))
    assert lock.keep()
    assert (lock.directory / "lock").stat().st_mtime > 0.0
    lock.close()


@pytest.mark.parametrize("place", ["lab", "lab/left"])
def test_a_daemon_says_what_lies_in_the_place_of_its_directory(
    user: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(user / "lab"))
    (user / place).parent.mkdir(exist_ok=True)
    (user / place).touch()
    with pytest.raises(InstanceError, match=r"lab/left: .*; set HAPTICD_RUNTIME_DIR to a directory of yours"):
        InstanceLock("left")


def test_a_daemon_that_cannot_write_its_lock_says_which_file_and_leaves_none(
    user: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A full disk was said to be the standard output's, in a daemon that prints nothing."""
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(user / "lab"))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))
    try:
        with pytest.raises(InstanceError, match=r"lab/left/lock: File too large$"):
            InstanceLock("left")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list((user / "lab" / "left").iterdir()) == []


def test_a_runtime_directory_that_is_none_has_no_daemons(user: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (user / "file").touch()
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(user / "file"))
    assert living_instances() == []


@pytest.mark.parametrize("kind", ["RUNTIME", "STATE"])
def test_a_directory_that_is_no_utf_8_is_refused_by_its_name(
    kind: Literal["RUNTIME", "STATE"], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(f"HAPTICD_{kind}_DIR", "/tmp/lab\udce9")
    with pytest.raises(ConfigError, match=rf"HAPTICD_{kind}_DIR = '/tmp/lab.udce9': must be UTF-8"):
        named_directory(kind, "default")


@pytest.mark.usefixtures("not_root")
def test_a_user_without_a_home_is_told_what_to_set(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a container that runs it under a number only, the daemon ended as a defect after the loop had begun."""
    for name in ("HOME", "XDG_STATE_HOME", "XDG_CONFIG_HOME", "HAPTICD_STATE_DIR", "STATE_DIRECTORY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os, "getuid", lambda: 54321)
    with pytest.raises(ConfigError, match="user 1000 has no home directory: set HOME or HAPTICD_STATE_DIR"):
        fault_directory("default")
    monkeypatch.delenv("HAPTICD_KEYS_DIR", raising=False)
    monkeypatch.delenv("CONFIGURATION_DIRECTORY", raising=False)
    with pytest.raises(ConfigError, match="set HOME or HAPTICD_KEYS_DIR"):
        key_directory()


def test_a_directory_that_the_environment_names_and_that_is_closed_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It ended as a defect in a command, and as a daemon that does not run in a subscription."""
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(tmp_path / "lab"))
    sockets_of(tmp_path / "lab" / "left")
    (tmp_path / "lab").chmod(0o000)
    before = os.geteuid()
    if before == 0:
        os.seteuid(65534)
    try:
        with pytest.raises(InstanceError, match=r"lab/left: not open to you.*: unset that, or run as the user"):
            locate("telemetry", "left")
    finally:
        os.seteuid(before)
        (tmp_path / "lab").chmod(0o700)


def test_under_any_umask_no_directory_is_made_that_every_user_may_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One above keys that is open to all would let anyone put other keys in their place."""
    for name in ("HAPTICD_RUNTIME_DIR", "HAPTICD_STATE_DIR", "HAPTICD_KEYS_DIR"):
        monkeypatch.setenv(name, str(tmp_path / name / "lab"))
    before = os.umask(0)
    try:
        make_runtime_directory()
        FaultStore(fault_directory("default")).write(1e9, 202, b"a record", keep=5)
        KeyDirectory(key_directory()).make()
    finally:
        os.umask(before)
    made = [path for path in tmp_path.rglob("*") if path.is_dir()]
    assert len(made) >= 8
    assert [path for path in made if path.stat().st_mode & 0o022] == []
