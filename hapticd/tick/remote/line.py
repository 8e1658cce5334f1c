"""A wall that is none: what an axis of a coupling or a force has where a contact has its wall."""

from __future__ import annotations


class Line:
    """What stands for the wall of an axis.

    Attributes:
        outward: 1.0; 0.0 while the port sleeps, so that the tick sees the device nowhere but at 0.
        axis: of the device.
        position_m: 0: the port knows where its target is [m].
        spring_n: the spring's part of the last force [N].
    """

    __slots__ = ("axis", "outward", "position_m", "spring_n")

    def __init__(self, axis: int) -> None:
        self.axis = axis
        self.outward = 0.0
        self.position_m = 0.0
        self.spring_n = 0.0
