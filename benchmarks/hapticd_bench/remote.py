"""How soon what a client sends is felt, and how soon a client hears of a tick, beside a bare ZeroMQ echo.

    hapticd bench remote [--messages 2000] [--realtime] [--json]

The client and the echo are the same kind of program as any client: Python, pyzmq, normal priority, or the lowest
real-time one. Each message to the daemon is followed by one to the echo, both at any time within a period.
"""

from __future__ import annotations

import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgpack
import zmq

from hapticd.client import Client, Timing
from hapticd.errors import HapticdError
from hapticd.measure import Bar, Conditions, MachineWatch, Progress, Quantiles, doubtful
from hapticd_bench.running import running_daemon

PERIOD_US = 1000.0
MOST_TIMES = 3.0
"""What a way may take, in ways of the echo."""

MOST_OTHERS = 0.5
"""Processors that other programs may keep busy: beyond it a program at normal priority waits for them."""

STEP_S = 0.02
"""What a message takes, about: it, its echo and the pauses between them [s]."""

PATIENCE_S = 30.0
_PATIENCE_MS = int(PATIENCE_S * 1e3)
_SEED = 1

CONFIG = """
[device.options]
model = "omega7"
[[scene.couplings]]
name = "tool"
stiffness_n_per_m = 200.0
max_force_n = 3.0
hold_s = 1.0
"""

ECHO = """
import sys, time, zmq
socket = zmq.Context().socket(zmq.ROUTER)
socket.bind(sys.argv[1])
while True:
    who, said = socket.recv_multipart()
    socket.send_multipart((who, time.monotonic_ns().to_bytes(8, "little") + said[8:]))
"""


@dataclass(frozen=True, slots=True)
class RemoteReport:
    """What was measured.

    Attributes:
        echo_us: one way to or from a bare echo [us].
        to_tick_us: from a client's send to the beginning of the tick that goes by it, the wait for that tick included
            [us].
        to_client_us: from the end of a tick to a client that has heard of it [us].
        bars: the figures against what is asked of them.
        conditions: the machine.
    """

    echo_us: Quantiles
    to_tick_us: Quantiles
    to_client_us: Quantiles
    bars: tuple[Bar, ...]
    conditions: Conditions


def measure(messages: int, progress: Progress, realtime: bool = False) -> RemoteReport:
    """Send `messages` messages to a daemon, and as many to an echo.

    Args:
        messages: how many.
        progress: told what is done.
        realtime: client and echo have the lowest real-time priority, so that no ordinary program is in any way.

    Raises:
        HapticdError: the daemon could not start, or did not survive; or there is no permission for that priority.
    """
    watch = MachineWatch()
    with tempfile.TemporaryDirectory(prefix="hapticd-") as place:
        directory = Path(place)
        config = directory / "lab.toml"
        config.write_text(CONFIG)
        with (
            running_daemon(config, directory) as daemon,
            _priority(realtime),
            _echo(directory) as echo,
            Client(daemon.endpoint, topics=[Timing], receive_high_water=0) as timing,
            _Driver(directory / "default") as driver,
        ):
            try:
                times = _measured(driver, echo, timing, messages, progress)
            except TimeoutError as error:
                raise daemon.failed(str(error)) from error
    return _report(*times, watch.end(), realtime)


def _measured(
    driver: _Driver, echo: zmq.Socket[bytes], timing: Client, messages: int, progress: Progress
) -> tuple[list[float], list[float], list[float]]:
    """Times of the echo, to a tick, and from a tick [us]."""
    dice = random.Random(_SEED)
    echo_us: list[float] = []
    sent_ns: dict[int, int] = {}
    heard_ns: dict[int, int] = {}
    driver.hear()
    if not timing.receive(PATIENCE_S):  # from the first one on it hears of every tick
        raise TimeoutError(f"no ticks for {PATIENCE_S:g} s")
    for _ in range(messages):
        time.sleep(dice.uniform(0.0, 0.005))
        sent, applied, heard = driver.send()
        sent_ns.setdefault(applied, sent)
        heard_ns.update(heard)
        time.sleep(dice.uniform(0.0, 0.005))
        echo_us.extend(_ways_us(echo))
        progress(STEP_S)
    began_ns, ended_ns = _ticks(timing, max(sent_ns))
    to_tick_us = [(began_ns[tick] - sent) * 1e-3 for tick, sent in sent_ns.items() if tick in began_ns]
    to_client_us = [(heard - ended_ns[tick]) * 1e-3 for tick, heard in heard_ns.items() if tick in ended_ns]
    return echo_us, to_tick_us, to_client_us


