"""The server of the page: its files, and a WebSocket that shows and, with the token, commands."""

from __future__ import annotations

import asyncio
import errno
import logging
import secrets
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from http import HTTPStatus
from typing import Any

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from hapticd.errors import ClientError, HapticdError
from hapticd.version import __version__
from hapticd_views.address import Address
from hapticd_views.dashboard.editor import Editor
from hapticd_views.dashboard.feed import Feed
from hapticd_views.dashboard.history import KEEP_S
from hapticd_views.dashboard.page import Page
from hapticd_views.dashboard.requests import LARGEST_REQUEST, Command, Edit, FormRequest, Hello, request
from hapticd_views.dashboard.target import Target
from hapticd_views.dashboard.viewers import MOST_VIEWERS, Audience, Viewer
from hapticd_views.knocking import Knocking

LIVE = "/live"
"""Path of the WebSocket."""

HELLO_S = 5.0
"""How long a page may take to say hello [s]."""

EXPIRES_S = 5.0
"""What a page asked for longer ago than this is not done any more [s]; disarming is."""

MOST_ASKED = {"disarm": 32}
"""Requests of a page that may wait for their answers; 4 of those that are not named here."""

_THREADS = {"disarm": 4, "command": 1, "file": 1}
_READ_ONLY = "read only: open the address that `hapticd dashboard` printed, with its token"


class Dashboard:
    """The page of one daemon.

    Args:
        target: the daemon.
        address: where the page is.
        token: who knows it may command.
    """

    def __init__(self, target: Target, address: Address, token: str) -> None:
        self._target = target
        self._address = address
        self._token = token
        self._page = Page(address)
        self._knocking = Knocking()
        self._audience = Audience()
        self._feed = Feed(target, self._audience.send)
        self._editor = Editor(target)
        # What the daemon is asked waits for its answer in a thread. Disarming waits behind nothing else.
        self._threads = {name: ThreadPoolExecutor(count, name) for name, count in _THREADS.items()}

    async def run(self, ready: Callable[[], None]) -> None:
        """Serve until cancelled.

        Args:
            ready: called once the page can be opened.

        Raises:
            ClientError: the port cannot be had.
        """
        serving = serve(
            self._look,
            self._address.host,
            self._address.port,
            process_request=self._admit,
            create_connection=self._knocking.connection(),
            compression=None,
            max_size=LARGEST_REQUEST,
            max_queue=4,
            close_timeout=1.0,
            server_header=None,
            logger=_silent(),
        )
        try:
            async with serving:
                ready()
                await self._feed.run()
        except BrokenPipeError:
            raise  # standard output, where it is said that it is ready
        except OSError as error:
            advice = "; name another --port" if error.errno in (errno.EADDRINUSE, errno.EACCES) else ""
            raise ClientError(f"{self._address.url}: {error.strerror}{advice}") from None
        finally:
            for threads in self._threads.values():
                threads.shutdown(wait=False, cancel_futures=True)

    def _admit(self, _: ServerConnection, asked: Request) -> Response | None:
        """The answer to a request; None lets a page of ours have its WebSocket."""
        hosts, origins = asked.headers.get_all("Host"), asked.headers.get_all("Origin")
        if not self._address.is_named(hosts):
            return self._page.refusal(HTTPStatus.MISDIRECTED_REQUEST, f"this page is {self._address.url}")
        if asked.path != LIVE:
            return self._page.answer(asked.path)
        if not self._address.is_origin(hosts, origins):
            return self._page.refusal(HTTPStatus.FORBIDDEN, "pages of other origins are not let in")
        if len(self._audience) >= MOST_VIEWERS:
            return self._page.refusal(HTTPStatus.SERVICE_UNAVAILABLE, f"{MOST_VIEWERS} pages look already")
        return None

    async def _look(self, connection: ServerConnection) -> None:
        """One page, from its hello until it has gone."""
        viewer = Viewer(connection)
        try:
            async with asyncio.timeout(HELLO_S):
                hello = request(await connection.recv())
            if not isinstance(hello, Hello):
                await connection.close(1008, "hello first")
                return
            viewer.may_command = secrets.compare_digest(hello.token.encode(), self._token.encode())
            if not (viewer.may_command or self._address.is_loopback):
                await connection.close(4401, "the token is missing")
                return
        except (TimeoutError, ConnectionClosed):
            return
        told = {"version": __version__, "keep_s": KEEP_S, "may_command": viewer.may_command}
        viewer.answer({"now": time.monotonic(), "hello": told})
        self._knocking.welcome(connection)
        self._audience.join(viewer, self._feed.history.messages())
        sending = asyncio.create_task(viewer.run())
        try:
            await self._serve(connection, viewer)
        except ConnectionClosed:
            pass
        finally:
            self._audience.leave(viewer)
            sending.cancel()

    async def _serve(self, connection: ServerConnection, viewer: Viewer) -> None:
        """Answer what a page asks for, one thing not waiting for another."""
        under_way: set[asyncio.Task[None]] = set()
        async for text in connection:
            asked = request(text)
            if asked is None or isinstance(asked, Hello):
                await connection.close(1008, "not understood")
                return
            if len(under_way) >= MOST_ASKED.get(asked.do, 4):
                viewer.answer({"answer": asked.id, "ok": False, "text": "busy with what was asked before"})
                continue
            task = asyncio.create_task(self._answer(asked, viewer))
            under_way.add(task)
            task.add_done_callback(under_way.discard)

    async def _answer(self, asked: Command | FormRequest | Edit, viewer: Viewer) -> None:
        """Do what a page asks for, and tell it how that went."""
        if not (viewer.may_command or isinstance(asked, FormRequest)):
            viewer.answer({"answer": asked.id, "ok": False, "text": _READ_ONLY})
            return
        try:
            said = await asyncio.get_running_loop().run_in_executor(self._threads[_thread(asked)], self._do, asked)
        except HapticdError as error:
            said = {"ok": False, "text": str(error)}
        except Exception as error:  # noqa: BLE001 - a page that gets no answer would wait for ever
            said = {"ok": False, "text": f"defect: {type(error).__name__}: {error}"}
        viewer.answer({"answer": asked.id, **said})

    def _do(self, asked: Command | FormRequest | Edit) -> dict[str, Any]:
        age_s = time.monotonic() - asked.now  # it may have waited for the network, or for a server that stood still
        if age_s > EXPIRES_S and not isinstance(asked, FormRequest) and asked.do != "disarm":
            raise ClientError(f"was asked for {age_s:.0f} s ago, and so is not done any more")
        match asked:
            case Command():
                self._target.ask(asked.do)
                return {"ok": True}
            case FormRequest():
                return {"ok": True, "form": self._editor.form()}
            case Edit():
                problems = self._editor.edit(asked.hash, asked.law, asked.values)
                return {"ok": not problems, "problems": problems}


def _silent() -> logging.Logger:
    """What strangers send is no news, and their number has no bound."""
    logger = logging.getLogger("hapticd.dashboard")
    logger.setLevel(logging.CRITICAL)
    return logger


def _thread(asked: Command | FormRequest | Edit) -> str:
    return "file" if not isinstance(asked, Command) else asked.do if asked.do in _THREADS else "command"
