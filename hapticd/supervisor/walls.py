"""How stiff the walls are by now: the loop changes them by itself at the ticks that the file names."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hapticd.config.models import WallConfig


class WallTimes:
    """Since which tick each wall stands, as the loop counts it, to within a turn of the supervisor."""

    def __init__(self) -> None:
        self._walls: list[tuple[WallConfig, int]] = []

    def take(self, walls: Sequence[WallConfig], seq: int) -> None:
        """These are the walls now; one that did not change keeps its clock.

        Args:
            walls: of the scene in force.
            seq: the newest tick.
        """
        free = list(self._walls)
        self._walls = []
        for wall in walls:
            known = next((stands for stands in free if stands[0] == wall), None)
            if known is not None:
                free.remove(known)
            self._walls.append(known or (wall, seq))

    def forget(self) -> None:
        """The loop that knew them is gone."""
        self._walls = []

    def stiffness_n_per_m(self, seq: int, period_s: float) -> tuple[float, ...]:
        """Stiffness of each wall at a tick [N/m].

        Args:
            seq: the tick.
            period_s: time between ticks [s].
        """
        return tuple(_stiffness_n_per_m(wall, seq - since, period_s) for wall, since in self._walls)


def _stiffness_n_per_m(wall: WallConfig, ticks: int, period_s: float) -> float:
    stiffness_n_per_m = wall.stiffness_n_per_m
    for change in wall.changes:
        if ticks >= math.ceil(change.at_s / period_s - 1e-6) and change.stiffness_n_per_m is not None:
            stiffness_n_per_m = change.stiffness_n_per_m
    return stiffness_n_per_m
