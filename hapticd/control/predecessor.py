"""What the control process before left behind, for the one that goes on with the device once it is found again."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Predecessor:
    """Where the loop before stopped; of the first one, nothing.

    Attributes:
        seq: number of the next tick; subscribers see no step back.
        skipped: deadlines skipped so far.
        law: index of the law activation.
        may_arm: forces were let through when it ended; a device that arms by itself may do so again.
        latched: a fault that took the force away has not been cleared.
    """

    seq: int = 0
    skipped: int = 0
    law: int = 0
    may_arm: bool = True
    latched: bool = False
