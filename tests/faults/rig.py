"""A daemon on a device that can be told to fail, and what the device felt of it."""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import msgpack
import zmq

from hapticd.faults.record import FaultRecord, FaultSummary, read, summarise
from hapticd.faults.store import FaultStore
from hapticd.loop.loop import LATE_S
from hapticd.tick.event import EventCode
from tests.daemon.running import HAPTICD, PATIENCE_S, Daemon, Subscriber, wait_until
from tests.faults.faulty_device import WITNESS

DEVICE = Path(__file__).with_name("faulty_device.py")

BAD_LAW = '''
"""A law that fails the way its name says."""
import time
from hapticd.law import LawParams
class Params(LawParams):
    """None."""
class State:
    """Counts."""
    asked: int
def start(state, params, snapshot):
    """Count from zero."""
    state.asked = 0
def step(state, params, tick):
    """Fail after 300 ticks in contact; the warm-up takes 200."""
    state.asked += 1
    if state.asked > 300:
        FAIL
    return tick.contact_n
'''

Report = Callable[[str, object], None]

LATE = "more deadlines were missed than met"
ATTEMPTS = 5


def anew_where_late(test: Callable[..., None]) -> Callable[..., None]:
    """A test of rigs: anew where it failed and this computer had held a loop up, which then let go, and rightly so."""

    @functools.wraps(test)
    def run(*arguments: Any, **fixtures: Any) -> None:
        for attempt in range(1, ATTEMPTS + 1):
            Rig.held_up = False
            try:
                test(*arguments, **fixtures)
            except AssertionError:
                if attempt == ATTEMPTS or not Rig.held_up:
                    raise
            else:
                return

    return run


@dataclass(frozen=True)
class Felt:
    """What the device felt since the fault began.

    Attributes:
        peak_n: largest force that was written to it [N].
        writes: forces that were written, until it was zero or the device was disabled.
        gone_after_ms: time until then, None while it is not.
        force_n: force on it now [N].
        opened: how often it was opened since the witness was cleared.
    """

    peak_n: float
    writes: int
    gone_after_ms: float | None
    force_n: float
    opened: int


