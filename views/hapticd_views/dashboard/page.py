"""The files of the page, as HTTP answers; there is nothing else to be had."""

from __future__ import annotations

from http import HTTPStatus
from pathlib import Path

from websockets.datastructures import Headers
from websockets.http11 import Response

from hapticd.errors import ClientError
from hapticd_views.address import Address

FOLDER = Path(__file__).parent / "page"

_PLOTS = "vendor/uPlot.esm.js"
_KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".LICENSE": "text/plain; charset=utf-8",
}


class Page:
    """Every file of the page, read once.

    Args:
        address: where the page is.
        folder: its files.

    Raises:
        ClientError: this build has no plots; the message says what to do.
    """

    def __init__(self, address: Address, folder: Path = FOLDER) -> None:
        if not (folder / _PLOTS).is_file():
            raise ClientError(
                f"{folder / _PLOTS}: not there: in a checkout run `make web` (it needs npm); a wheel without it was "
                "built before that"
            )
        self._headers = {
            "Content-Security-Policy": (
                f"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
                f"connect-src 'self' {' '.join(address.live)}; base-uri 'none'; form-action 'none'; "
                "frame-ancestors 'none'"
            ),
            "Cross-Origin-Opener-Policy": "same-origin",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "Cache-Control": "no-store",
        }
        self._files = {
            f"/{path.relative_to(folder).as_posix()}": (_KINDS[path.suffix], path.read_bytes())
            for path in folder.rglob("*")
            if path.suffix in _KINDS
        }
        self._files["/"] = self._files["/index.html"]

    def answer(self, path: str) -> Response:
        """The file at a path, or that there is none."""
        kind, body = self._files.get(path.partition("?")[0], ("", b""))
        return self._response(HTTPStatus.OK, kind, body) if kind else self.refusal(HTTPStatus.NOT_FOUND)

    def refusal(self, status: HTTPStatus, why: str = "") -> Response:
        """An answer without a page."""
        return self._response(status, _KINDS[".LICENSE"], f"{why or status.phrase}\n".encode())

    def _response(self, status: HTTPStatus, kind: str, body: bytes) -> Response:
        headers = Headers({**self._headers, "Content-Type": kind, "Content-Length": str(len(body))})
        headers["Connection"] = "close"
        return Response(status, status.phrase, headers, body)
