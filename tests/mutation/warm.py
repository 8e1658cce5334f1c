"""A process that has read a room's tests on a copy of the tree, and forks for each run of them.

To import and to read tests takes longer than to run those that notice a slip. What a slip changes is put into the
functions that are there already; where it would have changed what is made as modules are imported, a process begins
anew on the changed tree.
"""

from __future__ import annotations

import contextlib
import gc
import linecache
import multiprocessing
import os
import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from types import CodeType, FunctionType
from typing import cast

import pytest
from hypothesis import Phase, settings

from tests.mutation.reach import Follower, Reach

SOURCES = ("hapticd", "drivers", "controllers", "studies", "benchmarks", "views")
"""Where packages are, in a tree."""

_PRELOADED = "ignore:Module already imported:pytest.PytestAssertRewriteWarning"
_ARGUMENTS = ("-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-W", _PRELOADED)
_READING_S = 600.0
_FORKS = multiprocessing.get_context("forkserver")  # what takes long to import, and is in no tree, is imported once
_FORKS.set_forkserver_preload(["pytest", "hypothesis", "numpy", "numba", "pydantic", "tomlkit", "msgpack", "zmq"])


@dataclass(frozen=True, slots=True)
class Task:
    """A run of tests.

    Attributes:
        limits_s: the tests in their order, each with its time limit [s]; none: all, as they come.
        limit_s: of the run [s].
        until_one_fails: those after it do not run.
        follow: whether it is noted what they come by.
        swapped: the file that has a slip now, below the root, and its text without; "" for none.
    """

    limits_s: Mapping[str, float] = field(default_factory=dict)
    limit_s: float = 3600.0
    until_one_fails: bool = True
    follow: bool = False
    swapped: tuple[str, str] = ("", "")


@dataclass(frozen=True, slots=True)
class Told:
    """What a run has to tell.

    Attributes:
        took_s: how long each test took, with what it sets up [s].
        failed: those that failed.
        reach: what they came by, where they were followed.
        unfit: a slip could not be put into what is there.
    """

    took_s: dict[str, float] = field(default_factory=dict)
    failed: list[str] = field(default_factory=list)
    reach: Reach | None = None
    unfit: bool = False


class Warm:
    """Such a process.

    Args:
        tree: the root of the copy.
        arguments: of pytest, which tests.
        follow: files below the root that are followed where that is asked; what it imports then stays as bytecode.
    """

    def __init__(self, tree: Path, arguments: tuple[str, ...], follow: tuple[str, ...] = ()) -> None:
        self._ours, theirs = _FORKS.Pipe()
        self._process = _FORKS.Process(target=_main, args=(tree, arguments, follow, theirs))
        self._process.start()
        theirs.close()
        with contextlib.suppress(EOFError):  # nothing may change in the tree before it has been read
            if self._ours.poll(_READING_S):
                self._ours.recv()

    def __enter__(self) -> Warm:
        return self

    def __exit__(self, *_: object) -> None:
        self._ours.close()
        self._process.join(10.0)
        self._process.kill()
        self._process.join()

    def run(self, task: Task) -> Told | None:
        """Run tests; None where that ended early, took longer than its limit, or no test could be read."""
        with contextlib.suppress(EOFError, ConnectionError):
            self._ours.send(task)
            if self._ours.poll(task.limit_s + 60.0):
                return cast("Told | None", self._ours.recv())
        return None


