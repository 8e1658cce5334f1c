"""`hapticd watch` in a real terminal of 80 x 24, fed by a real publisher."""

from __future__ import annotations

import fcntl
import itertools
import json
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pyte
import pytest

from hapticd.cli import main
from hapticd.client import Status
from hapticd.tick import event as contract
from hapticd_bench.telemetry import synthetic_records
from tests.telemetry.sockets import PATIENCE_S, Wire

HAPTICD = str(Path(sys.executable).with_name("hapticd"))
HISTOGRAM = (9000, 400, 30, 12, 0, 5, 0, 2, 0, 0, 0, 0)
STATUS = Status(
    version="1.2.3",
    instance="default",
    rate_hz=1000.0,
    measured_rate_hz=999.8,
    late_histogram=HISTOGRAM,
    late_max_us=1912.0,
    overruns=3,
    armed=True,
    law="energy-cycle",
    driver="loopback",
    device="omega7",
    simulated=True,
    device_metrics={"lost_frames": 3.0, "echo_us": 812.5},
    axes=("z",),
    wall_axis=("z",),
    wall_position_m=(0.0,),
    wall_stiffness_n_per_m=(12000.0,),
    config_hash="3fa9c2d1",
    warnings=("not real-time: no right to SCHED_FIFO",),
)


class Feed:
    """A publisher that is fed with synthetic ticks in real time by whoever waits for something."""

    def __init__(self, wire: Wire) -> None:
        self.wire = wire
        self.paused = False
        self._records = synthetic_records(0)
        self._start_s = time.monotonic()
        self._published = 0
        self._status_due_s = 0.0

    def turn(self) -> None:
        now_s = time.monotonic()
        if self.paused or self.wire.publisher._socket.closed:
            return
        due = int((now_s - self._start_s) * 1000) - self._published
        self.wire.publisher.publish(list(itertools.islice(self._records, max(0, due))))
        self._published += max(0, due)
        if now_s > self._status_due_s:
            self._status_due_s = now_s + 1.0
            self.wire.publisher.status(STATUS.as_map())


