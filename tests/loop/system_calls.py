"""A control loop of its own for `strace`: as the daemon sets it up, for a number of ticks, between two marks."""

from __future__ import annotations

import sys
from pathlib import Path

from hapticd.config.loading import parse
from hapticd.loop.loop import ControlLoop
from hapticd.loop.memory import SUPERVISOR_BEAT, SharedMemory
from hapticd.loop.realtime import become_realtime, sleep_until
from hapticd.loop.warm_up import warm_up
from hapticd.tick.assemble import make_tick, place_device
from hapticd.tick.record import RecordLayout

BEGIN, END = Path("/begin-of-the-ticks"), Path("/end-of-the-ticks")
"""Files that are looked for, and are not there, so that it is seen where the ticks begin and end."""

# Slow, and with all of the period for a tick: one that is traced is not taken for one that computes too long.
CONFIG = """
[loop]
rate_hz = 500.0
law_budget = 1.0
[device.options]
hand.force = { profile = "press-and-release", newton = -5.0, release_newton = 0.3, period_s = 0.5 }
[[scene.walls]]
stiffness_n_per_m = 5000.0
"""


def main(ticks: int) -> None:
    """Run a loop for some ticks."""
    config = parse(CONFIG, "traced")
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
    main(int(sys.argv[1]))
