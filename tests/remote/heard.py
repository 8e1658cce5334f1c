"""A port that keeps what it is told, and limits for tests."""

from __future__ import annotations

from hapticd.config.ports import PortLimits
from hapticd.tick.remote.port import Port
from hapticd.tick.remote.update import PACKED_BYTES, Update, pack, unpack

TOOL = PortLimits("tool", "coupling", 0.1, 500.0, 5.0, 3.0, 1.0)
FIELD = PortLimits("field", "force", 0.05, 0.0, 0.0, 2.0, 0.0)
BALL = PortLimits("ball", "object", 0.1, 1000.0, 0.0, 0.0, 1.0)


class HeardPort(Port):
    """Keeps every update that it was given, and how old it was."""

    def __init__(self, limits: PortLimits, axes: int = 1) -> None:
        super().__init__(limits, axes, 1e-3)
        self.heard: list[Update] = []
        self.ages_s: list[float] = []

    def take(self, update: Update, age_s: float = 0.0) -> None:
        self.heard.append(copied(update))
        self.ages_s.append(age_s)


def copied(update: Update) -> Update:
    """An update of its own with the same values."""
    row = bytearray(PACKED_BYTES)
    pack(update, row, 0)
    copy = Update()
    unpack(row, 0, copy)
    return copy
