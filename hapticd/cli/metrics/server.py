"""An HTTP server for metrics that a peer, however it behaves, costs a bounded share of: threads, time, questions."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterable
from socketserver import TCPServer, ThreadingMixIn
from typing import Any
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer

from prometheus_client import CollectorRegistry, make_wsgi_app
from prometheus_client.core import Metric
from prometheus_client.registry import Collector

MOST_CONNECTIONS = 16
"""Connections at a time; another one is closed at once."""

LONGEST_S = 10.0
"""How long a connection may last [s]."""

FRESH_S = 1.0
"""How long an answer of the daemons is used again [s]: no crowd of peers asks them more often."""


class Asked(Collector):
    """Metrics that are asked for when somebody reads them, and no more often than they change.

    Args:
        ask: makes them.
    """

    def __init__(self, ask: Callable[[], list[Metric]]) -> None:
        self._ask = ask
        self._lock = threading.Lock()
        self._answer: list[Metric] = []
        self._good_until_s = 0.0

    def collect(self) -> Iterable[Metric]:
        """What they were at most `FRESH_S` ago."""
        with self._lock:
            if time.monotonic() >= self._good_until_s:
                self._answer = self._ask()
                self._good_until_s = time.monotonic() + FRESH_S
            return self._answer


class MetricsServer(ThreadingMixIn, WSGIServer):
    """Serves `/metrics`, in the format that the reader asks for.

    Args:
        host: name or address to listen on.
        port: a free one when 0.
        collector: of the metrics.

    Attributes:
        url: where they are.

    Raises:
        OSError: it cannot listen there.
    """

    daemon_threads = True
    block_on_close = False

    def __init__(self, host: str, port: int, collector: Collector) -> None:
        registry = CollectorRegistry()
        registry.register(collector)
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        self.address_family = family
        self._free = threading.BoundedSemaphore(MOST_CONNECTIONS)
        super().__init__(address[:2], _Handler)  # type: ignore[arg-type]  # of an address whose family is known
        self.set_app(make_wsgi_app(registry))
        bound, port = self.socket.getsockname()[:2]
        self.url = f"http://{f'[{bound}]' if ':' in bound else bound}:{port}/metrics"

    def server_bind(self) -> None:
        """Bind, and ask no name server what this address may be called."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = self.socket.getsockname()[:2]
        self.setup_environ()

    def process_request(self, request: Any, client_address: Any) -> None:
        """Give a connection a thread, if there is one left."""
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection for as long as it may last."""
        end = threading.Timer(LONGEST_S, _cut, (request,))
        end.daemon = True
        end.start()
        try:
            super().process_request_thread(request, client_address)
        finally:
            end.cancel()
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A peer that goes, or is cut off, is nothing to tell."""


class _Handler(WSGIRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - its name in the base class
        """Requests are not logged: they come every few seconds."""


def _cut(request: socket.socket) -> None:
    with contextlib.suppress(OSError):  # it has just ended by itself
        request.shutdown(socket.SHUT_RDWR)
