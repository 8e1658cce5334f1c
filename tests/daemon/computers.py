"""Two computers with a cable between them: network namespaces, where this user may make them."""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.daemon.running import wait_until


@dataclass(frozen=True)
class Computers:
    """Commands to put before those that run on one or the other, and the address of the first.

    Attributes:
        first: runs a command on the first.
        second: runs a command on the second.
        address: of the first, as the second sees it.
    """

    first: Sequence[str] = ()
    second: Sequence[str] = ()
    address: str = "127.0.0.2"  # with nothing before its commands both are this one, by another of its addresses


@contextlib.contextmanager
def two_computers() -> Iterator[Computers]:
    """Two network namespaces; the test is skipped where this user may not make them."""
    with contextlib.ExitStack() as undo:
        try:
            computers = _cabled(undo)
        except FileNotFoundError as error:
            pytest.skip(f"no network namespaces: {error.filename} is not installed")
        except subprocess.CalledProcessError as error:
            pytest.skip(f"no network namespaces: {' '.join(error.cmd)}: {error.stderr.decode().strip()}")
        yield computers


def _cabled(undo: contextlib.ExitStack) -> Computers:
    pids = []
    for _ in range(2):
        subprocess.run(["unshare", "--net", "true"], check=True, capture_output=True)
        holder = subprocess.Popen(["unshare", "--net", "sleep", "infinity"])
        undo.callback(holder.wait)
        undo.callback(holder.kill)
        wait_until(lambda pid=holder.pid: not _net(pid).samefile("/proc/self/ns/net"), "a network namespace")
        pids.append(holder.pid)
    first, second = (("nsenter", f"--net={_net(pid)}") for pid in pids)
    ends = ("name", "cable", "netns", str(pids[0]), "type", "veth", "peer", "name", "cable", "netns", str(pids[1]))
    subprocess.run(["ip", "link", "add", *ends], check=True, capture_output=True)
    for side, address in ((first, "10.77.0.1/24"), (second, "10.77.0.2/24")):
        subprocess.run([*side, "ip", "address", "add", address, "dev", "cable"], check=True, capture_output=True)
        subprocess.run([*side, "ip", "link", "set", "cable", "up"], check=True, capture_output=True)
    return Computers(first, second, "10.77.0.1")


def _net(pid: int) -> Path:
    return Path(f"/proc/{pid}/ns/net")
