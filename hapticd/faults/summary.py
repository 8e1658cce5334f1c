"""What a fault record comes to: how strong the force was, and how soon it was gone."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hapticd.faults.file import FaultRecord


@dataclass(frozen=True, slots=True)
class Summary:
    """Figures of a fault record.

    Attributes:
        ticks: ticks in the record.
        before_s: how far it reaches back before the fault [s].
        after_s: how far it goes on after it [s].
        force_before_n: magnitude of the force in the last tick before the fault [N].
        peak_force_n: largest magnitude from the fault on [N].
        ramp_ticks: ticks with a force from the fault on; None when the record ends before the force does.
        skipped: deadlines skipped within the record.
    """

    ticks: int
    before_s: float
    after_s: float
    force_before_n: float
    peak_force_n: float
    ramp_ticks: int | None
    skipped: int


def summarise(record: FaultRecord) -> Summary:
    """The figures of a record."""
    ticks = record.ticks
    at = int(record.header["event"]["seq"])
    forces = [(tick.seq, math.hypot(*tick.force_n)) for tick in ticks]
    after = [force for seq, force in forces if seq >= at]
    gone = next((index for index, force in enumerate(after) if force == 0.0), None)
    return Summary(
        ticks=len(ticks),
        before_s=max(0.0, (record.fault_ns - ticks[0].deadline_ns) * 1e-9) if ticks else 0.0,
        after_s=max(0.0, (ticks[-1].deadline_ns - record.fault_ns) * 1e-9) if ticks else 0.0,
        force_before_n=next((force for seq, force in reversed(forces) if seq < at), 0.0),
        peak_force_n=max(after, default=0.0),
        ramp_ticks=gone,
        skipped=ticks[-1].skipped - ticks[0].skipped if ticks else 0,
    )