class Terminal:
    """A terminal emulator with `hapticd watch` in it."""

    def __init__(self, feed: Feed, *arguments: str, columns: int = 80, rows: int = 24) -> None:
        self.feed = feed
        self.screen = pyte.Screen(columns, rows)
        self._stream = pyte.ByteStream(self.screen)
        self._outside, self._inside = pty.openpty()
        self.resize(columns, rows)
        self.settings = termios.tcgetattr(self._inside)
        self.written = b""
        environment = {**os.environ, "TERM": "xterm-256color", "LC_ALL": "C.UTF-8", "PYTHONUTF8": "1"}
        for name in ("COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR"):
            environment.pop(name, None)
        self.process = subprocess.Popen(
            ["setsid", "--ctty", HAPTICD, "watch", *arguments],  # a terminal of its own, so that Ctrl-C reaches it
            stdin=self._inside, stdout=self._inside, stderr=self._inside, env=environment,
        )  # fmt: skip

    def __enter__(self) -> Terminal:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._outside)
        os.close(self._inside)

    @property
    def lines(self) -> list[str]:
        return [line.rstrip() for line in self.screen.display]

    @property
    def text(self) -> str:
        return "\n".join(self.lines)

    def resize(self, columns: int, rows: int) -> None:
        fcntl.ioctl(self._outside, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        self.screen.resize(rows, columns)

    def type(self, keys: bytes) -> None:
        os.write(self._outside, keys)

    def wait_for(self, condition: Callable[[], bool], what: str) -> None:
        """Feed the publisher and read the terminal until something is to be seen."""
        end_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end_s, f"waited in vain for {what} in:\n{self.text}"
            self.read()

    def shows(self, *texts: str) -> None:
        self.wait_for(lambda: all(text in self.text for text in texts), " and ".join(texts))

    def read(self) -> None:
        self.feed.turn()
        if select.select([self._outside], [], [], 0.01)[0]:
            chunk = os.read(self._outside, 65536)
            self.written += chunk
            self._stream.feed(chunk)

    def ended(self) -> int:
        """Exit code; by then the terminal must be as it was found."""
        self.wait_for(lambda: self.process.poll() is not None, "the end")
        while select.select([self._outside], [], [], 0.05)[0]:
            self.read()
        assert termios.tcgetattr(self._inside) == self.settings
        assert self.written.rfind(b"\x1b[?1049l") > self.written.rfind(b"\x1b[?1049h")
        assert self.written.rfind(b"\x1b[?25h") > self.written.rfind(b"\x1b[?25l")
        return self.process.wait()


@pytest.fixture
def feed() -> Iterator[Feed]:
    with Wire(say_status=False) as wire:
        yield Feed(wire)


def has_trace(terminal: Terminal) -> bool:
    return sum(0x2800 < ord(character) < 0x2900 for character in terminal.text) > 20


def test_one_screen_says_all_that_matters(feed: Feed) -> None:
    with Terminal(feed, "--connect", feed.wire.endpoint) as terminal:
        terminal.shows("hapticd default")
        feed.wire.publisher.event(contract.LoopEvent(103, "law none -> energy-cycle", 1, 0))
        feed.wire.publisher.event(contract.LoopEvent(204, "device lost", 1, 0))
        terminal.shows("✗ device lost", "· law none -> energy-cycle")
        terminal.wait_for(lambda: has_trace(terminal), "traces")
        terminal.shows("111 ms", "kg")
        header, warning, loop, device, boxes, *_, footer = terminal.lines
        assert header.split() == [
            *("hapticd", "default", "omega7", "loopback,", "simulated"),
            *("law", "energy-cycle", "ARMED"),
        ]
        assert "⚠ not real-time: no right to SCHED_FIFO" in warning
        assert "999.8 of 1000 Hz" in loop
        assert "max 1.91 ms" in loop
        assert " 7 ticks" in loop
        assert "skipped 3" in loop
        assert device == " device  lost_frames 3  echo_us 812.5"
        assert " position " in boxes
        assert " mm ╮" in boxes
        assert " force " in boxes
        assert boxes.endswith(" N ╮")
        assert "quit" in footer
        (wall,) = (line for line in terminal.lines if line.startswith(" wall"))
        assert "wall 0 z 12.0 kN/m" in wall
        assert "felt mass 0.253 kg" in wall
        (energy,) = (line for line in terminal.lines if line.startswith(" energy"))
        assert all(word in energy for word in ("in ", "springs", "dissipated", "generated"))
        assert len(terminal.lines) == 24


def test_q_ends_it(feed: Feed) -> None:
    with Terminal(feed, "--connect", feed.wire.endpoint) as terminal:
        terminal.shows("hapticd default")
        terminal.type(b"q")
        assert terminal.ended() == 0


def test_an_interrupt_ends_it(feed: Feed) -> None:
    with Terminal(feed, "--connect", feed.wire.endpoint) as terminal:
        terminal.shows("hapticd default")
        terminal.type(b"\x03")
        assert terminal.ended() == 0


def test_a_termination_ends_it_and_gives_the_terminal_back(feed: Feed) -> None:
    with Terminal(feed, "--connect", feed.wire.endpoint) as terminal:
        terminal.shows("hapticd default")
        terminal.process.send_signal(signal.SIGTERM)
        assert terminal.ended() == 0


def test_it_waits_for_a_daemon_and_finds_it_again_after_a_restart(feed: Feed) -> None:
    feed.wire.publisher.close()
    with Terminal(feed, "--connect", feed.wire.endpoint) as terminal:
        terminal.shows("waiting for a daemon", feed.wire.endpoint, "hapticd run")
        feed.wire.restart()
        terminal.shows("hapticd default", "ARMED")
        feed.paused = True
        terminal.shows("NO DATA FOR")
        feed.paused = False
        feed.wire.restart()
        terminal.wait_for(lambda: "ARMED" in terminal.lines[0], "the restarted daemon")


def test_an_instance_is_found_where_its_daemon_comes_up(feed: Feed, monkeypatch: pytest.MonkeyPatch) -> None:
    (feed.wire.directory / "lab").mkdir()
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(feed.wire.directory))
    with Terminal(feed, "--instance", "lab") as terminal:
        terminal.shows("waiting for a daemon", f"{feed.wire.directory}/lab/telemetry")


@pytest.mark.parametrize(("columns", "rows"), [(50, 18), (132, 43)])
def test_it_fills_whatever_size_the_terminal_has(feed: Feed, columns: int, rows: int) -> None:
    with Terminal(feed, "--connect", feed.wire.endpoint) as terminal:
        terminal.shows("hapticd default")
        terminal.resize(columns, rows)
        terminal.screen.reset()
        terminal.wait_for(lambda: has_trace(terminal) and "quit" in terminal.lines[-1], "the new size")
        assert terminal.lines[0].endswith("ARMED")
        assert len(terminal.screen.display[0]) == columns


