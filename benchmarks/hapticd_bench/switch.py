"""What a switch costs the loop when it is to a law that was never loaded, beside programs that keep its processor busy.

    hapticd bench switch [--switches 8] [--burners 4] [--json]

Each switch is a fresh daemon's, to a law without bytecode. The reference is the same loop on the same busy processor in
the time before the switch.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from hapticd.client import Client, Event, Timing
from hapticd.measure import Progress, Quantiles
from hapticd.tick.event import EventCode
from hapticd_bench.running import RunningDaemon, running_daemon

WATCHED_S = 1.0
"""How long the loop is watched before each switch, and how long at most it is from the request to the switch [s]."""

START_S = 2.0
"""What a daemon takes to start and to end, about [s]."""

CONFIG = """
[loop]
rate_hz = 1000.0
cpu = {cpu}
[device.options]
model = "omega7"
hand = {{ force = {{ profile = "constant", newton = -3.0 }} }}
[[scene.walls]]
stiffness_n_per_m = 12000.0
[controller]
law = "{law}"
[safety]
auto_arm = true
"""

PATIENCE_S = 30.0
"""How long a daemon may be silent, while it starts beside whatever else the computer does [s]."""

LAW = '''
"""A law of a lab's own: the wall with constant damping."""
from pydantic import Field
from hapticd.law import LawParams
class Params(LawParams):
    """One."""
    damping_n_s_per_m: float = Field(8.0, ge=0)
class State:
    """Nothing."""
    damping_n_s_per_m: float
def start(state, params, snapshot):
    """Damp at once."""
    state.damping_n_s_per_m = params.damping_n_s_per_m
def step(state, params, tick):
    """F = F_contact - b v."""
    return tick.contact_n - params.damping_n_s_per_m * tick.velocity_m_per_s
'''

_BURNER = "import os; os.sched_setaffinity(0, {{{cpu}}})\nwhile True: pass"


@dataclass(frozen=True, slots=True)
class Switches:
    """What was seen.

    Attributes:
        burners: programs that spun on the loop's processor.
        before_ms: longest time between two ticks in the second before a switch, of each switch [ms].
        during_ms: the same from the request to the switch [ms].
    """

    burners: int
    before_ms: Quantiles
    during_ms: Quantiles


def measure(switches: int, burners: int, progress: Progress) -> Switches:
    """Switch `switches` times, each time in a daemon of its own.

    Args:
        switches: how many.
        burners: programs that spin on the loop's processor.
        progress: told what is done.

    Raises:
        HapticdError: a daemon could not start, or did not survive.
    """
    before_ms, during_ms = [], []
    for _ in range(switches):
        before, during = _switch(burners)
        before_ms.append(before)
        during_ms.append(during)
        progress(START_S + WATCHED_S)
    return Switches(burners, Quantiles.of(before_ms), Quantiles.of(during_ms))


def _switch(burners: int) -> tuple[float, float]:
    """Longest time between two ticks before a switch and during it [ms]."""
    cpu = max(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory(prefix="hapticd-switch-") as place:
        directory = Path(place)
        (directory / "benchlab").mkdir()
        (directory / "benchlab" / "__init__.py").touch()
        (directory / "benchlab" / "damped.py").write_text(LAW)
        config = directory / "lab.toml"
        config.write_text(CONFIG.format(cpu=cpu, law="energy-cycle"))
        with (
            running_daemon(config, directory) as daemon,
            Client(daemon.endpoint, topics=(Timing, Event), receive_high_water=0) as client,
        ):
            _ticks(daemon, client, 1)
            with _busy(cpu, burners):
                before = _ticks(daemon, client, round(WATCHED_S * 1e3))
                config.write_text(CONFIG.format(cpu=cpu, law="benchlab.damped"))
                asked_ns = time.monotonic_ns()
                daemon.command("reload")
                during = [at_ns for at_ns in _ticks(daemon, client, None) if at_ns > asked_ns]
    return _longest_ms(before), _longest_ms(during)


def _ticks(daemon: RunningDaemon, client: Client, count: int | None) -> list[int]:
    """Deadlines of `count` ticks; without a count, of all until a switch and some after it [ns]."""
    deadlines: list[int] = []
    switched_at: int | None = None
    heard_s = time.monotonic()
    while count is None or len(deadlines) < count:
        records = client.receive(1.0)
        if records:
            heard_s = time.monotonic()
        if daemon.process.poll() is not None or time.monotonic() - heard_s > PATIENCE_S:
            raise daemon.failed("no ticks any more")
        for record in records:
            if isinstance(record, Timing):
                deadlines.append(record.deadline_ns)
                if switched_at is not None and record.seq > switched_at + 10:
                    return deadlines
            elif isinstance(record, Event) and record.code == EventCode.SWITCHED:
                switched_at = record.seq
    return deadlines


def _longest_ms(deadlines: list[int]) -> float:
    return max(later - earlier for earlier, later in pairwise(deadlines)) * 1e-6


@contextmanager
def _busy(cpu: int, burners: int) -> Iterator[None]:
    """Programs that spin on a processor."""
    spinning = [subprocess.Popen([sys.executable, "-c", _BURNER.format(cpu=cpu)]) for _ in range(burners)]
    try:
        yield
    finally:
        for each in spinning:
            each.kill()
            each.wait()
