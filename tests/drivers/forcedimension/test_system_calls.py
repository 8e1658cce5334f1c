"""What a tick on a device behind an SDK asks the system for, beyond what the SDK does: its sleep."""

from __future__ import annotations

from pathlib import Path

from tests.drivers.forcedimension.bench import Bench
from tests.drivers.forcedimension.lab import config, press
from tests.loop.system_calls import system_calls

TICKS = 300


def test_a_tick_adds_nothing_but_its_sleep_to_what_the_sdk_asks_for(fake_sdk: Path, tmp_path: Path) -> None:
    """The fake SDK keeps its device in memory: what is seen here is the driver's and the loop's."""
    bench = Bench(fake_sdk, tmp_path / "device")
    press(bench, 0.003, 500.0)
    bench.set(-1, wall_scale=0.02)
    text = config(bench, 5000.0, rate_hz=500.0)
    found = system_calls(text, TICKS, tmp_path, {"FAKE_DHD_FILE": str(tmp_path / "device")})
    assert {name for name, _ in found} <= {"clock_nanosleep", "clock_gettime"}
    assert len(found) > 0.5 * TICKS
