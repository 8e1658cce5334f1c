"""What the tests of the installed service need of the computer that runs them."""

from __future__ import annotations

import contextlib
import os
import shlex
import subprocess
from pathlib import Path

import pytest

from tests.service.machine import NODES, Machine, broken_nodes


def test_this_computer_has_its_devices() -> None:
    assert broken_nodes(Path("/dev")) == ""


def test_a_file_in_the_place_of_a_device_is_named_and_mended(tmp_path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root can make a device")
    for name, minor in NODES.items():
        os.mknod(tmp_path / name, 0o666 | 0o020000, os.makedev(1, minor))
    assert broken_nodes(tmp_path) == ""
    (tmp_path / "null").unlink()
    (tmp_path / "null").write_text("what a program printed\n")
    (tmp_path / "full").unlink()
    said = broken_nodes(tmp_path)
    assert said.startswith(f"{tmp_path}/null, {tmp_path}/full: not the device any more, so no machine can boot")
    sudo, *mend = shlex.split(said.partition("To mend it: ")[2])
    assert sudo == "sudo"
    subprocess.run(mend, check=True)
    assert broken_nodes(tmp_path) == ""


def test_another_device_of_that_name_is_none(tmp_path: Path) -> None:
    for name in NODES:
        (tmp_path / name).symlink_to("/dev/zero")
    assert f"{tmp_path}/null, {tmp_path}/full, {tmp_path}/random, {tmp_path}/urandom: not" in broken_nodes(tmp_path)


def test_processes_are_found_beside_one_whose_command_is_no_text(monkeypatch: pytest.MonkeyPatch) -> None:
    waits = ("sh", "-c", "read line")
    with contextlib.ExitStack() as stack:

        def started(*words: str | bytes) -> int:
            process = stack.enter_context(subprocess.Popen([*waits, *words], stdin=subprocess.PIPE))
            stack.callback(process.kill)
            return process.pid

        started(b"\xff")
        supervisor = started()
        control = started("hapticd.loop.process", "--parent", str(supervisor))
        machine = object.__new__(Machine)
        monkeypatch.setattr(machine, "_leader", os.getpid(), raising=False)
        monkeypatch.setattr(machine, "show", lambda *_: str(supervisor))
        assert machine.processes("hapticd.service") == (supervisor, control)
