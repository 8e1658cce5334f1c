"""The WebSocket server of a gateway: who is let in, who may push, and one state for each message."""

from __future__ import annotations

import asyncio
import errno
import logging
import math
import socket
import time
from collections.abc import Callable, Sequence
from http import HTTPStatus

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from hapticd.errors import ClientError
from hapticd_views.address import Address
from hapticd_views.gateway import haply
from hapticd_views.gateway.follower import Device, Follower
from hapticd_views.knocking import Knocking

LARGEST_MESSAGE = 16 * 1024
"""Bytes; a client that sends more is disconnected."""

MOST_CLIENTS = 16

KERNEL_BYTES = 16 * 1024
"""What the kernel may keep for one client: with more, one that does not read would go on pushing for long."""

SILENT_S = 1.0
"""After this time without a message the one that pushes lets another one push [s]."""

NO_FORCE = (0.0, 0.0, 0.0)


class Gateway:
    """A running daemon as Haply's Inverse service.

    Each client has its own place in the event loop, which only waits there when the client does not read: it then gets
    no state, sends no force that anything reads, and no other client notices.

    Args:
        address: where it listens.
        device: of the daemon.
        name: of the device, for clients.
        may_push: clients' forces are handed on.
        origins: of pages that may connect; programs have none.
        tell: takes a line for people.
    """

    def __init__(
        self,
        address: Address,
        device: Device,
        name: str,
        *,
        may_push: bool,
        origins: Sequence[str],
        tell: Callable[[str], None],
    ) -> None:
        self._address = address
        self._device = device
        self._name = name
        self._may_push = may_push
        self._origins = origins
        self._tell = tell
        self._knocking = Knocking()
        self._clients: set[ServerConnection] = set()
        self._turns = Turns()

    async def run(self, ready: Callable[[], None]) -> None:
        """Serve until cancelled; then the force is let go.

        Args:
            ready: called once clients are let in.

        Raises:
            ClientError: the port cannot be had.
        """
        self._follower = follower = Follower(self._device, self._tell)
        serving = serve(
            self._talk,
            self._address.host,
            self._address.port,
            process_request=self._admit,
            create_connection=self._knocking.connection(),
            compression=None,
            max_size=LARGEST_MESSAGE,
            max_queue=4,
            close_timeout=1.0,
            server_header=None,
            logger=_silent(),
        )
        follower.start()
        try:
            async with serving:
                ready()
                await asyncio.Event().wait()
        except BrokenPipeError:
            raise  # standard output, where it is said that it is ready
        except OSError as error:
            advice = "; name another --port" if error.errno in (errno.EADDRINUSE, errno.EACCES) else ""
            raise ClientError(f"{self._address.live[0]}: {error.strerror}{advice}") from None
        finally:
            follower.end()

    def _admit(self, connection: ServerConnection, asked: Request) -> Response | None:
        """The answer to a request; None lets a client in."""
        hosts, origins = asked.headers.get_all("Host"), asked.headers.get_all("Origin")
        if not self._address.is_named(hosts):
            return connection.respond(HTTPStatus.MISDIRECTED_REQUEST, f"this is {self._address.live[0]}\n")
        if any(origin not in self._origins for origin in origins):
            return connection.respond(HTTPStatus.FORBIDDEN, "pages of other origins are not let in\n")
        if len(self._clients) >= MOST_CLIENTS:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, f"{MOST_CLIENTS} clients are here already\n")
        return None

    async def _talk(self, connection: ServerConnection) -> None:
        """One client, until it has gone."""
        connection.transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, KERNEL_BYTES)
        self._knocking.welcome(connection)
        self._clients.add(connection)
        told: set[str] = set()
        try:
            cursor = await self._follower.newer(-1)
            await connection.send(haply.inventory(self._name, cursor))
            async for message in connection:
                doubt = self._obey(connection, message)
                if doubt and doubt not in told:
                    told.add(doubt)
                    host, port = connection.remote_address[:2]
                    self._tell(f"client {host}:{port}: {doubt}")
                cursor = await self._follower.newer(-1 if cursor is None else cursor.seq)
                await connection.send(haply.reading(self._name, cursor))
        except ConnectionClosed:
            pass
        finally:
            self._clients.discard(connection)
            if self._turns.leave(connection):
                self._follower.let_go()

    def _obey(self, client: ServerConnection, message: str | bytes) -> str:
        """Hand on the force that a message asks for; what is to be said about it, one of a few lines."""
        doubt = ""
        try:
            force_n = haply.force_in(message, self._name) or NO_FORCE
        except ValueError:
            force_n, doubt = NO_FORCE, "a message that is not understood counts as one without a force"
        if not self._may_push:
            return "forces are not handed on: start with --force NAME" if any(force_n) else doubt
        if self._turns.may(client, any(force_n), time.monotonic()):
            self._follower.push(force_n)
        elif any(force_n):
            return "its forces are not handed on: another client pushes"
        return doubt


class Turns:
    """Who may push: the first to ask for a force other than 0, until it leaves or is silent."""

    def __init__(self) -> None:
        self._client: object = None
        self._heard_s = -math.inf

    def may(self, client: object, pushes: bool, now_s: float) -> bool:
        """Whether a client may push now.

        Args:
            client: who asks.
            pushes: the force is another than 0.
            now_s: when it asks [s].
        """
        if client is not self._client:
            if not pushes or (self._client is not None and now_s - self._heard_s < SILENT_S):
                return False
            self._client = client
        self._heard_s = now_s
        return True

    def leave(self, client: object) -> bool:
        """A client has gone; whether it was the one that pushed."""
        if client is not self._client:
            return False
        self._client = None
        return True


def _silent() -> logging.Logger:
    """What strangers send is no news, and their number has no bound."""
    logger = logging.getLogger("hapticd.gateway")
    logger.setLevel(logging.CRITICAL)
    return logger
