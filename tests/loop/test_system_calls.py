"""A healthy tick asks the system for its sleep, and for what its device needs: here nothing."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from tests.loop.system_calls import UNHURRIED, system_calls

TICKS = 1000
CONFIG = f"""
{UNHURRIED}
[device.options]
hand.force = {{ profile = "press-and-release", newton = -5.0, release_newton = 0.3, period_s = 0.5 }}
[[scene.walls]]
stiffness_n_per_m = 5000.0
"""


def test_a_healthy_tick_makes_no_system_call_but_its_sleep(tmp_path: Path) -> None:
    """One that took longer than its budget on the clock asks how long it has computed, and so do the ten after it."""
    found = system_calls(CONFIG, TICKS, tmp_path, {})
    counts = Counter(name for name, _ in found)
    asked = [arguments for name, arguments in found if name == "clock_gettime"]
    assert all("CLOCK_THREAD_CPUTIME_ID" in arguments for arguments in asked)
    assert set(counts) <= {"clock_nanosleep", "clock_gettime"}, counts
    assert counts["clock_nanosleep"] > 0.5 * TICKS  # the others came too late to sleep
    assert len(asked) < 0.5 * TICKS, "the budget is looked at in ticks that were not late"
