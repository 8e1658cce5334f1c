"""Connections that have not said what they want: a bound, so that those that never do use up nothing."""

from __future__ import annotations

from typing import Any

from websockets.asyncio.server import ServerConnection

MOST_WAITING = 64
"""Connections of a server that may be on their way in; one more ends the oldest."""


class Knocking:
    """Connections on their way in."""

    def __init__(self) -> None:
        self._waiting: dict[ServerConnection, None] = {}  # oldest first

    def connection(self) -> type[ServerConnection]:
        """What a server makes of each connection; `welcome` takes it out of the bound."""
        waiting = self._waiting

        class Knocker(ServerConnection):
            def connection_made(self, transport: Any) -> None:
                super().connection_made(transport)
                if len(waiting) >= MOST_WAITING:
                    oldest = next(iter(waiting))
                    del waiting[oldest]
                    oldest.transport.abort()
                waiting[self] = None

            def connection_lost(self, exc: Exception | None) -> None:
                waiting.pop(self, None)
                super().connection_lost(exc)

        return Knocker

    def welcome(self, connection: ServerConnection) -> None:
        """It has said what it wants, and counts among those that are in."""
        self._waiting.pop(connection, None)
