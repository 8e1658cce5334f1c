"""The configuration file taken over by a running daemon: what of it may change, the request that tells the loop."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from hapticd.config.file import read
from hapticd.config.loading import LoadedConfig, parse
from hapticd.config.problems import key_path, shown_value
from hapticd.errors import ConfigError, HapticdError
from hapticd.keys.policy import key_ring
from hapticd.supervisor.file_watch import FileWatcher
from hapticd.supervisor.request_queue import Answer
from hapticd.supervisor.state import DaemonState
from hapticd.tick.event import EventCode

LIVE: Final = (
    "scene",
    "controller",
    "safety",
    "telemetry.batch_ticks",
    "telemetry.every_ticks",
    "telemetry.input_every_tick",
    "remote.lease_s",
    "faults",
    "service",
)
"""Tables and keys that may change while the loop runs; everything else needs a restart."""

CLOSE_S = 1.0
"""How long a law that is being imported may hold up the end of the daemon [s]."""

CHECK_S = 120.0
"""How long a law may take to be imported before the file that names it counts as one that cannot be used [s]."""

_NO_THREAD = "no thread can be started; free memory, or raise the limit of processes (ulimit -u, TasksMax=), and retry"


class Reload:
    """Takes the file over, when somebody asks or, where the file says so, when it is saved; one at a time.

    Args:
        state: the daemon.
    """

    def __init__(self, state: DaemonState) -> None:
        self._state = state
        self._under_way = False
        self._reading: _Reading | None = None
        self._answers: list[Answer] = []
        self._watcher: FileWatcher | None = None
        self._follow()

    def turn(self) -> None:
        """Begin or go on with what was asked for, or what was saved; returns at once.

        A file that cannot be used changes nothing, and neither does any file before its verdict is known.
        """
        if self._under_way:
            return
        state = self._state
        if self._reading is None and state.reload_asked:
            self._answers, state.reload_asked = state.reload_asked, []
            try:
                self._reading = _Reading(state.config.path)
            except RuntimeError:
                answers, self._answers = self._answers, []
                self._refuse(f"{state.config.path}: cannot be read: {_NO_THREAD}", answers)
                return
        if self._reading is not None:
            read_now = self._reading.outcome
            if read_now is None:
                if time.monotonic() < self._reading.give_up_s:
                    return
                read_now = HapticdError(f"{state.config.path}: could not be checked within {CHECK_S:g} s")
            answers, self._answers, self._reading = self._answers, [], None
            if isinstance(read_now, HapticdError):
                self._refuse(str(read_now), answers)
            else:
                self._begin(read_now, answers)
            return
        self._follow()
        saved = self._watcher.take() if self._watcher is not None else None
        if isinstance(saved, ConfigError):
            self._refuse(str(saved), [])
        elif saved is not None and saved.text != state.config.text:
            self._begin(saved, [])

    def close(self) -> None:
        """Look at the file no more; the daemon ends."""
        for answer in [*self._answers, *self._state.reload_asked]:
            answer("the daemon has stopped")
        if self._reading is not None:
            self._reading.join(CLOSE_S)
        if self._watcher is not None:
            self._watcher.close()
            self._watcher.wait_closed()

    def _begin(self, wanted: LoadedConfig, answers: list[Answer]) -> None:
        state = self._state
        state.notifier.send("RELOADING=1", f"MONOTONIC_USEC={time.monotonic_ns() // 1000}")
        problems = [*needs_restart(state.config, wanted)]
        try:
            ring = key_ring(wanted)
        except HapticdError as error:
            problems.append(str(error))
        if problems:
            self._refuse("\n".join(problems), answers)
            return

        def finish(verdict: str) -> None:
            self._under_way = False
            if verdict:
                self._refuse(f"{wanted.path}: {verdict}", answers)
                return
            state.adopt(wanted, ring)
            self._follow()
            state.ready_due = True
            for answer in answers:
                answer("")

        self._under_way = True
        if state.recovery.lost:
            if _meaning(wanted) != _meaning(state.config):
                state.recovery.stop()  # a try that is under way has the file of before
            resume = replace(state.recovery.resume, fields=0)  # a reload reads them anew
            if state.config.config.controller.law != wanted.config.controller.law:
                resume = replace(resume, law_code=0)
            other_law = not same_law(state.config, wanted)
            state.recovery.amend(replace(resume, law=resume.law + other_law))
            state.recovery.hurry()
            text = f"configuration {wanted.hash}: in force when the device is back"
            state.tell(EventCode.SWITCHED, text)
            finish("")
        else:
            state.requests.submit(switch_request(state.config, wanted), finish)

    def _refuse(self, why: str, answers: list[Answer]) -> None:
        state = self._state
        text = f"configuration refused, nothing changed: {why}"
        state.tell(EventCode.REFUSED, text)
        state.ready_due = True
        for answer in answers:
            answer(why)

    def _follow(self) -> None:
        """Look at the file, or not, as it says itself."""
        wanted = self._state.config.config.service.reload_on_save
        if wanted and self._watcher is None:
            with contextlib.suppress(RuntimeError):  # there is no thread to be had: tried again in the next turn
                self._watcher = FileWatcher(self._state.config.path)
        elif self._watcher is not None and not wanted:
            self._watcher.close()
            self._watcher = None


class _Reading(threading.Thread):
    """A file read and checked in a thread of its own: to check a law is to import it, which may take its time.

    Attributes:
        outcome: what it says, or why it cannot be used; None as long as that is not known.
        give_up_s: until when there should be one, on CLOCK_MONOTONIC [s].
    """

    def __init__(self, path: Path) -> None:
        super().__init__(name="reload", daemon=True)
        self.outcome: LoadedConfig | HapticdError | None = None
        self.give_up_s = time.monotonic() + CHECK_S
        self._path = path
        self.start()

    def run(self) -> None:
        try:
            self.outcome = parse(read(self._path, files_only=True), str(self._path))
        except HapticdError as error:
            self.outcome = error
        except Exception as error:  # noqa: BLE001 - whatever a plug-in's checks raise, a verdict has to come
            self.outcome = HapticdError(f"{self._path}: cannot be checked: {type(error).__name__}: {error}")


def needs_restart(now: LoadedConfig, wanted: LoadedConfig) -> Iterator[str]:
    """A line for each key that differs and that only a restart can change."""
    for key, old, new in _differences(_meaning(now), _meaning(wanted), ()):
        name = key_path(key)
        if not any(name == live or name.startswith((f"{live}.", f"{live}[")) for live in LIVE):
            yield f"{wanted.path}: {name} = {_shown(new)}: needs a restart, {_shown(old)} is in force"


def same_law(now: LoadedConfig, wanted: LoadedConfig) -> bool:
    """Whether the law and what its parameters mean are the same."""
    return now.config.controller.law == wanted.config.controller.law and now.params == wanted.params


def switch_request(now: LoadedConfig, wanted: LoadedConfig) -> dict[str, Any]:
    """The request to the loop."""
    settings = wanted.config
    return {
        "do": "switch",
        "law": settings.controller.law,
        "params": wanted.params.model_dump(),
        "scene": settings.scene.model_dump(),
        "safety": settings.safety.model_dump(),
        "keep_law": same_law(now, wanted),
        "was": now.config.controller.law,
        "config": wanted.hash,
    }


def _meaning(loaded: LoadedConfig) -> dict[str, Any]:
    """Every key with its value, defaults filled in."""
    tables = loaded.config.model_dump()
    tables["device"]["options"] = loaded.options.model_dump()
    return tables


def _differences(old: object, new: object, at: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], object, object]]:
    if isinstance(old, dict) and isinstance(new, dict):
        for key in [*old, *(key for key in new if key not in old)]:
            yield from _differences(old.get(key), new.get(key), (*at, key))
    elif old != new:
        yield at, old, new


def _shown(value: object) -> str:
    return "not set" if value is None else shown_value(value)
