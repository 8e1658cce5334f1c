"""A courier that also keeps what it carries, for reports."""

from __future__ import annotations

from hapticd.errors import DriverError
from hapticd.trace import DriverTrace
from hapticd_drivers.haply.courier import Courier


class TracedCourier(Courier):
    """A courier whose messages are kept: `> TEXT` was given to it, `< TEXT` has come; and why the connection ended.

    Args:
        url: of the service.
        trace: where they are kept.

    Raises:
        DriverError: the service is not there, or not reached in time.
    """

    def __init__(self, url: str, trace: DriverTrace) -> None:
        self._trace = trace
        super().__init__(url)

    def send(self, message: str) -> None:
        """Send a message, instead of the one that still waits; does not wait."""
        self._trace.keep(">", message)
        super().send(message)

    def _arrive(self, message: str | bytes) -> None:
        self._trace.keep("<", message)
        super()._arrive(message)

    def _fail(self, error: DriverError) -> None:
        self._trace.keep(error)
        super()._fail(error)
