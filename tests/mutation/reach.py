"""Which tests come by which lines of a room: only those can notice a slip there, and those that hide what they run."""

from __future__ import annotations

import sys
import threading
from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest

Line = tuple[str, int]
"""A file below the root, and a number."""

MOST_CALLS = 20_000
"""After so many calls a test is not followed any more, which is slow: from then on it may come by any line."""

COMPILER = "/numba/"
"""In the path of what compiles laws and shapes, whose lines are not seen then."""


@dataclass(slots=True)
class Reach:
    """What the tests of a room come by.

    Attributes:
        lines: of each test, those of the room's files.
        of_all: those that are run as tests are read.
        hidden: files of tests that start processes, compile or run for long: they may come by any line.
    """

    lines: defaultdict[str, set[Line]] = field(default_factory=lambda: defaultdict(set))
    of_all: set[Line] = field(default_factory=set)
    hidden: set[str] = field(default_factory=set)

    def tests(self, lines: Collection[Line]) -> set[str]:
        """The tests that come by one of these lines themselves."""
        return {name for name, seen in self.lines.items() if not seen.isdisjoint(lines)}

    def files(self, lines: Collection[Line]) -> set[str]:
        """The files of tests of which one may come by them; a fixture or a cache serves the others of its file."""
        if not lines or not self.of_all.isdisjoint(lines):
            return {file_of(name) for name in self.lines}
        return self.hidden | {file_of(name) for name in self.tests(lines)}


class Follower:
    """A plugin of pytest: notes which lines are run as tests are read, and which each test comes by.

    Args:
        tree: the root of the copy of the tree.
        files: of the room, below it.

    Attributes:
        reach: what was noted.
        follows: whether tests are followed.
    """

    def __init__(self, tree: Path, files: Collection[str]) -> None:
        self.reach = Reach()
        self._files = {str(tree / file): file for file in files}
        self._home: dict[CodeType, str] = {}
        self._lines = self.reach.of_all
        self._test = ""
        self._calls = 0
        self.follows = False
        sys.addaudithook(self._hear)
        if files:
            sys.settrace(self._enter)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Any:
        """Follow this test, with what it sets up and clears away."""
        if not self.follows:
            return (yield)
        self._test = item.nodeid
        self._lines = self.reach.lines[item.nodeid]
        self._calls = 0
        threading.settrace(self._enter)
        sys.settrace(self._enter)
        try:
            return (yield)
        finally:
            self._lines = self.reach.of_all

    def _hear(self, event: str, _arguments: tuple[Any, ...]) -> None:
        if event in ("subprocess.Popen", "os.fork", "os.posix_spawn"):
            self._hides()

    def _hides(self) -> None:
        if self._test:
            self.reach.hidden.add(file_of(self._test))

    def _enter(self, frame: FrameType, _event: str, _argument: Any) -> Any:
        self._calls += 1
        if self._calls > MOST_CALLS and self._test:
            self._hides()
            sys.settrace(None)
            return None
        code = frame.f_code
        file = self._home.get(code)
        if file is None:
            path = code.co_filename
            file = self._home[code] = COMPILER if COMPILER in path else self._files.get(path, "")
        if not file:
            return None
        if file is COMPILER:
            self._hides()
            return None

        def follow(frame: FrameType, event: str, _argument: Any) -> Any:
            if event == "line":
                self._lines.add((file, frame.f_lineno))
            return follow

        return follow


def file_of(name: str) -> str:
    """The file of a test."""
    return name.split("::")[0]
