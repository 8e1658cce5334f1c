"""Every test that starts a daemon, many times over beside a busy processor: a verdict that hangs on luck shows so.

`REPEAT=50 pytest tests/daemon` is what the nightly run has. A test that starts none runs once, as always. With
`--numprocesses 4 --dist load --maxschedchunk 1` four tests are repeated side by side, each in a process of its own.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest

from tests import standstill

REPEAT = int(os.environ.get("REPEAT", "1"))
_SPIN = "import os; os.sched_setaffinity(0, {{{cpu}}})\nwhile os.getppid() == {parent}: pass"

_started = 0
_times: dict[str, int] = {}  # how often each test that started a daemon has run


def watch_for_daemons() -> None:
    """Count the daemons that this process starts, by whatever way it starts them."""

    def hear(event: str, arguments: tuple[Any, ...]) -> None:
        global _started
        if event == "subprocess.Popen" and _is_daemon(arguments[1]):
            _started += 1

    sys.addaudithook(hear)


def repeated(item: pytest.Item, next_item: pytest.Item | None) -> bool:
    """Run a test, and again as often as `REPEAT` says if it has started a daemon; the first that fails is the last."""
    hook = item.ihook
    hook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for number in range(REPEAT):
        before = _started
        reports = standstill.reports(item, next_item)
        if _started > before or item.nodeid in _times:
            _times[item.nodeid] = number + 1
        failed = any(report.failed for report in reports)
        if failed:
            for report in reports:
                report.sections.append(("repeat", f"in run {number + 1} of {REPEAT}"))
        if failed or _started == before or number == REPEAT - 1:
            for report in reports:
                hook.pytest_runtest_logreport(report=report)
            break
    hook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def times() -> dict[str, int]:
    """How often each test that started a daemon has run in this process."""
    return dict(_times)


def add(others: dict[str, int]) -> None:
    """Count what another process has run; a test that starts the daemon of its file does so in each of them."""
    for name, count in others.items():
        _times[name] = max(count, _times.get(name, 0))


def said() -> str:
    """What was repeated, in a line; those whose daemon serves a whole file run once or twice."""
    often = sum(times == REPEAT for times in _times.values())
    return (
        f"{len(_times)} tests started a daemon: {often} of them ran {REPEAT} times beside a busy processor, "
        f"{len(_times) - often} fewer"
    )


@contextlib.contextmanager
def busy_processor() -> Iterator[None]:
    """A program that spins on the processor on which a daemon's loop is."""
    spin = _SPIN.format(cpu=max(os.sched_getaffinity(0)), parent=os.getpid())
    with subprocess.Popen([sys.executable, "-c", spin]) as spinning:
        try:
            yield
        finally:
            spinning.kill()


def _is_daemon(command: Any) -> bool:
    words = [os.fsdecode(word) for word in command] if isinstance(command, list | tuple) else [str(command)]
    return "run" in words and any(word.rsplit("/", 1)[-1] == "hapticd" for word in words)
