"""The bare loop of the daemon, in a child: it sleeps to absolute deadlines and notes how late it wakes.

python -m hapticd.doctor.sleeper PARENT LOOP SECONDS
"""

from __future__ import annotations

import json
import sys
import time
from array import array
from typing import Any

from hapticd.config.models import LoopConfig
from hapticd.loop.realtime import become_realtime, die_with_parent, sleep_until


def main() -> None:
    """Measure, and print lateness and skipped deadlines."""
    parent, loop, seconds = sys.argv[1:]
    die_with_parent(int(parent))
    settings = LoopConfig.model_validate_json(loop)
    if settings.realtime == "required":  # what is missing is a finding of its own
        settings = settings.model_copy(update={"realtime": "preferred"})
    sys.stdout.write(json.dumps(measured(settings, float(seconds))))


def measured(loop: LoopConfig, seconds: float) -> dict[str, Any]:
    """Sleep to every deadline for `seconds`.

    Returns:
        `late_ns`, one a tick; `skipped` deadlines; `realtime`, whether scheduling and memory were as the loop wants.
    """
    period_ns = loop.period_ns
    expected = max(1, round(seconds * 1e9 / period_ns))
    late_ns = array("q", bytes(8 * expected))
    clock_ns = time.monotonic_ns
    problems, _ = become_realtime(loop)
    ticks = skipped = 0
    deadline_ns = clock_ns() // period_ns * period_ns + 5 * period_ns
    end_ns = deadline_ns + expected * period_ns
    while deadline_ns < end_ns:
        sleep_until(deadline_ns)
        now_ns = clock_ns()
        late_ns[ticks] = now_ns - deadline_ns
        ticks += 1
        behind = (now_ns - deadline_ns) // period_ns
        skipped += behind
        deadline_ns += (behind + 1) * period_ns
    return {"late_ns": late_ns[:ticks].tolist(), "skipped": skipped, "realtime": not problems}


if __name__ == "__main__":
    main()