class Rig:
    """Give orders to the device of a running daemon.

    Attributes:
        held_up: a rig that has ended was late more often than it was told to be.
    """

    held_up: ClassVar[bool] = False

    def __init__(
        self, *, safety: str = "", more: str = "", prefix: Sequence[str] = (), laws: dict[str, str] | None = None
    ):
        self.directory = Path(tempfile.mkdtemp(prefix="faulty-"))
        shutil.copy(DEVICE, self.directory / "faulty_device.py")
        package = self.directory / "faulty_device-1.0.dist-info"
        package.mkdir()
        (package / "METADATA").write_text("Metadata-Version: 2.1\nName: faulty-device\nVersion: 1.0\n")
        (package / "entry_points.txt").write_text("[hapticd.drivers]\nfaulty = faulty_device:Faulty\n")
        laboratory = self.directory / "mylab"
        laboratory.mkdir()
        (laboratory / "__init__.py").touch()
        for name, failure in (laws or {}).items():
            (laboratory / f"{name}.py").write_text(BAD_LAW.replace("FAIL", failure))
        self._order = self.directory / "order"
        self._orders: list[str] = []
        self._witness = self.directory / "witness"
        self._witness.write_bytes(bytes(WITNESS.size))
        # Without a wall the hand's own spring holds the device, so that it never leaves its workspace.
        self.config = f"""
            [device]
            driver = "faulty"
            [device.options]
            order = "{self._order}"
            witness = "{self._witness}"
            [device.options.hand]
            force = {{ profile = "constant", newton = -3.0 }}
            stiffness_n_per_m = 2000.0
            damping_n_s_per_m = 5.0
            [[scene.walls]]
            stiffness_n_per_m = 12000.0
            [safety]
            {safety}
            {more}
        """
        self.daemon = Daemon(self.config, pythonpath=self.directory, prefix=prefix)

    def __enter__(self) -> Rig:
        self.daemon.wait_ready()
        return self

    def __exit__(self, *_: object) -> None:
        Rig.held_up |= was_held_up(self.daemon.output(), self._orders)
        self.daemon.__exit__()
        shutil.rmtree(self.directory, ignore_errors=True)

    def pressed(self) -> Rig:
        """Arm, and return when the device holds a force against the hand."""
        assert self.ask("arm")["ok"]
        self.pressing()
        return self

    def subscriber(self, *topics: str) -> Subscriber:
        """A subscriber that the daemon knows of, so that it misses nothing from now on."""
        subscriber = Subscriber(self.daemon.endpoint, *topics)
        next(subscriber.maps())
        return subscriber

    def pressing(self) -> None:
        """Return when the device holds a force against the hand.

        A computer that is too busy to run the loop releases a real device, and rightly so: try again.
        """
        end_s = time.monotonic() + PATIENCE_S
        with self.subscriber("hapticd/position", "hapticd/event") as subscriber:
            for topic, fields in subscriber.maps():
                if topic == "hapticd/position" and fields["seq"] > 500 and abs(fields["force_n"][0]) > 2.0:
                    return
                if topic == "hapticd/event" and fields["code"] == EventCode.LOOP_LATE:
                    assert self.ask("clear")["ok"]
                    assert self.ask("arm")["ok"]
                assert time.monotonic() < end_s, self.daemon.output()

    def ask(self, do: str, **fields: bool) -> dict[str, Any]:
        """The daemon's answer to a request."""
        context = zmq.Context()
        socket = context.socket(zmq.DEALER)
        try:
            socket.connect(f"ipc://{self.daemon.directory}/run/default/control")
            socket.send(msgpack.packb({"do": do, **fields}))
            assert socket.poll(int(PATIENCE_S * 1e3)), f"no answer to {do}"
            answer: dict[str, Any] = msgpack.unpackb(socket.recv())
        finally:
            socket.close(0)
            context.term()
        return answer

    def switch(self, more: str = "") -> None:
        """Let the daemon take an edited file."""
        self.daemon.config.write_text(self.config + more)
        answer = self.ask("reload", wait=True)
        assert answer["ok"], answer["text"]

    def hapticd(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        environment = {
            **os.environ,
            "HAPTICD_RUNTIME_DIR": str(self.daemon.directory / "run"),
            "HAPTICD_STATE_DIR": str(self.daemon.directory / "state"),
            "PYTHONPATH": str(self.directory),
        }
        command = [HAPTICD, *arguments]
        return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)

    def order(self, text: str) -> None:
        """Let the device fail from the next tick on."""
        self._orders.append(text)
        self._witness_write(force_n=self.felt().force_n)
        fresh = self._order.with_suffix(".new")
        fresh.write_text(text)
        fresh.rename(self._order)

    def mend(self) -> None:
        """Let the device work again."""
        self._order.unlink(missing_ok=True)

    def felt(self) -> Felt:
        force_n, began_ns, gone_ns, peak_n, writes, opened = WITNESS.unpack(self._witness.read_bytes())
        gone_after_ms = (gone_ns - began_ns) * 1e-6 if gone_ns else None
        return Felt(peak_n, writes, gone_after_ms, force_n, opened)

    def released(self) -> Felt:
        """Return when the force on the device is gone."""
        wait_until(lambda: self.felt().gone_after_ms is not None, "the force to go")
        return self.felt()

    def recorded(self, code: EventCode) -> tuple[FaultRecord, FaultSummary]:
        """The fault record of an event, once it is written."""
        store = FaultStore(self.daemon.directory / "state" / "default" / "faults")
        wait_until(lambda: any(path.stem.endswith(f"-{code}") for path in store.paths()), f"a fault record of {code}")
        path = next(path for path in store.paths() if path.stem.endswith(f"-{code}"))
        record = read(path)
        assert record.header["event"]["code"] == code
        return record, summarise(record)

    def goes_on(self, *commands: str) -> None:
        """The documented way back: these commands, and the device holds the hand again."""
        for command in commands:
            answer = self.ask(command)
            assert answer["ok"], answer["text"]
        self.pressing()

    def _witness_write(self, force_n: float) -> None:
        with self._witness.open("r+b") as file:
            file.write(WITNESS.pack(force_n, 0, 0, 0.0, 0, 0))


def was_held_up(output: str, orders: Sequence[str]) -> bool:
    """Whether a daemon that said this was late more often than these orders told its device to be."""
    slow_ms = [float(order.split()[1]) for order in orders if order.startswith("slow")]
    return output.count(LATE) > sum(each > LATE_S * 1e3 for each in slow_ms)


def events_until(subscriber: Subscriber, code: EventCode) -> list[dict[str, Any]]:
    """Every event up to one of this code."""
    seen: list[dict[str, Any]] = []
    end_s = time.monotonic() + PATIENCE_S
    for topic, fields in subscriber.maps():
        assert time.monotonic() < end_s, f"no event {code} after {[event['text'] for event in seen]}"
        if topic == "hapticd/event":
            seen.append(fields)
            if fields["code"] == code:
                return seen
    raise AssertionError(f"no event {code} after {[event['text'] for event in seen]}")
