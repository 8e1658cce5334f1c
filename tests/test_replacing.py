"""No file is put over a device, a pipe or a socket: for root, one rename onto /dev/null breaks the whole computer."""

from __future__ import annotations

import ast
import os
import socket
import stat
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from hapticd.config.file import replace
from hapticd.errors import ConfigError, HapticdError, InstanceError
from hapticd.keys.file import KeyWriteError, new_pair, write
from hapticd.offline.traces import open_trace
from hapticd.replacing import obstacle, put
from hapticd.replacing import write as write_whole
from hapticd.service.install import Installation, InstallationError
from hapticd.supervisor.commands import CommandSocket
from hapticd_studies.grid import output
from tests.test_rooms import PACKAGES, SOURCES

HAPTICD = Path(sys.executable).with_name("hapticd")
KINDS = ["pipe", "device", "socket", "directory"]


def special(path: Path, kind: str) -> Path:
    """Something of a name that is no regular file."""
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(str(path))
    elif kind == "directory":
        path.mkdir()
    else:
        try:
            os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, 3))  # another /dev/null
        except PermissionError:
            # A stranger to root cannot make one, and cannot break one either: a link leads to the one there is.
            path.symlink_to("/dev/null")
    return path


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_only_one_place_of_all_the_code_puts_a_file_over_another() -> None:
    renaming = []
    for path in [path for paths in SOURCES.values() for path in paths]:
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
                continue
            name, of = node.func.attr, ast.unparse(node.func.value)
            one_path = name == "replace" and len(node.args) == 1 and not node.keywords  # a text's takes two
            if name in ("rename", "renames") or one_path or (of, name) in (("os", "replace"), ("shutil", "move")):
                renaming.append(f"{path.name}: {ast.unparse(node)}")
    assert renaming == ["replacing.py: finished.rename(path)"]
    assert PACKAGES["hapticd"] / "replacing.py" in SOURCES["hapticd"]


def test_a_file_takes_the_place_of_a_file_or_of_none(tmp_path: Path) -> None:
    for text in ("one", "two"):
        (tmp_path / "part").write_text(text)
        put(tmp_path / "part", tmp_path / "file")
        assert (tmp_path / "file").read_text() == text


def test_what_is_no_file_stays(tmp_path: Path, kind: str) -> None:
    there = special(tmp_path / "there", kind)
    before = there.lstat()
    (tmp_path / "part").touch()
    with pytest.raises(OSError, match=f"is a ({kind}|link), not a file"):
        put(tmp_path / "part", there)
    assert there.lstat() == before
    assert (tmp_path / "part").exists()


def test_a_link_is_no_file(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("/dev/null")
    assert obstacle(tmp_path / "link") == "is a link, not a file"


def test_whatever_writes_refuses_it_and_leaves_nothing_beside_it(tmp_path: Path, kind: str) -> None:
    there = special(tmp_path / "there.csv", kind)
    before = there.lstat()
    with pytest.raises(ConfigError, match=f"is a {kind}, not a file"):
        open_trace(there, 10, overwrite=True)
    with pytest.raises(ConfigError, match=f"is a {kind}, not a file"):
        output.write(there, b"text")
    with pytest.raises(ConfigError, match=r"not a file"):
        output.require_folder(tmp_path, [there.name])
    with pytest.raises(ConfigError, match=f"is a {kind}, not a file"):
        replace(there, "text")
    with pytest.raises(KeyWriteError, match=f"is a ({kind}|link), not a file"):
        write(there, new_pair(), replace=True)
    assert there.lstat() == before
    assert [path.name for path in tmp_path.iterdir()] == [there.name]


@pytest.mark.parametrize("lay", [Path.symlink_to, Path.hardlink_to, lambda part, _other: os.mkfifo(part)])
def test_nothing_is_written_through_what_lies_where_a_file_is_made(tmp_path: Path, lay: Any) -> None:
    """Another file was overwritten, or a daemon that kept what it was armed with stood still for who reads a pipe."""
    other = tmp_path / "other"
    other.write_bytes(b"kept")
    lay(tmp_path / ".armed.part", other)
    writing = threading.Thread(target=write_whole, args=(tmp_path / "armed", b"new"), daemon=True)
    writing.start()
    writing.join(10.0)
    assert not writing.is_alive()
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["armed", "other"]
    assert ((tmp_path / "armed").read_bytes(), other.read_bytes()) == (b"new", b"kept")
    assert not (tmp_path / "armed").is_symlink()


def test_a_link_to_a_device_leads_no_file_over_it(tmp_path: Path) -> None:
    (tmp_path / "link.csv").symlink_to(special(tmp_path / "null", "device"))
    with pytest.raises(ConfigError, match="is a device, not a file"):
        open_trace(tmp_path / "link.csv", 10, overwrite=True)
    with pytest.raises(ConfigError, match="is a device, not a file"):
        output.write(tmp_path / "link.csv", b"text")
    assert (tmp_path / "null").is_char_device()


def test_a_link_to_a_file_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "link.csv").symlink_to("file.csv")
    output.write(tmp_path / "link.csv", b"one")
    with open_trace(tmp_path / "link.csv", 10, overwrite=True):
        pass
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "file.csv").read_text().startswith("t_s,")


def test_a_masked_file_of_the_service_is_not_written_through(tmp_path: Path) -> None:
    """A mask of systemd is a link to /dev/null; mode 0644 of that would close /dev/null to every user."""
    null = special(tmp_path / "null", "device")
    mode = null.stat().st_mode
    masked = tmp_path / "usr/local/lib/tmpfiles.d/hapticd.conf"
    masked.parent.mkdir(parents=True)
    masked.symlink_to(null)
    with pytest.raises(InstallationError, match=r"hapticd\.conf: is a link, not a file; remove it first"):
        Installation(tmp_path, Path("/opt/hapticd/bin/hapticd")).install(lambda line: None)
    assert null.stat().st_mode == mode


@pytest.mark.parametrize("kind", ["pipe", "device", "directory"])
def test_the_control_socket_is_put_over_nothing_else(tmp_path: Path, kind: str) -> None:
    """ZeroMQ itself removes whatever has the name that it binds."""
    there = special(tmp_path / "control", kind)
    with pytest.raises(InstanceError, match="no socket is in the way"):
        CommandSocket(there)
    assert there.lstat()


def test_the_commands_say_so_before_they_work(tmp_path: Path) -> None:
    there = special(tmp_path / "there.csv", "device")
    commands = [
        ("simulate", "--config", "config/hapticd.toml", "--duration", "1", "--output", str(there), "--overwrite"),
        ("study", "scene", "--output", str(there)),
        ("switch", "tdpa", "--config", str(there), "--instance", "none"),
    ]
    for command in commands:
        done = subprocess.run([HAPTICD, *command], capture_output=True, text=True, check=False, timeout=60)
        assert done.returncode == 2, done.stderr
        assert f"{there}: is a " in done.stderr
        assert len(done.stderr.splitlines()) == 1
    assert there.is_char_device()


def test_an_error_of_the_system_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "closed").touch()
    with pytest.raises(HapticdError, match="Not a directory"):
        output.write(tmp_path / "closed" / "file", b"")
