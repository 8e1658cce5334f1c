"""The table that makes an uneven angle sensor even, from a handle that is swung to and fro.

The sensor shows the same over each half turn of its magnet, and where one half turn ends is known exactly: the shown
count passes a multiple of `HALF_TURN` there. A handle has mass and swings smoothly, so a cubic through four such
moments says where it was between the inner two, whatever the sensor showed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

HALF_TURN = 1024
"""Counts of a half turn."""

NODES = 17
"""Entries of a table: at the readings 0, 64, 128 to 1024."""

ENOUGH_PASSES = 40
GOOD_ERROR = 1.0
"""Half turns that a measurement needs, and the largest error of a node that it may leave [counts]."""

_NEAR = 64  # counts to either side that speak for a node
_MOST_UNEVEN = 1.6  # between the times that neighbouring half turns take
_TIME_BITS = 32  # of the rig's clock, which counts microseconds


@dataclass(frozen=True, slots=True)
class AngleTable:
    """What was measured.

    Attributes:
        nodes: the table for the board, in counts.
        passes: half turns that it rests on.
        error_counts: standard error of the least certain node. A hand that jerks round at the same place each time adds
            an error of its own that this does not show: 4 counts at most, 2 if the place changes.
        uneven_counts: largest error of what the table before shows.
    """

    nodes: tuple[int, ...]
    passes: int
    error_counts: float
    uneven_counts: float

    @property
    def is_good(self) -> bool:
        """Whether more swinging would change little."""
        return self.passes >= ENOUGH_PASSES and self.error_counts <= GOOD_ERROR


class Swings:
    """Collects what a rig shows while its handle is swung.

    Args:
        before: the table that the board has now.

    Attributes:
        passes: half turns so far from which something could be learned.
    """

    def __init__(self, before: Sequence[int]) -> None:
        self._before = tuple(before)
        self._inner = [node for node, shown in enumerate(before) if 0 < shown < HALF_TURN]
        self._errors: dict[int, list[float]] = {node: [] for node in self._inner}
        self._last: tuple[float, int] | None = None
        self._way = 0
        self._crossings: list[float] = []
        self._between: list[list[tuple[float, int]]] = []
        self.passes = 0

    def add(self, time_us: int, count: int) -> None:
        """A position.

        Args:
            time_us: the rig's clock, modulo 2^32 [us].
            count: what the board shows.
        """
        if self._last is None:
            self._last = float(time_us), count
            return
        before_us, before = self._last
        now_us = before_us + (time_us - int(before_us)) % (1 << _TIME_BITS)
        if now_us == before_us:
            return
        self._last = now_us, count
        turns = count // HALF_TURN - before // HALF_TURN
        if turns == 0:
            if self._between:
                self._between[-1].append((now_us, count % HALF_TURN))
            return
        if abs(turns) > 1 or turns != self._way:
            self._crossings, self._between = [], []
        self._way = turns
        edge = max(count // HALF_TURN, before // HALF_TURN) * HALF_TURN
        self._crossings.append(before_us + (now_us - before_us) * (edge - before) / (count - before))
        self._between.append([(now_us, count % HALF_TURN)])
        if len(self._crossings) >= 4:
            self._learn(self._crossings[-4:], self._between[-3])

    def table(self) -> AngleTable | None:
        """What is known by now; None while a node is not."""
        counts = [len(errors) for errors in self._errors.values()]
        if not counts or min(counts) < 2:
            return None
        means = {node: sum(errors) / len(errors) for node, errors in self._errors.items()}
        worst = max(
            math.sqrt(sum((error - means[node]) ** 2 for error in errors) / (len(errors) - 1) / len(errors))
            for node, errors in self._errors.items()
        )
        nodes = [round(shown + self._error_at(node, shown, means)) for node, shown in enumerate(self._before)]
        return AngleTable(tuple(nodes), self.passes, worst, max(map(abs, means.values())))

    def _learn(self, crossings_us: Sequence[float], shown: Sequence[tuple[float, int]]) -> None:
        """What the half turn between the inner two of four moments says of each node."""
        took_us = [after - before for before, after in pairwise(crossings_us)]
        if max(took_us) > _MOST_UNEVEN * min(took_us):
            return
        pairs = [(phase, HALF_TURN * self._share(crossings_us, at_us) - phase) for at_us, phase in shown]
        for node in self._inner:
            weights = [max(0.0, 1.0 - abs(phase - self._before[node]) / _NEAR) for phase, _ in pairs]
            if (total := sum(weights)) > 0.0:
                weighted = sum(weight * error for weight, (_, error) in zip(weights, pairs, strict=True))
                self._errors[node].append(weighted / total)
        self.passes += 1

    def _share(self, crossings_us: Sequence[float], at_us: float) -> float:
        """Which share of the half turn the handle had gone: the cubic through the four moments."""
        share = 0.0
        for index, own_us in enumerate(crossings_us):
            weight = 1.0
            for other_us in crossings_us:
                if other_us != own_us:
                    weight *= (at_us - other_us) / (own_us - other_us)
            share += weight * (index - 1)
        return share if self._way > 0 else 1.0 - share

    def _error_at(self, node: int, shown: int, means: dict[int, float]) -> float:
        """What a node has to be moved by; beyond the ends of the half turn on the line through end and next node."""
        if node in means:
            return means[node]
        end, inner = (0, self._inner[0]) if shown <= 0 else (HALF_TURN, self._inner[-1])
        return means[inner] * (shown - end) / (self._before[inner] - end)
