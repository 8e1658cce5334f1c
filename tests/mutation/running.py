"""Run a room's tests on copies of the tree with one slip each; the checkout itself is never changed.

    python -m tests.mutation.running guard energy --slips 40 --seed 1

mutmut and cosmic-ray were looked at. The one puts a switch around every function, whose source the compiler of the laws
then reads instead of the function's own; the other changes the checkout in place, one slip after the other. Neither
draws a sample by a seed. What a slip is comes from `tests.simulation.mutants`, as for kernel and tick.
"""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from typing import cast

import pytest

from tests.mutation.harmless import HARMLESS
from tests.mutation.order import Experience, InOrder, Told
from tests.mutation.reach import Follower, Reach, file_of
from tests.mutation.rooms import ROOMS, Room
from tests.mutation.slips import Slip, slips

ROOT = Path(__file__).parents[2]
SOURCES = ("hapticd", "drivers", "controllers", "studies", "benchmarks", "views")
COPIED = (*SOURCES, "tests", "config", "docs", "systemd", "pyproject.toml", "README.md", "CHANGELOG.md", "Makefile")
PARALLEL = 2
LIKELIEST = 30
"""So many tests run before the others are read."""

LEAST_S = 60.0
"""Shortest time limit of a run [s]; a run that takes longer than five times that of the tree as it is has noticed."""

_PRELOADED = "ignore:Module already imported:pytest.PytestAssertRewriteWarning"
_FORKS = multiprocessing.get_context("forkserver")  # what takes long to import, and is in no tree, is imported once
_FORKS.set_forkserver_preload(["pytest", "hypothesis", "numpy", "numba", "pydantic", "tomlkit", "msgpack", "zmq"])


