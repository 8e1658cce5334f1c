"""A daemon whose scene clients drive, and what it did to the device in every tick."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from hapticd.client import RemotePort
from tests.daemon.running import Daemon, wait_until

SCRIPT = Path(__file__).with_name("scene_client.py")
MAX_FORCE_N = 3.0
HOLD_S = 0.3

CONFIG = f"""
[device.options]
model = "omega7"
hand = {{ damping_n_s_per_m = 5.0 }}

[[scene.couplings]]
name = "tool"
stiffness_n_per_m = 300.0
max_force_n = {MAX_FORCE_N}
hold_s = {HOLD_S}
"""


def children(pid: int, module: str) -> list[int]:
    """Processes of a daemon that run a module."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            command = (entry / "cmdline").read_bytes().split(b"\0")
            if module.encode() in command and str(pid).encode() in command:
                found.append(int(entry.name))
    return found


def remote_pid(daemon: Daemon) -> int:
    """The process that hears clients; 0 when there is none."""
    return next(iter(children(daemon.process.pid, "hapticd.remote.process")), 0)


def runtime(daemon: Daemon) -> Path:
    return daemon.directory / "run" / "default"


def driven(daemon: Daemon, name: str = "tool") -> RemotePort:
    """A client in this process."""
    return RemotePort(name, f"ipc://{runtime(daemon)}/scene", f"ipc://{runtime(daemon)}/state")


@contextlib.contextmanager
def other_client(
    daemon: Daemon, value: float = 0.01, pause_s: float = 0.005, *said: str
) -> Iterator[subprocess.Popen[str]]:
    """A client in a process of its own, which has sent its first message; with "when" it says when it sends."""
    command = [sys.executable, str(SCRIPT), f"ipc://{runtime(daemon)}/scene", "tool", str(value), str(pause_s), *said]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            process.stdout.readline()
            yield process
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process.pid, signal.SIGCONT)
            process.kill()


def hold(tool: RemotePort, position_m: float, ticks: int = 50) -> None:
    """Keep a target somewhere for a while; returns with its newest message in force."""
    for _ in range(ticks):
        tool.state(20.0)
        tool.move([position_m])
    sent = tool.seq
    wait_until(lambda: (port := tool.state(20.0).port) is not None and port.seq >= sent, "the message to be in force")


def drives_the_tool(command: Sequence[str | Path]) -> None:
    """See that a program drives the tool of a daemon: what it says of its messages comes true.

    A program that gets no processor for a while reads old ticks after that: three of its lines must be in time.
    """
    with (
        Daemon(CONFIG).wait_ready() as daemon,
        subprocess.Popen([*command, runtime(daemon)], stdout=subprocess.PIPE, text=True) as program,
    ):
        try:
            assert program.stdout is not None
            soon = 0
            for turn in range(1, 31):
                line = program.stdout.readline().strip()
                said = re.fullmatch(r"tick (\d+) message (\d+) in force, of (\d+), force (\S+)", line)
                assert said is not None, line
                assert int(said[3]) == 100 * turn
                assert int(said[2]) < int(said[3]), "never before it is sent"
                assert abs(float(said[4])) <= MAX_FORCE_N
                soon += int(said[3]) - int(said[2]) < 20
                if soon == 3:
                    break
            assert soon == 3, "a message is in force soon"
        finally:
            program.kill()
