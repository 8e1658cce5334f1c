"""Run a room's tests on copies of the tree with one slip each; the checkout itself is never changed.

    python -m tests.mutation.running guard energy --slips 40 --seed 1

mutmut and cosmic-ray were looked at. The one puts a switch around every function, whose source the compiler of the laws
then reads instead of the function's own; the other changes the checkout in place, one slip after the other. Neither
draws a sample by a seed. What a slip is comes from `tests.simulation.mutants`, as for kernel and tick.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from queue import SimpleQueue
from threading import Lock

from tests.mutation.harmless import HARMLESS
from tests.mutation.order import Experience
from tests.mutation.reach import Reach
from tests.mutation.rooms import ROOMS, Room
from tests.mutation.slips import Slip, slips
from tests.mutation.warm import SOURCES, Task, Told, Warm

ROOT = Path(__file__).parents[2]
COPIED = (*SOURCES, "tests", "config", "docs", "systemd", "pyproject.toml", "README.md", "CHANGELOG.md", "Makefile")
PARALLEL = 2
LEAST_S = 60.0
"""Shortest time limit of a run [s]; a run that takes longer than five times that of the tree as it is has noticed."""


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
    with contextlib.ExitStack() as stack:
        place = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="mutation-")))
        tree = _copy(place / "0")
        with Warm(tree, room.asked, room.files) as warm:
            started_s = time.monotonic()
            known.took_s, known.reach = _without_slip(warm, room)
            limit_s = max(LEAST_S, 5.0 * (time.monotonic() - started_s))
        trees = [tree, *(shutil.copytree(tree, place / str(number)) for number in range(1, parallel))]
        free: SimpleQueue[tuple[Path, Warm]] = SimpleQueue()
        for each in trees:
            free.put((each, stack.enter_context(Warm(each, room.asked))))

        parsing = Lock()  # Python 3.11 counts the depth of all threads' syntax trees in one number

        def survives(slip: Slip) -> bool:
            mine, warm = free.get()
            file = mine / slip.file
            source, stamp = file.read_text(), file.stat()
            try:
                with parsing:
                    slipped, lines = slip.into(source), {(slip.file, line) for line in slip.lines(source)}
                file.write_text(slipped)
                tests = known.order(lines)
                task = Task(known.limits_s(tests), limit_s, swapped=(slip.file, source))
                told: Told | None = Told(unfit=bool(tests))
                if lines and not lines & known.reach.of_all and tests:
                    told = warm.run(task)
                if told is not None and told.unfit:
                    with Warm(mine, room.asked) as anew:
                        told = anew.run(replace(task, swapped=("", "")))
                lives = told is not None and not told.failed
                known.noticed.update(told.failed[:1] if told else ())
                progress(slip, lives)
                return lives
            finally:
                file.write_text(source)
                os.utime(file, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))  # its bytecode is good once more
                free.put((mine, warm))

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


def _without_slip(warm: Warm, room: Room) -> tuple[dict[str, float], Reach]:
    """How long each test takes on the tree as it is [s], and what it comes by."""
    told = warm.run(Task(until_one_fails=False, follow=True))
    if told is None or told.reach is None or not told.took_s:
        raise RuntimeError(f"cannot be followed: {' '.join(room.tests)}")
    # To be followed makes a test slow, which one that compares costs may not pass.
    again = warm.run(Task(dict.fromkeys(told.failed, 0.0))) if told.failed else Told()
    if again is None or again.failed:
        raise RuntimeError(f"fails without any slip: {' '.join(again.failed if again else told.failed)}")
    return told.took_s, told.reach


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
