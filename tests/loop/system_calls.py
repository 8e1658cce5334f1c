"""A control loop of its own under `strace`: as the daemon sets it up, for a number of ticks, between two marks."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from hapticd.config.loading import load
from hapticd.loop.loop import ControlLoop
from hapticd.loop.memory import SUPERVISOR_BEAT, SharedMemory
from hapticd.loop.realtime import become_realtime, sleep_until
from hapticd.loop.warm_up import warm_up
from hapticd.tick.assemble import make_tick, place_device
from hapticd.tick.record import RecordLayout

ROOT = Path(__file__).parents[2]
BEGIN, END = Path("/begin-of-the-ticks"), Path("/end-of-the-ticks")
"""Files that are looked for, and are not there, so that it is seen where the ticks begin and end."""

# Slow, and with all of the period for a tick: one that is traced is not taken for one that computes too long.
UNHURRIED = """
[loop]
rate_hz = 500.0
law_budget = 1.0
"""

_CALL = re.compile(r"^\d+ +(\w+)\((.*)")


def system_calls(config: str, ticks: int, directory: Path, environment: Mapping[str, str]) -> list[tuple[str, str]]:
    """Name and arguments of each system call of the loop's thread, from the first tick to the last.

    Args:
        config: of the daemon.
        ticks: how many.
        directory: for the configuration and the trace.
        environment: what the loop has besides.

    Raises:
        AssertionError: the loop has failed.
    """
    file, trace = directory / "traced.toml", directory / "trace"
    file.write_text(config)
    settings = [word for name, value in environment.items() for word in ("-E", f"{name}={value}")]  # not strace's own
    loop = [sys.executable, "-m", "tests.loop.system_calls", str(file), str(ticks)]
    command = ["strace", "-f", "-y", "-o", str(trace), *settings, *loop]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=200)
    assert done.returncode == 0, done.stderr
    return _between_the_marks(trace)


def _between_the_marks(trace: Path) -> list[tuple[str, str]]:
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


def main(file: str, ticks: int) -> None:
    """Run the loop of a configuration for some ticks."""
    config = load(file)
    settings = config.config
    driver = config.driver(config.options, settings.loop.period_s)
    place_device(config, driver)
    info = driver.open()
    shared = SharedMemory(RecordLayout(len(info.axes), info.has_orientation, 8), settings.loop.rate_hz)
    left = ticks

    def sleep_and_count(deadline_ns: int) -> int:
        nonlocal left
        if left == ticks:
            BEGIN.exists()
        left -= 1
        if left == 0:
            END.exists()
            loop.session.stop_requested = True
        return sleep_until(deadline_ns)

    loop = ControlLoop(driver, make_tick(config, info), shared, settings.loop, settings.safety, True, sleep_and_count)
    warm_up(make_tick(config, info))
    become_realtime(settings.loop)
    shared.words[SUPERVISOR_BEAT] = 1 << 62  # it never stalls
    loop.run()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
