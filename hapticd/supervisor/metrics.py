"""The metrics that the driver keeps in shared memory: their values, and which of them grew though they should not."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from hapticd.device import Metric

QUIET_S = 10.0
"""Shortest time between two warnings of the same metric [s]."""


def values_of(metrics: Sequence[Metric], numbers: Sequence[float]) -> dict[str, float]:
    """Value of each metric by its name."""
    return {metric.name: number for metric, number in zip(metrics, numbers, strict=False)}


class MetricWatch:
    """Sees which metrics grew though they should not.

    A device that was lost and opened anew counts from 0 again, and so does its watch.
    """

    def __init__(self) -> None:
        self._told: dict[str, float] = {}
        self._due_s: dict[str, float] = {}

    def grown(
        self, metrics: Sequence[Metric], numbers: Sequence[float], now_s: float
    ) -> Iterator[tuple[str, dict[str, float | int | str]]]:
        """Text and fields of a warning for each metric that has grown since it was told last.

        Args:
            metrics: what the driver keeps.
            numbers: their values.
            now_s: time on the caller's clock [s].
        """
        for metric, value in zip(metrics, numbers, strict=False):
            if not metric.warns:
                continue
            told = self._told.get(metric.name, 0.0)
            if value < told:
                told = self._told[metric.name] = 0.0
            if value > told and now_s >= self._due_s.get(metric.name, -math.inf):
                self._told[metric.name] = value
                self._due_s[metric.name] = now_s + QUIET_S
                text = f"{metric.name}: {value - told:g} more, {value:g} since the device was opened: {metric.meaning}"
                yield text, {"metric": metric.name, "grown_by": value - told, "value": value}
