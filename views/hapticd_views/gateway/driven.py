"""The device as one that pushes it sees it: each tick as it comes, and a force of the scene to drive."""

from __future__ import annotations

from collections.abc import Sequence

from hapticd.client import RemotePort
from hapticd.errors import ClientError, SilenceError
from hapticd_views.gateway.cursor import Cursor, in_space, on_axes, quaternion


class Driven:
    """The device, and a `[[scene.forces]]` of the configuration.

    Args:
        port: the force.

    Raises:
        ClientError: it is no force.
    """

    def __init__(self, port: RemotePort) -> None:
        if port.kind != "force":
            raise ClientError(f"--force {port.name}: is a {port.kind} of the scene: name one of its [[scene.forces]]")
        self._port = port

    def next(self, timeout_s: float) -> Cursor | None:
        """As `Device.next`."""
        try:
            state = self._port.state(timeout_s)
        except SilenceError:
            return None
        axes = self._port.axes
        return Cursor(
            state.seq,
            in_space(state.position_m, axes),
            in_space(state.velocity_m_per_s, axes),
            quaternion(state.orientation),
            state.buttons,
        )

    def push(self, force_n: Sequence[float]) -> None:
        """As `Device.push`."""
        self._port.push(on_axes(force_n, self._port.axes))

    def let_go(self) -> None:
        """As `Device.let_go`."""
        self._port.release()
