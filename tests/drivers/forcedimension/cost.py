"""What a tick costs with the driver's real sequence of calls through ctypes, beside the simulated device's tick.

python -m tests.drivers.forcedimension.cost [TICKS]

The fake answers at once, so this is the price of Python and ctypes. What USB adds only a device can tell.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

from hapticd_bench.tick.bodies import ROUNDS, Bodies, measure_bodies
from hapticd_bench.tick.case import Case, scene
from tests.drivers.forcedimension.bench import Bench
from tests.drivers.forcedimension.building import build
from tests.drivers.forcedimension.lab import PRESS_N, SLOW, config, press

TICKS = 8000

SOFT_N_PER_M = 500.0
"""A wall that stays calm while this computer does something else [N/m]: the device moves in real time."""


def measure(ticks: int) -> Bodies:
    """Measure the reference, the simulated device, and the real driver, its pieces as well.

    Args:
        ticks: how many of each.
    """
    with tempfile.TemporaryDirectory() as directory:
        devices = Path(directory) / "devices"
        bench = Bench(build(Path(directory)), devices)
        press(bench, -PRESS_N / SOFT_N_PER_M)
        bench.set(-1, wall_scale=SLOW, real_time=1)
        # Back to back, the time between two ticks is too short for a difference of positions.
        text = config(bench, SOFT_N_PER_M) + '[velocity]\nestimator = "device"\n'
        cases = [
            Case("reference", "arithmetic"),
            Case("device", "loopback", scene()),
            Case("device", "omega7", text),
            Case("pieces", "omega7", text, pieces=True),
        ]
        os.environ["FAKE_DHD_FILE"] = str(devices)
        try:
            return measure_bodies(cases, ticks, min(ROUNDS, ticks), lambda _: None)
        finally:
            del os.environ["FAKE_DHD_FILE"]


def lines(found: Bodies) -> list[str]:
    """The figures as a table: each as time, and next to a hundred interpreted multiply-adds."""
    shown = [f"{'':22}{'p50 us':>8}{'p99 us':>8}{'ratio':>8}"]
    for body in found.bodies:
        problem = f"  {body.problem}" if body.problem else ""
        us = body.paced_us
        shown.append(f"{f'{body.group} {body.name}':22}{us.p50:8.1f}{us.p99:8.1f}{body.p50_ratio:8.2f}{problem}")
    for piece in found.pieces:
        us = piece.us
        shown.append(f"{f'  {piece.name}':22}{us.p50:8.1f}{us.p99:8.1f}{piece.p50_ratio:8.2f}")
    return [*shown, f"real-time: {'yes' if found.realtime else 'no'}", *found.warnings]


if __name__ == "__main__":
    for line in lines(measure(int(sys.argv[1]) if len(sys.argv) > 1 else TICKS)):
        print(line)  # noqa: T201 - its output
