"""A healthy tick asks the system for its sleep, and for what its device needs: here nothing."""

from __future__ import annotations

import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

from tests.loop.system_calls import BEGIN, END

TICKS = 1000
_CALL = re.compile(r"^\d+ +(\w+)\((.*)")


def calls_between_the_marks(trace: Path) -> list[tuple[str, str]]:
    """Name and arguments of each system call of the loop's thread from the first tick to the last."""
    found: list[tuple[str, str]] = []
    loop = ""
    begun = False
    for line in trace.read_text().splitlines():
        if str(BEGIN) in line:
            loop, begun = line.split()[0], True
        elif str(END) in line:
            return found
        elif begun and line.split()[0] == loop and (call := _CALL.match(line)):
            found.append((call[1], call[2]))
    raise AssertionError("the loop did not come to its end")


def test_a_healthy_tick_makes_no_system_call_but_its_sleep(tmp_path: Path) -> None:
    """One that took longer than its budget on the clock asks how long it has computed, and so do the ten after it."""
    trace = tmp_path / "trace"
    command = [sys.executable, "-m", "tests.loop.system_calls", str(TICKS)]
    done = subprocess.run(
        ["strace", "-f", "-o", trace, *command],
        cwd=Path(__file__).parent.parent.parent,
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
    )
    assert done.returncode == 0, done.stderr
    found = calls_between_the_marks(trace)
    counts = Counter(name for name, _ in found)
    asked = [arguments for name, arguments in found if name == "clock_gettime"]
    assert all("CLOCK_THREAD_CPUTIME_ID" in arguments for arguments in asked)
    assert set(counts) <= {"clock_nanosleep", "clock_gettime"}, counts
    assert counts["clock_nanosleep"] > 0.5 * TICKS  # the others came too late to sleep
    assert len(asked) < 0.5 * TICKS, "the budget is looked at in ticks that were not late"
