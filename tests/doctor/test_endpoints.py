"""What the doctor says of files, sockets and the daemon that may be using them."""

from __future__ import annotations

import fcntl
import os
import shutil
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from hapticd.doctor import configuration, endpoints
from hapticd.doctor.configuration import Wanted
from hapticd.doctor.examination import Examination
from hapticd.doctor.finding import Check, Finding, examine
from hapticd.keys.file import new_pair
from hapticd.keys.store import KeyDirectory
from hapticd.paths import directory
from hapticd.supervisor.lock import InstanceLock
from tests.doctor.machine import says
from tests.ports import free_port


@pytest.fixture
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(tmp_path / "run"))
    return tmp_path / "run" / "default"


# -- the instance


def test_a_running_daemon_is_seen_without_touching_its_lock(runtime: Path) -> None:
    assert endpoints.running(runtime) == 0
    lock = InstanceLock("default")
    try:
        assert endpoints.running(runtime) == os.getpid()
        says(endpoints.instance("default", {runtime: endpoints.running(runtime)}), "ok", f"process {os.getpid()}")
    finally:
        lock.close()
    assert endpoints.running(runtime) == 0
    says(endpoints.instance("default", {}), "ok", "does not run")


def test_a_lock_file_that_a_killed_daemon_left_is_no_daemon(runtime: Path) -> None:
    runtime.mkdir(parents=True)
    (runtime / "lock").write_text("4711\n")
    assert endpoints.running(runtime) == 0


def test_a_reader_of_the_lock_is_no_daemon(runtime: Path) -> None:
    runtime.mkdir(parents=True)
    (runtime / "lock").write_text("4711\n")
    with (runtime / "lock").open() as reader:
        fcntl.flock(reader, fcntl.LOCK_SH)
        assert endpoints.running(runtime) == 0


def test_without_the_kernels_list_of_locks_nobody_can_tell(runtime: Path, tmp_path: Path) -> None:
    runtime.mkdir(parents=True)
    (runtime / "lock").touch()
    look = Check(
        "a.check", "check", lambda: endpoints.instance("default", {runtime: endpoints.running(runtime, tmp_path)})
    )
    says(examine(look), "unknown", "proc/locks")


@contextmanager
def living(directory: Path) -> Iterator[None]:
    """A lock that is held, as a daemon holds it."""
    directory.mkdir(parents=True, exist_ok=True)
    with (directory / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        lock.write(f"{os.getpid()}\n")
        lock.flush()
        yield


@pytest.fixture
def two_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """Runtime directories of the system's daemon and of the user's own."""
    monkeypatch.setattr("hapticd.paths._RUN", tmp_path / "system")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "user"))
    monkeypatch.delenv("HAPTICD_RUNTIME_DIR", raising=False)
    return tmp_path / "system/default", tmp_path / "user/hapticd/default"


def instance_finding() -> Finding:
    (check,) = (
        check
        for check in Examination(Wanted.of(directory("config") / "hapticd.toml"), "default").checks()
        if check.name == "endpoints.instance"
    )
    return examine(check)[0]


@pytest.mark.parametrize("lives", [0, 1])
def test_neither_daemon_shadows_the_other_also_when_that_one_was_killed(
    two_places: tuple[Path, Path], lives: int
) -> None:
    """S6: the doctor looked at the user's own directory only, and said of the system's daemon that it did not run."""
    dead = two_places[1 - lives]
    dead.mkdir(parents=True)
    (dead / "lock").write_text("4711\n")
    says(instance_finding(), "ok", "'default' does not run")
    with living(two_places[lives]):
        says(instance_finding(), "ok", f"'default' runs, process {os.getpid()}")


def test_two_daemons_of_one_name_are_both_named_with_what_tells_them_apart(two_places: tuple[Path, Path]) -> None:
    system, user = two_places
    with living(system), living(user):
        finding = says(
            instance_finding(), "advice", f"process {os.getpid()} in {system} and process {os.getpid()} in {user}"
        )
    assert finding.mend == ("# --instance system/default or --instance user/default",)


# -- its directory


def test_a_directory_that_can_be_made_is_well(tmp_path: Path) -> None:
    says(endpoints.runtime(tmp_path / "run/default"), "ok", "made when the daemon starts")
    says(endpoints.runtime(tmp_path), "ok", str(tmp_path))


def test_a_file_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "run").touch()
    assert (
        "HAPTICD_RUNTIME_DIR=" in says(endpoints.runtime(tmp_path / "run/default"), "problem", "no directory").mend[0]
    )


def test_a_directory_of_somebody_else_is_not_usable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.access", lambda *_: False)
    says(endpoints.runtime(tmp_path), "problem", "may not write")


def test_a_path_longer_than_a_socket_address_is_refused_before_zeromq_does(tmp_path: Path) -> None:
    says(endpoints.runtime(tmp_path / ("x" * 100)), "problem", "107")


# -- the extra endpoint


def test_an_endpoint_is_free_or_taken() -> None:
    port = free_port()
    endpoint = f"tcp://127.0.0.1:{port}"
    with socket.create_server(("127.0.0.1", port)):
        (mend, *_) = says(endpoints.tcp({"control.tcp": endpoint}, 0), "problem", "taken by another").mend
        assert "ss -ltnp" in mend
        assert "another control.tcp" in mend
        says(endpoints.tcp({"telemetry.tcp": endpoint}, 4711), "ok", "running daemon")
    says(endpoints.tcp({"telemetry.tcp": endpoint}, 0), "ok", "is free")
    says(endpoints.tcp({}, 0), "ok", "no TCP endpoint")


