"""`hapticd watch`: a live view of a running daemon, as a picture, as lines or as JSON."""

from __future__ import annotations

import io
import json
import math
import os
import re
import select
import signal
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer
from rich.console import Console, Group
from rich.live import Live

from hapticd.cli.local_time import moment
from hapticd.cli.remote import Instance, Keys
from hapticd.cli.watch.screen import SILENT_S, frame, one_line
from hapticd.cli.watch.state import ScreenState
from hapticd.client import Client, Event, Record, SilenceError, Status
from hapticd.errors import ConfigError, HapticdError
from hapticd.paths import DEFAULT_INSTANCE, telemetry_endpoint
from hapticd.replacing import place

FRAME_S = 0.1
"""Time between two pictures [s]."""

_PATIENCE_S = 3.0  # for a daemon, when one answer is all that was asked for
_GATHER_S = 1.0  # what a single picture shows of its traces
_KEEP_S = 4.0  # what a kept picture shows
_LOOK_AGAIN_S = 1.0  # a daemon may come up elsewhere than where this one first looked
_SHOWN = ("position", "energy", "damping", "contact", "cycle", "event", "status")


def watch(
    instance: Instance = DEFAULT_INSTANCE,
    connect: Annotated[
        str | None,
        typer.Option(
            "--connect",
            metavar="ENDPOINT",
            help="Where it publishes, ipc://PATH or tcp://HOST:PORT; the instance's own when not given.",
        ),
    ] = None,
    keys: Keys = None,
    once: Annotated[bool, typer.Option("--once", help="Print one picture and exit.")] = False,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="Keep four seconds as an SVG picture of 80x24 characters and exit.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the picture if it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print every status as a line of JSON.")] = False,
) -> None:
    """Show live what a running daemon measures.

    Waits for a daemon, and finds it again after a restart. Ends with q or Ctrl-C. Prints one plain line a second when
    the output is no terminal. With --once it waits 3 s for a daemon and exits with 1 when none answers.

    Example: hapticd watch --instance default
    """
    if picture is not None:
        if picture.suffix != ".svg":
            raise ConfigError(f"{picture}: must end in .svg")
        place(picture, overwrite)
    with suppress(KeyboardInterrupt):
        show(connect, instance, keys, once=once, picture=picture, as_json=as_json)


def show(
    endpoint: str | None = None,
    instance: str = DEFAULT_INSTANCE,
    keys: Path | None = None,
    *,
    once: bool = False,
    picture: Path | None = None,
    as_json: bool = False,
    stop: Callable[[], bool] = lambda: False,
) -> None:
    """Show a daemon until the user has seen enough.

    Args:
        endpoint: where it publishes; None: the instance's own, looked for again while there is no daemon.
        instance: name of the daemon's instance, when no endpoint is given.
        keys: key file for the endpoint of another computer; None: the one that $HAPTICD_KEYS names, if any.
        once: one picture or one line of JSON, then end.
        picture: where to keep one picture as SVG, then end.
        as_json: statuses as JSON and nothing else.
        stop: ends the view when it returns true; asked at every picture.

    Raises:
        SilenceError: `once` or `picture`, and no daemon answered.
        UnwritableError: the picture cannot be written.
        RefusedKeyError: the daemon does not list this key.
        SchemaError, WireError: what answers speaks otherwise.
        KeyboardInterrupt: Ctrl-C.
    """
    console = Console(highlight=False)
    with _Feed(endpoint, instance, keys, ("status",) if as_json else _SHOWN) as feed:
        if picture is not None:
            _keep(feed, picture)
        elif as_json:
            _print_json(feed, once, stop)
        elif once:
            _print_once(feed, console)
        elif console.is_terminal and not console.is_dumb_terminal and not console.options.ascii_only:
            _live(feed, console, stop)
        else:
            _print_lines(feed, stop)


class UnwritableError(HapticdError):
    """A file that cannot be written."""


class _Feed:
    """What is known of a daemon, and where it comes from."""

    def __init__(self, endpoint: str | None, instance: str, keys: Path | None, topics: tuple[str, ...]) -> None:
        self.known = ScreenState()
        self._given = endpoint
        self._instance = instance
        self._keys = keys
        self._topics = topics
        self._client = self._connect()
        self._look_again_s = time.monotonic() + _LOOK_AGAIN_S

    def __enter__(self) -> _Feed:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()

    @property
    def endpoint(self) -> str:
        return self._client.endpoint

    @property
    def doubt(self) -> str:
        return self._client.doubt

    def silent(self) -> bool:
        """Whether there is no daemon, or none any more."""
        return time.monotonic() - self.known.heard_s > SILENT_S

    def drain(self, timeout_s: float = 0.0) -> list[Record]:
        """Take all that has come; wait for the first until `timeout_s` is over."""
        taken: list[Record] = []
        records = self._client.receive(timeout_s)
        while records:
            taken += records
            records = self._client.receive(0.0)
        now_s = time.monotonic()
        self.known.take(taken, now_s)
        if self._given is None and now_s > self._look_again_s and self.silent():
            self._look_again_s = now_s + _LOOK_AGAIN_S
            if telemetry_endpoint(self._instance) != self._client.endpoint:
                self._client.close()
                self._client = self._connect()
        return taken

    def first(self) -> None:
        """Wait for a daemon.

        Raises:
            SilenceError: there is none.
        """
        end_s = time.monotonic() + _PATIENCE_S
        while self.known.status is None:
            if time.monotonic() > end_s:
                raise SilenceError(
                    f"{self.endpoint}: no daemon answers{self.doubt or '; start one with `hapticd run`'}"
                )
            self.drain(0.1)

    def _connect(self) -> Client:
        return Client(self._given, instance=self._instance, topics=self._topics, keys=self._keys)


