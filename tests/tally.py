"""How often each test has run, in a file to which every process adds: what was stopped goes on from there.

`python -m tests.tally` keeps what was counted with the checkout, so that another computer goes on from there as well.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.content import KEPT, Content

ROOT = Path(__file__).parent.parent
STEPS = (50, 20, 10, 2, 1, 0)
"""Numbers of runs by which the summary sorts the tests."""


@dataclass
class Count:
    """What has come of a test: runs that passed since it failed last, runs that failed, whether a daemon ran for it.

    The first two are of its version; `in_a_row` are the runs that passed since it failed last in any version.
    """

    passes: int = 0
    failures: int = 0
    daemon: bool = False
    in_a_row: int = 0

    @property
    def ran(self) -> bool:
        """Whether the test has run in this version."""
        return self.passes > 0 or self.failures > 0

    def add(self, passed: bool, daemon: bool, *, same: bool = True) -> None:
        """One more run, of the same version or another."""
        self.in_a_row = self.in_a_row + 1 if passed else 0
        self.daemon |= daemon
        if same:
            self.passes = self.passes + 1 if passed else 0
            self.failures += not passed


def opened() -> Tally:
    """The tally of this checkout."""
    return Tally(ROOT / "build" / "repeats.jsonl", Content(ROOT).of, ROOT / KEPT)


class Tally:
    """The runs of each test in the version that it has now; others only count for what has passed in a row.

    Args:
        path: the file.
        version: of a test, by its name.
        kept: what was counted on other computers, a line a test.
    """

    def __init__(self, path: Path, version: Callable[[str], str], kept: Path | None = None) -> None:
        self._path = path
        self._version = version
        self._kept = kept
        self._counts = self._read()

    def add(self, test: str, *, passed: bool, daemon: bool) -> None:
        """Note a run: a whole line at the end of the file, so that other processes may do so at the same time."""
        self._counts.setdefault(test, Count()).add(passed, daemon)
        self._path.parent.mkdir(parents=True, exist_ok=True)
        line = {"version": self._version(test), "test": test, "passed": passed, "daemon": daemon}
        with self._path.open("ab", buffering=0) as file:
            file.write(json.dumps(line).encode() + b"\n")

    def keep(self) -> None:
        """Move what has been counted of the tests as they are to the file that is kept."""
        assert self._kept is not None
        lines = [
            json.dumps({"version": self._version(test), "test": test, **asdict(count)})
            for test, count in sorted(self._read().items())
            if count.daemon
        ]
        self._kept.write_text("".join(f"{line}\n" for line in lines))
        self._path.unlink(missing_ok=True)

    def passes(self, test: str) -> int:
        """How often a test has passed since it failed last."""
        return self._counts.get(test, Count()).passes

    def done(self, test: str, times: int) -> bool:
        """Whether a test has passed this often in a row, or once if it needs no daemon."""
        count = self._counts.get(test, Count())
        return count.passes >= (times if count.daemon else 1)

    def begun(self) -> bool:
        """Whether any test has run in this version."""
        return any(count.ran for count in self._counts.values())

    def lines(self) -> list[str]:
        """How many tests that start a daemon have passed how often, by all processes, and every test that failed."""
        counts = {test: count for test, count in self._read().items() if count.ran}
        with_one = [count for count in counts.values() if count.daemon]
        said = [f"{len(with_one)} tests start a daemon; runs that passed in a row beside a busy processor:"]
        said += _steps([count.passes for count in with_one])
        said += ["those of other versions with them:", *_steps([count.in_a_row for count in with_one])]
        failed = {test: count for test, count in counts.items() if count.failures}
        said.append(f"{len(failed)} tests have failed")
        said += [f"  {test}: {count.failures} times, then passed {count.passes}" for test, count in failed.items()]
        return said

    def _read(self) -> dict[str, Count]:
        counts: dict[str, Count] = {}
        for file in (self._kept, self._path):
            for line in file.read_text().splitlines() if file is not None and file.exists() else ():
                run = json.loads(line)
                test = run["test"]
                same = run["version"] == self._version(test)
                if "passed" in run:
                    counts.setdefault(test, Count()).add(run["passed"], run["daemon"], same=same)
                elif same:
                    counts[test] = Count(run["passes"], run["failures"], run["daemon"], run["in_a_row"])
                else:
                    counts[test] = Count(daemon=run["daemon"], in_a_row=run["in_a_row"])
        return counts


def _steps(often: list[int]) -> list[str]:
    """How many of these numbers are of each step, those without any left out."""
    said = []
    for step, above in zip(STEPS, (float("inf"), *STEPS), strict=False):
        tests = sum(step <= passes < above for passes in often)
        if tests:
            said.append(f"  {step} or more: {tests} tests")
    return said


if __name__ == "__main__":
    opened().keep()
