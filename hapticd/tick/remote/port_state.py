"""How a port stands with its client."""

from __future__ import annotations

import enum


class PortState(enum.IntEnum):
    """How a port stands with its client."""

    IDLE = 0  # no client has said anything yet
    HELD = 1  # in force
    STALE = 2  # the client's word is too old, or the same for too long: let go
    RELEASED = 3  # the client has let go
