"""A serial port below every driver: it never waits for the kernel's worker that brings what has come."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hapticd.errors import DeviceDisconnectedError
from hapticd_drivers.serial_port import SerialPort
from tests.neighbour import neighbour

ASKING = """
import os, pty, sys, time, tty
from hapticd_drivers.serial_port import SerialPort
far, near = pty.openpty()
tty.setraw(far)
port = SerialPort("serial-rig", os.ttyname(near), 115200, "the rig")
os.path.exists("/begin")
came = 0
for at in range(21):
    if at % 4 == 0:
        os.write(far, b"state")
    came += len(port.receive(4096))
    port.wait(1e-3)
while came < 30:
    port.wait(1.0)
    came += len(port.receive(4096))
os.path.exists("/end")
print(os.ttyname(near))
"""

# A loop, and far ends that are real-time as well, so that only the kernel's worker is kept waiting.
BESIDE = """
import os, pty, sys, time, tty
from hapticd_drivers.serial_port import SerialPort
def at_once(priority, cpu):
    os.sched_setaffinity(0, {cpu})
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
first, last = min(os.sched_getaffinity(0)), max(os.sched_getaffinity(0))
lines = [pty.openpty() for _ in range(2)]
loop = os.getpid()
for far, near in lines:
    tty.setraw(far)
    tty.setraw(near)
    os.set_blocking(near, False)
if os.fork() == 0:
    at_once(60, first)
    while os.getppid() == loop:
        for far, _ in lines:
            os.write(far, b"state")
        time.sleep(1e-3)
    os._exit(0)
(_, bare), (_, near) = lines
port = SerialPort("serial-rig", os.ttyname(near), 115200, "the rig")
def read_bare():
    try:
        os.read(bare, 4096)
    except BlockingIOError:
        pass
at_once(80, last)
longest = [0, 0]
for _ in range(5000):
    for which, look in enumerate((read_bare, lambda: port.receive(4096))):
        begin = time.monotonic_ns()
        look()
        longest[which] = max(longest[which], time.monotonic_ns() - begin)
    time.sleep(1e-3)
print(*longest)
"""


@pytest.fixture
def line() -> Iterator[tuple[SerialPort, int]]:
    """A port, and the far end of its line."""
    far, near = pty.openpty()
    tty.setraw(far)
    port = SerialPort("serial-rig", os.ttyname(near), 115_200, "the rig")
    os.close(near)
    try:
        yield port, far
    finally:
        port.close()
        os.close(far)


def test_it_reads_only_what_is_there_and_never_asks_the_kernel_to_wait(tmp_path: Path) -> None:
    """`read`, `select` and `poll` on a terminal wait for a worker where nothing can be read."""
    trace = tmp_path / "trace"
    command = ["strace", "-y", "-o", str(trace), sys.executable, "-c", ASKING]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    asked = trace.read_text().partition('"/begin"')[2].partition('"/end"')[0]
    calls = re.findall(rf"^(\w+)\(.*<{re.escape(done.stdout.strip())}>.* = (-?\d+)", asked, re.MULTILINE)
    assert {name for name, _ in calls} == {"ioctl", "read"}
    came = [int(count) for name, count in calls if name == "read"]
    assert came
    assert min(came) > 0
    assert sum(came) == 30
    assert not re.search(r"^p?(select|poll)|^epoll", asked, re.MULTILINE)


def test_a_wait_ends_when_something_has_come(line: tuple[SerialPort, int]) -> None:
    port, far = line
    os.write(far, b"state")
    begin_s = time.monotonic()
    port.wait(60.0)
    assert time.monotonic() - begin_s < 60.0
    assert port.receive(4096) == b"state"
    assert port.receive(4096) == b""


def test_a_wait_in_vain_ends_in_time(line: tuple[SerialPort, int]) -> None:
    port, _ = line
    begin_s = time.monotonic()
    port.wait(0.01)
    assert time.monotonic() - begin_s >= 0.01
    assert port.receive(4096) == b""


@pytest.mark.parametrize("ask", [lambda port: port.receive(4096), lambda port: port.wait(60.0)])
def test_a_port_that_has_gone_is_said_at_the_next_look(ask: Callable[[SerialPort], object]) -> None:
    far, near = pty.openpty()
    tty.setraw(far)
    port = SerialPort("serial-rig", os.ttyname(near), 115_200, "the rig")
    os.close(near)
    os.close(far)
    with pytest.raises(DeviceDisconnectedError, match="is gone"):
        ask(port)
    port.close()


@pytest.mark.nightly
def test_a_loop_is_not_held_up_by_what_holds_the_kernels_worker_up(record_property: Callable[[str, str], None]) -> None:
    """Beside programs that take the processors from all that is not real-time: a bare read waits for as long."""
    with neighbour(0.045):
        command = [sys.executable, "-c", BESIDE]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    bare_ns, port_ns = map(int, done.stdout.split())
    record_property("prints", f"longest of 5000 looks: bare read {bare_ns * 1e-6:.2f} ms, ours {port_ns * 1e-6:.2f} ms")
    assert port_ns < bare_ns / 4
