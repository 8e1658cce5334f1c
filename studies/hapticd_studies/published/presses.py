"""Presses of one device from several heights: how many settle, and how much of the end is felt."""

from __future__ import annotations

from typing import Any

import numpy as np

from hapticd import plugins
from hapticd.config.walls import WallConfig
from hapticd.offline.felt import WINDOW_S, felt_index
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.offline.presses import aimed, judge
from hapticd.simulation.batch import TRACE_COLUMNS, Batch, Point
from hapticd.simulation.options import SimulationOptions

HIGHEST_START_M = 2e-3
_POSITION = TRACE_COLUMNS.index("x_m")


def points(
    device: dict[str, Any], wall: WallConfig, hand_n: float, starts: int, period_s: float, velocity_samples: int = 1
) -> list[Point]:
    """A device that is let go above a wall under a constant force, without any law.

    Args:
        device: options of the simulated device.
        wall: the wall.
        hand_n: how hard it is pressed [N].
        starts: heights, evenly from 0 to `HIGHEST_START_M`.
        period_s: of the loop [s].
        velocity_samples: samples that the velocity difference spans.
    """
    options = {"hand": {"force": {"profile": "constant", "newton": -hand_n}}, **device}
    made = []
    for start in range(starts):
        height_m = HIGHEST_START_M * start / max(1, starts - 1)
        simulated = SimulationOptions.model_validate({**options, "initial_position_m": height_m})
        params = plugins.law("none").Params()
        made.append(aimed(Point(simulated, wall, params, period_s, velocity_samples=velocity_samples), Criterion()))
    return made


def settled(presses: list[Point], duration_s: float) -> int:
    """How many settle.

    Args:
        presses: from `points`.
        duration_s: simulated time of each [s].
    """
    criterion = Criterion()
    result = Batch(plugins.law("none"), presses, duration_s, criterion.window_s, ledger=False).run()
    return int((judge(criterion, presses, result) == Outcome.SETTLED).sum())


def felt(presses: list[Point], duration_s: float) -> float:
    """The median felt index of the last second; infinite where most diverge.

    Args:
        presses: from `points`.
        duration_s: simulated time of each [s].
    """
    result = Batch(plugins.law("none"), presses, duration_s, WINDOW_S, ledger=False, trace_every=1).run()
    period_s = presses[0].period_s
    last = round(WINDOW_S / period_s)
    found = [
        felt_index(trace[-last:, _POSITION], period_s) if finite else np.inf
        for trace, finite in zip(result.trace, result.finite, strict=True)
    ]
    return float(np.median(found))