class _Server:
    """A plugin of pytest: in the place of running what was read it forks, and does as it is asked."""

    def __init__(self, tree: Path, follower: Follower, asked: Connection) -> None:
        self._tree = tree
        self._follower = follower
        self._asked = asked
        self._told = Told()

    @pytest.hookimpl(trylast=True)
    def pytest_configure(self) -> None:
        """Properties get the same examples every time and are not made small: that one fails is all that is asked."""
        phases = (Phase.explicit, Phase.generate)
        settings.register_profile("slips", settings.default, phases=phases, derandomize=True, database=None)
        settings.load_profile("slips")

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Fork for each task, until there are no more."""
        sys.settrace(None)
        if not session.testsfailed:
            self._asked.send(None)
        with contextlib.suppress(EOFError):
            while not session.testsfailed:
                task: Task = self._asked.recv()
                self._asked.send(self._forked(session, task))
        return True

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """What a test, its setting up and its clearing away took."""
        self._told.took_s[report.nodeid] = self._told.took_s.get(report.nodeid, 0.0) + report.duration
        if report.failed:
            self._told.failed.append(report.nodeid)

    def _forked(self, session: pytest.Session, task: Task) -> Told | None:
        hearing, telling = multiprocessing.Pipe(duplex=False)
        pid = os.fork()
        if pid == 0:
            with contextlib.suppress(BaseException):
                os.setsid()
                items = self._ready(session, task)
                telling.send(None)
                telling.send(self._run(items, task))
            os._exit(0)
        telling.close()
        told: Told | None = Told(unfit=True)
        with hearing, contextlib.suppress(EOFError):
            hearing.recv()
            told = None  # what ends it from here on is the slip
            told = hearing.recv() if hearing.poll(task.limit_s) else None
        if told is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        return told

    def _ready(self, session: pytest.Session, task: Task) -> list[pytest.Item]:
        if task.swapped[0]:
            os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
            sys.dont_write_bytecode = True
            swap(self._tree / task.swapped[0], task.swapped[1])
        self._follower.follows = task.follow
        items = {item.nodeid: item for item in session.items}
        for name, limit_s in task.limits_s.items():
            items[name].add_marker(pytest.mark.timeout(limit_s), append=False)
        return [items[name] for name in task.limits_s] or session.items

    def _run(self, items: Sequence[pytest.Item], task: Task) -> Told:
        for item, following in zip(items, [*items[1:], None], strict=True):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if task.until_one_fails and self._told.failed:
                break
        return Told(self._told.took_s, self._told.failed, self._follower.reach if task.follow else None)


def swap(file: Path, before: str) -> None:
    """Give every function of a file that has been imported the code that the file has now.

    Args:
        file: as it is now.
        before: its text when it was imported.

    Raises:
        ValueError: a function needs other values of the one around it than it has.
    """
    linecache.clearcache()
    was, now = (compile(text, str(file), "exec") for text in (before, file.read_text()))
    places = dict(_codes(now))
    others = {(code.co_qualname, code.co_firstlineno): places.get(place) for place, code in _codes(was)}
    for function in [each for each in gc.get_objects() if type(each) is FunctionType]:  # a dead proxy has no class
        code = function.__code__
        if code.co_filename == str(file):
            other = others.get((code.co_qualname, code.co_firstlineno))
            if other is not None:
                function.__code__ = other


def _codes(code: CodeType, at: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], CodeType]]:
    """The code of every function in it, by where it is: names, and which one of that name."""
    names: dict[str, int] = {}
    for each in code.co_consts:
        if isinstance(each, CodeType):
            names[each.co_name] = names.get(each.co_name, 0) + 1
            place = (*at, f"{each.co_name} {names[each.co_name]}")
            yield place, each
            yield from _codes(each, place)


def _main(tree: Path, arguments: tuple[str, ...], follow: tuple[str, ...], asked: Connection) -> None:
    """What the process does: nothing of the tree has been imported yet."""
    os.setsid()
    os.chdir(tree)
    paths = [str(tree / source) for source in ("", *SOURCES[1:])]
    sys.path[:0] = paths
    no_bytecode = "" if follow else "1"  # what is on the tree as it is stays good for those with a slip
    os.environ |= {"PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": no_bytecode, "CI": "false"}
    sys.dont_write_bytecode = bool(no_bytecode)
    with Path(os.devnull).open("w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    loaded = [name for name in sys.modules if name.startswith("hapticd")]
    assert not loaded, loaded
    follower = Follower(tree, follow)
    os._exit(pytest.main([*_ARGUMENTS, *arguments], [_Server(tree, follower, asked), follower]))
