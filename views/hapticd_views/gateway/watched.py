"""The device as any subscriber sees it: to read, and no force."""

from __future__ import annotations

from collections.abc import Sequence

from hapticd.client import DaemonClient, Input, Position
from hapticd_views.gateway.cursor import UPRIGHT, Cursor, in_space, quaternion

TOPICS = (Position, Input)


class Watched:
    """The device as the daemon's telemetry tells it, a message of some ticks at a time.

    Args:
        daemon: connected with `TOPICS`.
    """

    def __init__(self, daemon: DaemonClient) -> None:
        self._daemon = daemon
        self._orientation = UPRIGHT
        self._buttons = 0

    def next(self, timeout_s: float) -> Cursor | None:
        """As `Device.next`."""
        newest: Position | None = None
        records = self._daemon.receive(timeout_s)
        while records:
            for record in records:
                if isinstance(record, Position):
                    newest = record
                elif isinstance(record, Input):
                    self._orientation = quaternion(record.orientation)
                    self._buttons = record.buttons or 0
            records = self._daemon.receive(0.0)
        status = self._daemon.latest_status
        if newest is None or status is None:
            return None
        return Cursor(
            newest.seq,
            in_space(newest.position_m, status.axes),
            in_space(newest.velocity_m_per_s, status.axes),
            self._orientation,
            self._buttons,
        )

    def push(self, force_n: Sequence[float]) -> None:
        """Nothing: who only watches gives no force."""

    def let_go(self) -> None:
        """Nothing either."""