@dataclass(frozen=True, slots=True)
class Task:
    """What a process does that runs tests.

    Attributes:
        arguments: of pytest.
        known: of the tests.
        order: those that are to run; none: all.
        follow: files whose lines are noted, test by test.
    """

    arguments: tuple[str, ...]
    known: Experience
    order: Sequence[str] = ()
    follow: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of the slips of a room.

    Attributes:
        made: how many were tried.
        survivors: those that no test noticed and that are not known to change nothing.
        harmless: those that no test noticed and that change nothing.
    """

    made: int
    survivors: list[Slip]
    harmless: list[Slip]

    @property
    def share_found(self) -> float:
        """Found, of those that change something."""
        telling = self.made - len(self.harmless)
        return 1.0 - len(self.survivors) / telling if telling else 1.0

    def __str__(self) -> str:
        found = self.made - len(self.survivors) - len(self.harmless)
        return (
            f"{self.made} slips: {found} found, {len(self.harmless)} change nothing, {len(self.survivors)} survive: "
            f"{100.0 * self.share_found:.1f} % found"
        )


def sample(room: Room, count: int, seed: int) -> list[Slip]:
    """So many slips of a room, drawn at random; all of them where there are no more."""
    all_slips = [slip for file in room.files for slip in slips(ROOT, file)]
    return random.Random(seed).sample(all_slips, min(count, len(all_slips)))


def judge(
    room: Room,
    chosen: Sequence[Slip],
    parallel: int = PARALLEL,
    progress: Callable[[Slip, bool], None] = lambda _slip, _lives: None,
) -> Verdict:
    """Try slips, several at a time.

    Args:
        room: where they are.
        chosen: the slips.
        parallel: how many copies of the tree there are.
        progress: told of each slip whether it lives.

    Raises:
        RuntimeError: the tests fail on the tree as it is.
    """
    known = Experience()
    with tempfile.TemporaryDirectory(prefix="mutation-") as place:
        tree = _copy(Path(place) / "0")
        known.reach = _followed(tree, room, known)
        started_s = time.monotonic()
        known.took_s = _without_slip(tree, room, known)
        limit_s = max(LEAST_S, 5.0 * (time.monotonic() - started_s))
        free: SimpleQueue[Path] = SimpleQueue()
        free.put(tree)
        for number in range(1, parallel):
            free.put(shutil.copytree(tree, Path(place) / str(number)))

        def survives(slip: Slip) -> bool:
            mine = free.get()
            file = mine / slip.file
            source, stamp = file.read_text(), file.stat()
            try:
                file.write_text(slip.into(source))
                lives = _lives(mine, known, known.order({(slip.file, line) for line in slip.lines(source)}), limit_s)
                progress(slip, lives)
                return lives
            finally:
                file.write_text(source)
                os.utime(file, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))  # its bytecode is good once more
                free.put(mine)

        with ThreadPoolExecutor(parallel) as pool:
            alive = [slip for slip, lives in zip(chosen, pool.map(survives, chosen), strict=True) if lives]
    harmless = [slip for slip in alive if str(slip) in HARMLESS]
    return Verdict(len(chosen), [slip for slip in alive if slip not in harmless], harmless)


def told(survivors: Iterable[Slip]) -> str:
    """The survivors, each with what it changes."""
    return "\n\n".join(f"{slip}\n{slip.diff((ROOT / slip.file).read_text())}" for slip in survivors)


def _copy(to: Path) -> Path:
    to.mkdir()
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, to / name, ignore=shutil.ignore_patterns("__pycache__", "build", "node_modules"))
        else:
            shutil.copy(source, to / name)
    return to


def _followed(tree: Path, room: Room, known: Experience) -> Reach:
    """What the tests of a room come by; to be followed makes them slow, so what they find is not asked."""
    told = _run(tree, Task(room.asked, known, follow=room.files), 3600.0)
    if told is None or told.reach is None or not told.reach.lines:
        raise RuntimeError(f"cannot be followed: {' '.join(room.tests)}")
    return told.reach


def _without_slip(tree: Path, room: Room, known: Experience) -> dict[str, float]:
    """How long each test takes on the tree as it is, in the order in which they run on one that has a slip [s]."""
    told = _run(tree, Task((*room.asked, "-x"), known, known.order()), 3600.0)
    if told is None or told.failed or not told.took_s:
        failed = " ".join(told.failed if told else room.tests)
        raise RuntimeError(f"fails without any slip: {failed}")
    return told.took_s


def _lives(tree: Path, known: Experience, order: Sequence[str], limit_s: float) -> bool:
    """Whether no test notices; those that are likeliest to run alone, since reading all the others takes its time."""
    for names in (order[:LIKELIEST], order[LIKELIEST:]):
        if names:
            told = _run(tree, Task(("-x", *dict.fromkeys(map(file_of, names))), known, names), limit_s)
            known.noticed.update(told.failed[:1] if told else ())
            if told is None or told.failed:
                return False
    return True


def _run(tree: Path, task: Task, limit_s: float) -> Told | None:
    """Run tests on a tree; None where that ended early or took longer than the limit."""
    hearing, telling = _FORKS.Pipe(duplex=False)
    running = _FORKS.Process(target=_run_tests, args=(tree, task, telling))
    running.start()
    telling.close()
    with hearing, contextlib.suppress(EOFError):
        told: Told | None = hearing.recv() if hearing.poll(limit_s) else None
        running.join(limit_s if told else 0.0)
        if running.exitcode in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
            return told
    with contextlib.suppress(ProcessLookupError):
        os.killpg(cast("int", running.pid), signal.SIGKILL)
    running.kill()
    running.join()
    return None


def _run_tests(tree: Path, task: Task, telling: Connection) -> None:
    """What a process does that was forked for it: nothing of the tree has been imported yet."""
    os.setsid()
    os.chdir(tree)
    paths = [str(tree / source) for source in ("", *SOURCES[1:])]
    sys.path[:0] = paths
    no_bytecode = not task.follow  # what is on the tree as it is stays good for those with a slip
    os.environ |= {
        "PYTHONPATH": os.pathsep.join(paths),
        "PYTHONDONTWRITEBYTECODE": "1" if no_bytecode else "",
        "CI": "false",
    }
    sys.dont_write_bytecode = no_bytecode
    with Path(os.devnull).open("w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    loaded = [name for name in sys.modules if name.startswith("hapticd")]
    assert not loaded, loaded
    follower = Follower(tree, task.follow) if task.follow else None
    plugins = [InOrder(task.known, task.order, follower, telling), *([follower] if follower else [])]
    arguments = ("-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-W", _PRELOADED, *task.arguments)
    os._exit(pytest.main(list(arguments), plugins))


def _tell(slip: Slip, lives: bool) -> None:
    if lives and str(slip) not in HARMLESS:
        sys.stderr.write(f"survives: {slip}\n{slip.diff((ROOT / slip.file).read_text())}\n")
    else:
        sys.stderr.write(".")
    sys.stderr.flush()


def main() -> None:
    """Try a sample of each room that is named, and list what survives."""
    parser = argparse.ArgumentParser()
    parser.add_argument("rooms", nargs="*", default=list(ROOMS))
    parser.add_argument("--slips", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--parallel", type=int, default=PARALLEL)
    arguments = parser.parse_args()
    for name in arguments.rooms:
        verdict = judge(ROOMS[name], sample(ROOMS[name], arguments.slips, arguments.seed), arguments.parallel, _tell)
        sys.stdout.write(f"{name}: {verdict}\n{told(verdict.survivors)}\n\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