def test_an_address_that_no_interface_has_is_named() -> None:
    says(endpoints.tcp({"telemetry.tcp": "tcp://192.0.2.1:9872"}, 0), "problem", "192.0.2.1")


# -- who may come in from other computers


def test_what_is_open_to_other_computers_is_told_with_whose_keys(tmp_path: Path) -> None:
    keys = KeyDirectory(tmp_path / "keys")
    here = {"telemetry.tcp": "tcp://127.0.0.1:9872"}
    everywhere = {"telemetry.tcp": "tcp://0.0.0.0:9872", "control.tcp": "tcp://127.0.0.1:9873"}
    says(endpoints.keys(here, keys), "ok", "nothing is open to other computers")
    assert "keys make" in says(endpoints.keys(everywhere, keys), "problem", "there are none in").mend[0]
    keys.make()
    assert "keys make NAME" in says(endpoints.keys(everywhere, keys), "advice", "no client is listed").mend[0]
    keys.add("laptop", new_pair())
    keys.add("wall", replace(new_pair(), watch_only=True))
    says(
        endpoints.keys(everywhere, keys),
        "ok",
        "open to these keys: laptop, wall (may only watch)",
        "tcp://0.0.0.0:9872 from every computer and tcp://127.0.0.1:9873 from this computer",
    )
    (keys.path / "clients" / "laptop.key").write_text("nonsense")
    says(endpoints.keys(everywhere, keys), "problem", "laptop.key: no public-key")


# -- the disk


@pytest.mark.parametrize(("free_mib", "mark"), [(10_000, "ok"), (100, "advice"), (1, "problem")])
def test_fault_records_need_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free_mib: int, mark: str) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=free_mib << 20))
    says(endpoints.state(tmp_path / "not/yet/there"), mark, "free")


def test_fault_records_need_a_directory_that_this_user_may_write_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With room on the disk or without: there the daemon could write none."""
    (tmp_path / "file").touch()
    says(endpoints.state(tmp_path / "file" / "faults"), "problem", "file is no directory, no fault could be recorded")
    monkeypatch.setattr("os.access", lambda *_: False)
    found = says(endpoints.state(tmp_path), "problem", "this user may not write there, no fault could be recorded")
    assert "HAPTICD_STATE_DIR=" in found.mend[0]


# -- the configuration


def test_a_good_file_is_described_as_check_does() -> None:
    path = directory("config") / "hapticd.toml"
    says(configuration.usable(Wanted.of(path)), "ok", f"{path}: ok", "loopback with ring-damping at 1000 Hz")


def test_every_problem_of_a_file_is_a_finding(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_text("[loop]\nrate_hz = 50\n[controller]\nlaw = 'tdap'\n")
    first, second = configuration.usable(Wanted.of(path))
    says(first, "problem", f"{path}: loop.rate_hz = 50")
    says(second, "problem", "controller.law")


def test_a_file_that_cannot_be_used_still_says_which_device_it_wants(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_text("[loop]\nrate_hz = 2000\n[device]\ndriver = 'omega7'\nspeed = 3\n[telemetry]\ntcp = 5\n")
    wanted = Wanted.of(path)
    assert wanted.loaded is None
    assert (wanted.driver, wanted.loop.rate_hz, wanted.tcp) == ("omega7", 2000.0, {})


@pytest.mark.parametrize("text", ["not toml", "device = 3\nloop = 'fast'", "[device]\ndriver = 7\n[loop]\ncpu = 'x'"])
def test_a_file_of_nonsense_leaves_the_defaults(tmp_path: Path, text: str) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(text)
    wanted = Wanted.of(path)
    assert (wanted.driver, wanted.loop.rate_hz) == ("loopback", 1000.0)
    assert {found.mark for found in configuration.usable(wanted)} == {"problem"}


def test_a_mark_at_the_start_of_a_file_that_cannot_be_used_hides_nothing_of_it(tmp_path: Path) -> None:
    """Windows editors put it there."""
    path = tmp_path / "lab.toml"
    path.write_text("[device]\ndriver = 'omega7'\nspeed = 3\n", encoding="utf-8-sig")
    assert Wanted.of(path).driver == "omega7"


@pytest.mark.parametrize("text", ["x = " + "[" * 5000, "# " + "x" * (1 << 20)])
def test_a_file_that_nobody_can_read_to_its_end_says_so_and_nothing_else(tmp_path: Path, text: str) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(f"[device]\ndriver = 'omega7'\n{text}\n")
    wanted = Wanted.of(path)
    assert wanted.driver == "loopback"
    says(configuration.usable(wanted), "problem", f"{path}: ")


def test_what_is_no_file_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pipe would keep its second reader waiting, and a device such as /dev/zero has no end."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    writer = threading.Thread(target=path.write_text, args=("[loop]\nrate_hz = 50\n",))
    writer.start()
    says(configuration.usable(Wanted.of(path)), "problem", "loop.rate_hz = 50")
    writer.join()
    monkeypatch.setattr("pathlib.Path.read_text", lambda _: pytest.fail("an endless read"))
    assert Wanted.of(Path("/dev/zero")).driver == "loopback"


def test_a_missing_file_is_copied_from_the_shipped_one(tmp_path: Path) -> None:
    found = says(configuration.usable(Wanted.of(tmp_path / "none.toml")), "problem", "no such file")
    assert found.mend[0].startswith("cp ")
