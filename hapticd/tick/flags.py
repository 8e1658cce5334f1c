"""State bits of a tick."""

from __future__ import annotations

import enum


class Flag(enum.IntFlag):
    """State bits of a tick."""

    ARMED = 1  # forces are let through
    FALLBACK = 2  # the law failed and the damping fallback stands in for it
    RELEASING = 4  # the force is being ramped to zero
    LATCHED = 8  # stopped by a fault until cleared
    LIMITED = 16  # the guard reduced the force in this tick
    UNCALIBRATED = 32  # the device does not know where it is


FORCES = Flag.ARMED | Flag.RELEASING
"""Either of them: there may be a force."""