def plain(feed: Feed, *arguments: str, until: Callable[[str], bool], **environment: str) -> str:
    """What is printed when the output is no terminal, up to where enough has come."""
    process = subprocess.Popen(
        [HAPTICD, "watch", "--connect", feed.wire.endpoint, *arguments],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env={**os.environ, **environment},
    )  # fmt: skip
    assert process.stdout is not None
    printed = b""
    end_s = time.monotonic() + PATIENCE_S
    while not until(printed.decode()):
        assert time.monotonic() < end_s, f"waited in vain, got: {printed.decode()}"
        feed.turn()
        if select.select([process.stdout], [], [], 0.01)[0]:
            chunk = os.read(process.stdout.fileno(), 65536)
            printed += chunk
            if not chunk:
                break
    process.send_signal(signal.SIGTERM)
    process.stdout.close()
    process.wait()
    return printed.decode()


def test_without_a_terminal_it_prints_a_line_a_second(feed: Feed) -> None:
    def until(printed: str) -> bool:
        feed.paused = "armed" in printed
        return "waiting for a daemon" in printed

    lines = plain(feed, until=until).splitlines()
    armed = [line for line in lines if "armed" in line]
    assert len(set(armed)) == len(armed), "what a daemon said that is silent is not said again"
    assert "\x1b" not in lines[0]
    assert "armed     energy-cycle  999.8 Hz  late 7  skipped 3  z " in lines[0]
    assert lines[0].count(" mm ") == 1
    for line in lines:
        assert re.match(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d [+-]\d{4}  |waiting", line), line


def test_without_a_terminal_it_says_that_it_waits(feed: Feed) -> None:
    feed.wire.publisher.close()
    assert plain(feed, until=lambda printed: "\n" in printed) == f"waiting for a daemon on {feed.wire.endpoint}\n"


def test_once_prints_one_picture(feed: Feed) -> None:
    printed = plain(feed, "--once", until=lambda _: False, COLUMNS="80")
    lines = printed.splitlines()
    assert len(lines) == 24
    assert max(map(len, lines)) <= 80
    assert "ARMED" in lines[0]
    assert "position" in printed


def test_a_picture_is_kept_that_fetches_nothing(feed: Feed, tmp_path: Path) -> None:
    kept = tmp_path / "watch.svg"
    plain(feed, "--picture", str(kept), until=lambda _: False)
    drawn = kept.read_text()
    assert "ARMED" in drawn
    assert "url(" not in re.sub(r"url\(#[^)]*\)", "", drawn)


def test_a_picture_replaces_no_file_unasked_and_is_called_what_it_is(
    feed: Feed, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = tmp_path / "watch.svg"
    kept.write_text("mine")
    for path, said in (
        (kept, "exists; add --overwrite to replace it"),
        (tmp_path / "watch.png", "must end in .svg"),
    ):
        with pytest.raises(SystemExit) as ended:
            main(["watch", "--picture", str(path), "--connect", feed.wire.endpoint])
        assert (ended.value.code, capsys.readouterr().err) == (2, f"hapticd: {path}: {said}\n")
    assert kept.read_text() == "mine"
    plain(feed, "--picture", str(kept), "--overwrite", until=lambda _: False)
    assert "ARMED" in kept.read_text()


def test_once_without_a_daemon_fails_with_one_line(
    feed: Feed, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    feed.wire.publisher.close()
    monkeypatch.setattr("hapticd.cli.watch.command._PATIENCE_S", 0.1)
    with pytest.raises(SystemExit) as ended:
        main(["watch", "--once", "--connect", feed.wire.endpoint])
    assert ended.value.code == 1
    text = f"hapticd: {feed.wire.endpoint}: no daemon answers; start one with `hapticd run`\n"
    assert capsys.readouterr().err == text


def test_json_is_a_line_a_status(feed: Feed) -> None:
    printed = plain(feed, "--json", until=lambda text: text.count("\n") >= 2)
    for line in printed.splitlines()[:2]:
        status: dict[str, Any] = json.loads(line)
        assert status["late_histogram"] == list(HISTOGRAM)
        assert status["warnings"] == list(STATUS.warnings)
    assert json.loads(plain(feed, "--json", "--once", until=lambda _: False))["law"] == "energy-cycle"
