"""What couplings and forces are made with, besides their own limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # who makes a site has them
    from hapticd.tick.contact import RunningLaw
    from hapticd.tick.motion import Motion


@dataclass(frozen=True, slots=True)
class PortSite:
    """Where couplings and forces are.

    Attributes:
        motion: where the device is.
        make_law: a fresh law, one an axis.
        resolution_m: smallest step of the device's position [m].
        period_s: nominal time between ticks [s].
        ramp_s: duration of ramps [s].
        come_in_s: how long a coupling takes to come in that does not say it [s].
    """

    motion: Motion
    make_law: Callable[[], RunningLaw]
    resolution_m: float
    period_s: float
    ramp_s: float
    come_in_s: float
