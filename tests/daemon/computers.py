"""Two computers with a cable between them: network namespaces, where this user may make them."""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.daemon.running import wait_until


@dataclass
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
    _holders: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def cut_power(self) -> None:
        """The first loses its power: none of its packets leaves any more. What runs there is to be killed then."""
        subprocess.run([*self.second, "ip", "link", "delete", "cable"], check=True, capture_output=True)

    def switch_on_again(self) -> None:
        """Another computer in the place of the first, which knows nothing of its connections."""
        self._holders[0].kill()
        self._holders[0].wait()
        self._holders[0] = _holder()
        self.first = _in(self._holders[0])
        _cable(self._holders[0], self._holders[1])


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
    holders: list[subprocess.Popen[bytes]] = []

    def end() -> None:
        for holder in holders:
            holder.kill()
            holder.wait()

    undo.callback(end)
    for _ in range(2):
        holders.append(_holder())
    _cable(*holders)
    return Computers(_in(holders[0]), _in(holders[1]), "10.77.0.1", holders)


def _holder() -> subprocess.Popen[bytes]:
    """A process that holds a new network namespace."""
    subprocess.run(["unshare", "--net", "true"], check=True, capture_output=True)
    holder = subprocess.Popen(["unshare", "--net", "sleep", "infinity"])
    wait_until(lambda: not _net(holder.pid).samefile("/proc/self/ns/net"), "a network namespace")
    return holder


def _cable(one: subprocess.Popen[bytes], other: subprocess.Popen[bytes]) -> None:
    ends = ("name", "cable", "netns", str(one.pid), "type", "veth", "peer", "name", "cable", "netns", str(other.pid))
    subprocess.run(["ip", "link", "add", *ends], check=True, capture_output=True)
    for side, address in ((_in(one), "10.77.0.1/24"), (_in(other), "10.77.0.2/24")):
        subprocess.run([*side, "ip", "address", "add", address, "dev", "cable"], check=True, capture_output=True)
        subprocess.run([*side, "ip", "link", "set", "cable", "up"], check=True, capture_output=True)


def _in(holder: subprocess.Popen[bytes]) -> tuple[str, ...]:
    return ("nsenter", f"--net={_net(holder.pid)}")


def _net(pid: int) -> Path:
    return Path(f"/proc/{pid}/ns/net")