def _live(feed: _Feed, console: Console, stop: Callable[[], bool]) -> None:
    """Draw on the terminal's other screen until q."""
    with _keys() as pressed, Live(console=console, screen=True, auto_refresh=False) as live:
        try:
            while not stop() and "q" not in pressed(FRAME_S).lower():
                feed.drain()
                width, height = console.size
                lines = frame(feed.known, feed.endpoint, width, height, time.monotonic())
                live.update(Group(*lines), refresh=True)
        finally:
            live.update("", refresh=True)  # a terminal that was resized during the view would bring some of it back


@contextmanager
def _keys() -> Iterator[Callable[[float], str]]:
    """What is typed, as it is typed; the terminal is given back as it was, also after SIGTERM."""
    descriptor = sys.stdin.fileno() if sys.stdin.isatty() else -1

    def pressed(timeout_s: float) -> str:
        if descriptor < 0:
            time.sleep(timeout_s)
            return ""
        ready, _, _ = select.select([descriptor], [], [], timeout_s)
        return os.read(descriptor, 64).decode(errors="replace") if ready else ""

    def interrupt(_signal: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    settings = termios.tcgetattr(descriptor) if descriptor >= 0 else []
    try:
        if descriptor >= 0:
            tty.setcbreak(descriptor)
        yield pressed
    finally:
        if descriptor >= 0:
            termios.tcsetattr(descriptor, termios.TCSADRAIN, settings)
        signal.signal(signal.SIGTERM, before)


def _keep(feed: _Feed, path: Path) -> None:
    """Write what a terminal of the usual size would show as SVG."""
    feed.first()
    end_s = time.monotonic() + _KEEP_S
    while time.monotonic() < end_s:
        feed.drain(0.05)
    paper = Console(width=80, height=24, record=True, file=io.StringIO(), force_terminal=True, color_system="truecolor")
    paper.print(Group(*frame(feed.known, feed.endpoint, 80, 24, time.monotonic())))
    # A picture should show the same without a network: no fonts from elsewhere.
    drawn = re.sub(r"@font-face \{.*?\}\s*", "", paper.export_svg(title="hapticd watch"), flags=re.DOTALL)
    try:
        path.write_text(drawn)
    except OSError as error:
        raise UnwritableError(f"{path}: {error.strerror}") from error


def _print_once(feed: _Feed, console: Console) -> None:
    feed.first()
    end_s = time.monotonic() + _GATHER_S
    while time.monotonic() < end_s:
        feed.drain(0.05)
    height = console.height - 1 if console.is_terminal else 24
    for line in frame(feed.known, feed.endpoint, console.width, height, time.monotonic()):
        line.rstrip()
        console.print(line)


def _print_json(feed: _Feed, once: bool, stop: Callable[[], bool]) -> None:
    if once:
        feed.first()
        _say(json.dumps(asdict(_status(feed))))
        return
    while not stop():
        for record in feed.drain(1.0):
            if isinstance(record, Status):
                _say(json.dumps(asdict(record)))


def _print_lines(feed: _Feed, stop: Callable[[], bool]) -> None:
    """One line a second, events as they come, and a word when the daemon comes or goes."""
    due_s = time.monotonic() + 1.0
    silent = False
    told_s = -math.inf
    while not stop():
        events = [record for record in feed.drain(0.1) if isinstance(record, Event)]
        for event in events:
            _say(f"{moment(event.timestamp)}  event {event.code}  {event.text}")
        if time.monotonic() < due_s:
            continue
        due_s += 1.0
        if not feed.silent() and feed.known.status is not None:
            if feed.known.heard_s > told_s:  # else the line would be that of before, as if the daemon still said so
                _say(one_line(feed.known))
            told_s = feed.known.heard_s
            silent = False
        elif not silent:
            typer.echo(f"waiting for a daemon on {feed.endpoint}{feed.doubt}", err=True)
            silent = True


def _status(feed: _Feed) -> Status:
    assert feed.known.status is not None
    return feed.known.status


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()
