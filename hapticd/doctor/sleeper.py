"""The loop of the daemon without a device, in a child: it sleeps to absolute deadlines, and presses the scene.

python -m hapticd.doctor.sleeper <REQUEST; the last line of its output is the answer.
"""

from __future__ import annotations

import json
import sys
import time
from array import array
from pathlib import Path
from typing import Any

from hapticd.config.loading import parse
from hapticd.config.models import LoopConfig
from hapticd.doctor.own_tick import own_tick
from hapticd.errors import HapticdError
from hapticd.loop.press import Press
from hapticd.loop.realtime import become_realtime, die_with_parent, sleep_until
from hapticd.tick.tick import ControlTick


def main() -> None:
    """Measure, and print what `measured` says, with `fault`: why there was no tick, or why it stopped."""
    asked = json.load(sys.stdin)
    die_with_parent(asked["parent"])
    settings = LoopConfig.model_validate(asked["loop"])
    if settings.realtime == "required":  # what is missing is a finding of its own
        settings = settings.model_copy(update={"realtime": "preferred"})
    tick, fault = _tick(asked["config"])
    answer = measured(settings, asked["seconds"], tick)
    sys.stdout.write("\n" + json.dumps({"fault": tick.fault_text if tick else fault} | answer))


def measured(loop: LoopConfig, seconds: float, tick: ControlTick | None) -> dict[str, Any]:
    """Sleep to every deadline for `seconds`, and compute a tick at each.

    Returns:
        `late_ns` and `took_ns`, how late and for how long, one a tick; `skipped` deadlines; `realtime`, whether
        scheduling and memory were as the loop wants.
    """
    period_ns = loop.period_ns
    expected = max(1, round(seconds * 1e9 / period_ns))
    late_ns = array("q", bytes(8 * expected))
    took_ns = array("q", bytes(8 * expected))
    clock_ns = time.monotonic_ns
    step = _nothing if tick is None else Press(tick).step
    problems, _ = become_realtime(loop)
    ticks = skipped = 0
    deadline_ns = clock_ns() // period_ns * period_ns + 5 * period_ns
    end_ns = deadline_ns + expected * period_ns
    while deadline_ns < end_ns:
        sleep_until(deadline_ns)
        woke_ns = clock_ns()
        step()
        now_ns = clock_ns()
        late_ns[ticks] = woke_ns - deadline_ns
        took_ns[ticks] = now_ns - woke_ns
        ticks += 1
        behind = (now_ns - deadline_ns) // period_ns
        skipped += behind
        deadline_ns += (behind + 1) * period_ns
    return {
        "late_ns": late_ns[:ticks].tolist(),
        "took_ns": took_ns[:ticks].tolist() if tick else [],
        "skipped": skipped,
        "realtime": not problems,
    }


def _tick(config: dict[str, str] | None) -> tuple[ControlTick | None, str]:
    """The tick of a configuration, or why there is none."""
    if config is None:
        return None, "the configuration cannot be used"
    try:
        return own_tick(parse(config["text"], config["path"], Path(config["folder"]))), ""
    except HapticdError as error:
        return None, str(error)


def _nothing() -> None:
    pass


if __name__ == "__main__":
    main()
