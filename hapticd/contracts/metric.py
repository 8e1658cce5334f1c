"""Numbers that a driver keeps of its device and of the link to it, for `hapticd/status`."""

from __future__ import annotations

from dataclasses import dataclass

MOST_METRICS = 64
"""Most metrics that a driver may keep."""


@dataclass(frozen=True, slots=True)
class Metric:
    """A number that a driver keeps; it is 0 when the driver is made.

    Attributes:
        name: its key in `hapticd/status`, with the unit where it has one: `lost_frames`, `echo_us`.
        meaning: what it counts or measures, for people.
        warns: it only ever grows, and that it grew is worth a warning.
    """

    name: str
    meaning: str
    warns: bool = False
