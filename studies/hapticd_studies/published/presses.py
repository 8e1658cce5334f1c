"""Presses of one device from several heights: how many settle, and how much of the end is felt."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticd import plugins
from hapticd.config.walls import WallConfig
from hapticd.offline.felt import WINDOW_S
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.offline.presses import aimed, judge
from hapticd.simulation.batch import Batch, BatchResult, Point
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.felt_ends import felt_ends

HIGHEST_START_M = 2e-3


@dataclass(frozen=True, slots=True)
class Settled:
    """How presses end.

    Attributes:
        count: how many settle.
        felt: median felt index of the last second of those; None: there are none.
        chatter_n: median span of their force in that second [N].
    """

    count: int
    felt: float | None
    chatter_n: float | None

    @property
    def words(self) -> str:
        """What of their rest is felt, for people."""
        if self.felt is None:
            return "none settles"
        return f"felt {self.felt:.2f}, force spans {self.chatter_n:.2f} N"


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


def settled(presses: list[Point], duration_s: float) -> Settled:
    """How many settle, and what of their rest is felt.

    Args:
        presses: from `points`.
        duration_s: simulated time of each [s].
    """
    criterion = Criterion()
    result = _run(presses, duration_s, criterion.window_s)
    held = judge(criterion, presses, result) == Outcome.SETTLED
    if not held.any():
        return Settled(0, None, None)
    felt_each, chatter_n = felt_ends(presses, result)
    return Settled(int(held.sum()), float(np.median(felt_each[held])), float(np.median(chatter_n[held])))


def felt(presses: list[Point], duration_s: float) -> float:
    """The median felt index of the last second; infinite where most diverge.

    Args:
        presses: from `points`.
        duration_s: simulated time of each [s].
    """
    return float(np.median(felt_ends(presses, _run(presses, duration_s, WINDOW_S))[0]))


def _run(presses: list[Point], duration_s: float, window_s: float) -> BatchResult:
    law = plugins.law("none")
    return Batch(law, presses, duration_s, window_s, trace_every=1, ledger=False, trace_last_s=WINDOW_S).run()
