"""Every test that starts a daemon, many times over beside a busy processor: a verdict that hangs on luck shows so.

`REPEAT=50 pytest tests/daemon` is what the nightly run has. A test that starts none runs once, as always. With
`--numprocesses 4 --dist load --maxschedchunk 1` four tests are repeated side by side, each in a process of its own.
What was stopped goes on with what has run least. `tests/tally.py` has counted: a run counts for as long as nothing is
changed that its test depends on (`tests/content.py`).
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests import standstill
from tests.tally import Tally

REPEAT = int(os.environ.get("REPEAT", "1"))
_SPIN = "import os; os.nice(19); os.sched_setaffinity(0, {{{cpu}}})\nwhile os.getppid() == {parent}: pass"
"""It takes what the tests leave, so that the processor never rests and they lose next to nothing of it."""

_started = 0


class Repeating:
    """What pytest does with tests that start a daemon, and what it says about them in the end."""

    def __init__(self, tally: Tally, times: int) -> None:
        _watch_for_daemons()
        self._tally = tally
        self._times = times
        self._repeats = False
        self._reports: list[pytest.TestReport] = []

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Leave out what has run often enough before, and begin with what has run least, a test of each file in turn.

        Tests of one file may wait for each other: those of the installed service have one machine.
        """
        due = [item for item in items if not self._tally.done(item.nodeid, self._times)]
        config.hook.pytest_deselected(items=[item for item in items if item not in due])
        turns: Counter[Path] = Counter()
        order = {}
        for item in due:
            turns[item.path] += 1
            order[item] = (self._tally.passes(item.nodeid), turns[item.path])
        items[:] = sorted(due, key=order.__getitem__)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item, nextitem: pytest.Item | None) -> bool:
        """Run a test, and again if a daemon runs for it, until enough runs are counted or one fails."""
        if self._repeats:
            self._reports = standstill.reports(item, nextitem)
            return True
        self._repeats = True
        hook = item.ihook
        hook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
        for number in range(self._tally.passes(item.nodeid), self._times):
            before, served = _started, _daemon_runs()  # the last of its file may take the daemon of that with it
            # All the way round, so that a time limit is one of each run.
            hook.pytest_runtest_protocol(item=item, nextitem=nextitem)
            daemon = served or _started > before or _daemon_runs() or number > 0
            failed = any(report.failed for report in self._reports)
            self._tally.add(item.nodeid, passed=not failed, daemon=daemon)
            if failed:
                for report in self._reports:
                    report.sections.append(("repeat", f"in run {number + 1} of {self._times}"))
            if failed or not daemon or number == self._times - 1:
                for report in self._reports:
                    hook.pytest_runtest_logreport(report=report)
                break
        hook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        self._repeats = False
        return True

    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        """Fail nothing where all has run often enough before."""
        if exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED and self._tally.begun():
            session.exitstatus = pytest.ExitCode.OK

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Say how often the tests have run, this time and before, and which have failed."""
        for line in self._tally.lines():
            terminalreporter.write_line(line)


@contextlib.contextmanager
def busy_processor() -> Iterator[None]:
    """A program that spins on the processor on which a daemon's loop is."""
    spin = _SPIN.format(cpu=max(os.sched_getaffinity(0)), parent=os.getpid())
    with subprocess.Popen([sys.executable, "-c", spin]) as spinning:
        try:
            yield
        finally:
            spinning.kill()


def _watch_for_daemons() -> None:
    """Count the daemons that this process starts, by whatever way it starts them."""

    def hear(event: str, arguments: tuple[Any, ...]) -> None:
        global _started
        if event == "subprocess.Popen" and _is_daemon(arguments[1]):
            _started += 1

    sys.addaudithook(hear)


def _daemon_runs() -> bool:
    """Whether one that serves a whole file of tests is there."""
    for children in Path("/proc/self/task").glob("*/children"):
        for pid in children.read_text().split():
            with contextlib.suppress(OSError):
                words = Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").split("\0")
                if _is_daemon(words):
                    return True
    return False


def _is_daemon(command: Any) -> bool:
    """Whether a command starts one: as a user does, in a test's own process, or as a service of a machine."""
    words = [os.fsdecode(word) for word in command] if isinstance(command, list | tuple) else [str(command)]
    named = any(word.rsplit("/", 1)[-1] == "hapticd" for word in words)
    return (named and "run" in words) or "hapticd.loop.process" in words or {"systemctl", "start"} <= set(words)
