"""A real daemon for a test: started as a user would, ready when it tells systemd so, looked at from outside."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import msgpack
import zmq

from hapticd.loop.memory import RECORDS, RecordReader, SharedMemory
from hapticd.tick.record import RecordLayout, TickRecord

HAPTICD = str(Path(sys.executable).parent / "hapticd")
PATIENCE_S = 60.0
"""How long anything may take on a busy machine before a test gives up."""


class Daemon:
    """`hapticd run` in a process of its own, with a runtime directory of its own."""

    def __init__(
        self, config: str, *, prefix: Sequence[str] = (), pythonpath: Path | None = None, closed: bool = False
    ) -> None:
        self.directory = Path(tempfile.mkdtemp(prefix="hapticd-"))  # short: an ipc path has at most 107 characters
        self.config = self.directory / "lab.toml"
        self.config.write_text(config)
        self.log = self.directory / "log"
        self.endpoint = f"ipc://{self.directory}/run/default/telemetry"
        (self.directory / "run").mkdir(mode=0o500 if closed else 0o700)
        self._notify = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._notify.bind(str(self.directory / "notify"))
        environment = {
            **os.environ,
            "HAPTICD_RUNTIME_DIR": str(self.directory / "run"),
            "HAPTICD_STATE_DIR": str(self.directory / "state"),
            "NOTIFY_SOCKET": str(self.directory / "notify"),
        }
        environment.pop("WATCHDOG_USEC", None)
        if pythonpath is not None:
            environment["PYTHONPATH"] = str(pythonpath)
        self._prefix = prefix
        self._environment = environment
        self.process = self._start()

    def _start(self) -> subprocess.Popen[bytes]:
        with self.log.open("a") as log:
            return subprocess.Popen(
                [*self._prefix, HAPTICD, "run", "--config", str(self.config)],
                env=self._environment,
                stderr=log,
                stdout=log,
            )

    def again(self) -> Daemon:
        """Start it anew once it has ended, as systemd would; returns when it ticks."""
        self.wait_exit()
        self.process = self._start()
        return self.wait_ready()

    def __enter__(self) -> Daemon:
        return self

    def __exit__(self, *_: object) -> None:
        if not self.directory.exists():  # it was never ready
            return
        for pid in (self.control_pid(), self.process.pid):
            with contextlib.suppress(ProcessLookupError):
                if pid:
                    os.kill(pid, signal.SIGCONT)
                    os.kill(pid, signal.SIGKILL)
        self.process.wait()
        sys.stdout.write(self.output())  # pytest shows it with a test that fails
        self._notify.close()
        shutil.rmtree(self.directory, ignore_errors=True)

    def wait_ready(self) -> Daemon:
        """Return when the daemon has said that it ticks; where it does not, it ends."""
        try:
            self.notified("READY=1")
        except BaseException:  # nothing else would end it: `with Daemon(...).wait_ready()` has not begun
            self.__exit__()
            raise
        return self

    def notified(self, line: str) -> None:
        """Return when the daemon has sent this line to systemd."""
        end_s = time.monotonic() + PATIENCE_S
        self._notify.settimeout(0.2)
        while time.monotonic() < end_s:
            with contextlib.suppress(TimeoutError):
                if line in self._notify.recv(4096).decode().splitlines():
                    return
            assert self.process.poll() is None, f"the daemon ended before {line}: {self.output()}"
        raise AssertionError(f"no {line} from the daemon: {self.output()}")

    def ask(self, do: str) -> str:
        """What it refuses a command with; "" when it obeys. As `hapticd` asks, without a program that starts for it."""
        end_s = time.monotonic() + 4.0 * PATIENCE_S
        with zmq.Context() as context, context.socket(zmq.DEALER) as control:
            control.linger = 0
            control.connect(f"ipc://{self.directory}/run/default/control")
            control.send(msgpack.packb({"do": do}))
            while not control.poll(200):
                assert self.process.poll() is None or control.poll(200), f"the daemon ended: {self.output()}"
                assert time.monotonic() < end_s, f"no answer to {do}: {self.output()}"
            answer = msgpack.unpackb(control.recv())
        return "" if answer["ok"] else str(answer["text"])

    def output(self) -> str:
        return self.log.read_text()

    def control_pid(self) -> int:
        """Process of the control loop; 0 when there is none."""
        for entry in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                command = (entry / "cmdline").read_bytes().split(b"\0")
                if b"hapticd.loop.process" in command and str(self.process.pid).encode() in command:
                    return int(entry.name)
        return 0

    def memory(self, axes: int = 1) -> SharedMemory:
        """The control process's shared memory, which outlives it while we hold it."""
        pid = self.control_pid()
        for link in Path(f"/proc/{pid}/fd").iterdir():
            if str(link.readlink()) == "/memfd:hapticd (deleted)":
                layout = RecordLayout(axes, False, 8)
                return SharedMemory(layout, 1000.0, os.open(link, os.O_RDWR | os.O_CLOEXEC))
        raise AssertionError("the control process has no shared memory")

    def wait_exit(self) -> int:
        return self.process.wait(PATIENCE_S)


class Subscriber:
    """A subscriber with no code of hapticd in it."""

    def __init__(self, endpoint: str, *topics: str) -> None:
        self.context = zmq.Context()
        self.socket = self.context.socket(zmq.SUB)
        self.socket.setsockopt(zmq.RCVHWM, 0)
        for topic in topics or ("hapticd/",):
            self.socket.setsockopt(zmq.SUBSCRIBE, topic.encode())
        self.socket.connect(endpoint)

    def __enter__(self) -> Subscriber:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close(0)
        self.context.term()

    def maps(self, patience_s: float = PATIENCE_S) -> Iterator[tuple[str, dict[str, Any]]]:
        """Topic and map of everything that comes; ends when nothing has come for so long."""
        while self.socket.poll(int(patience_s * 1e3)):
            topic, payload = self.socket.recv_multipart()
            for fields in msgpack.unpackb(payload):
                yield topic.decode(), fields

    def until(self, topic: str, **wanted: Any) -> dict[str, Any]:
        """The next map of a topic that has these values."""
        end_s = time.monotonic() + 2.0 * PATIENCE_S
        for name, fields in self.maps():
            if name == topic and all(fields[key] == value for key, value in wanted.items()):
                return fields
            if time.monotonic() > end_s:  # others may come for ever
                break
        raise AssertionError(f"no {topic} with {wanted} came")


def all_records(memory: SharedMemory) -> list[TickRecord]:
    """Every record that the ring still holds."""
    reader = RecordReader(memory)
    reader._next = max(0, memory.words[RECORDS] - memory.slots + 2)
    return reader.read(memory.slots)


def child_pid(pid: int, word: str) -> int:
    """The child of a process that has this word on its command line."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return next(int(child) for child in children if word in Path(f"/proc/{child}/cmdline").read_text().split("\0"))


def gone(pid: int) -> bool:
    """Whether a process has ended (a zombie has)."""
    try:
        return _state(pid) == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


def sleeps(pid: int) -> bool:
    """Whether a process waits for something, as for a signal or for what it reads."""
    return _state(pid) == "S"


def _state(pid: int) -> str:
    return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]


def wait_until(condition: Any, what: str) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s, f"waited in vain for: {what}"
        time.sleep(0.005)