def _report(
    echo_us: list[float], to_tick_us: list[float], to_client_us: list[float], machine: Conditions, realtime: bool
) -> RemoteReport:
    echo, to_tick, to_client = (Quantiles.of(each) for each in (echo_us, to_tick_us, to_client_us))
    bars = [
        bar
        for name in ("p50", "p99")
        for bar in (
            _bar(f"send to tick, {name} [us]", getattr(to_tick, name), PERIOD_US + MOST_TIMES * getattr(echo, name)),
            _bar(f"tick to client, {name} [us]", getattr(to_client, name), MOST_TIMES * getattr(echo, name)),
        )
    ]
    if machine.others > MOST_OTHERS and not realtime:
        note = f"other programs kept {machine.others:.2f} processors busy"
        bars = [replace(bar, verdict="INCONCLUSIVE", note=note) for bar in bars]
    return RemoteReport(echo, to_tick, to_client, tuple(doubtful(bars, machine)), machine)


def _bar(name: str, measured: float, limit: float) -> Bar:
    return Bar(name, measured, limit, "PASS" if measured <= limit else "FAIL")


class _Driver:
    """A client of the coupling."""

    def __init__(self, directory: Path) -> None:
        self._context = zmq.Context()
        self._scene = self._context.socket(zmq.DEALER)
        self._state = self._context.socket(zmq.SUB)
        self._state.setsockopt(zmq.RCVHWM, 0)  # every tick: the first that goes by a message is looked for
        self._state.setsockopt(zmq.SUBSCRIBE, b"")
        self._scene.connect(f"ipc://{directory}/scene")
        self._state.connect(f"ipc://{directory}/state")
        self._seq = 0

    def __enter__(self) -> _Driver:
        return self

    def __exit__(self, *_: object) -> None:
        self._scene.close(0)
        self._state.close(0)
        self._context.term()

    def hear(self) -> dict[str, Any]:
        """The next state."""
        if not self._state.poll(_PATIENCE_MS):
            raise TimeoutError(f"no state for {PATIENCE_S:g} s")
        state: dict[str, Any] = msgpack.unpackb(self._state.recv())
        return state

    def send(self) -> tuple[int, int, dict[int, int]]:
        """Send a message.

        Returns:
            When it was sent [ns], the first tick that went by it, and when each tick was heard that was waited for
            [ns].
        """
        while self._state.poll(0):  # what waited; the next ones are waited for
            self._state.recv()
        self._seq += 1
        message = {"name": "tool", "seq": self._seq, "position_m": [0.001 if self._seq % 2 else 0.0]}
        sent_ns = time.monotonic_ns()
        self._scene.send(msgpack.packb(message))
        heard: dict[int, int] = {}
        end_ns = sent_ns + int(PATIENCE_S * 1e9)
        while True:
            state = self.hear()
            now_ns = time.monotonic_ns()
            heard[state["seq"]] = now_ns
            if state["ports"]["tool"]["seq"] == self._seq:
                return sent_ns, state["seq"], heard
            if now_ns > end_ns:
                raise TimeoutError(f"a message was not in force after {PATIENCE_S:g} s")


@contextmanager
def _priority(realtime: bool) -> Iterator[None]:
    """Be a real-time program, and with it all that begins within, where that is wanted."""
    if not realtime:
        yield
        return
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError as error:
        raise HapticdError("--realtime: not permitted here: grant CAP_SYS_NICE or an rtprio limit of 1") from error
    try:
        yield
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


@contextmanager
def _echo(directory: Path) -> Iterator[zmq.Socket[bytes]]:
    """A bare echo in a process of its own, and the socket that talks to it."""
    endpoint = f"ipc://{directory}/echo"
    context = zmq.Context()
    socket: zmq.Socket[bytes] = context.socket(zmq.DEALER)
    with subprocess.Popen([sys.executable, "-c", ECHO, endpoint]) as process:
        try:
            socket.connect(endpoint)
            yield socket
        finally:
            socket.close(0)
            context.term()
            process.kill()


def _ways_us(echo: zmq.Socket[bytes]) -> tuple[float, float]:
    """One way to the echo and one back [us]."""
    sent_ns = time.monotonic_ns()
    echo.send(bytes(120))
    if not echo.poll(_PATIENCE_MS):
        raise HapticdError("the echo does not answer")
    answer = echo.recv()
    heard_ns = time.monotonic_ns()
    there_ns = int.from_bytes(answer[:8], "little")
    return (there_ns - sent_ns) * 1e-3, (heard_ns - there_ns) * 1e-3


def _ticks(timing: Client, last: int) -> tuple[dict[int, int], dict[int, int]]:
    """When each tick began and ended, up to one [ns of CLOCK_MONOTONIC]."""
    began_ns: dict[int, int] = {}
    ended_ns: dict[int, int] = {}
    while last not in began_ns:
        records = timing.receive(PATIENCE_S)
        if not records:
            raise TimeoutError(f"no ticks for {PATIENCE_S:g} s")
        for record in records:
            if isinstance(record, Timing):
                began_ns[record.seq] = record.deadline_ns + int(record.late_us * 1e3)
                ended_ns[record.seq] = began_ns[record.seq] + int(record.busy_us * 1e3)
                if record.seq > last:
                    return began_ns, ended_ns
    return began_ns, ended_ns
