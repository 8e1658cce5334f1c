"""What is not let in, and what it costs the others: nothing."""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import re
import socket
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from hapticd_views.dashboard.frames import HEADER
from hapticd_views.dashboard.requests import LARGEST_REQUEST
from hapticd_views.dashboard.viewers import MOST_UNSENT
from tests.daemon.running import HAPTICD, Daemon
from tests.views.dashboard.served import Served

CONFIG = "[[scene.walls]]\nstiffness_n_per_m = 3000.0\n"
PATIENCE_S = 30.0


@pytest.fixture(scope="module")
def daemon() -> Iterator[Daemon]:
    with Daemon(CONFIG) as daemon:
        yield daemon.wait_ready()


@pytest.fixture(scope="module")
def served(daemon: Daemon) -> Iterator[Served]:
    with Served(daemon.directory / "run") as served:
        yield served


@contextlib.contextmanager
def viewer(served: Served, token: str = "", **changed: Any) -> Iterator[ClientConnection]:
    """A WebSocket as the page opens it, hello said."""
    with open_socket(served, **changed) as socket:
        socket.send(json.dumps({"do": "hello", "token": token}))
        yield socket


def open_socket(served: Served, **changed: Any) -> ClientConnection:
    settings: dict[str, Any] = {"origin": Origin(served.watch.rstrip("/")), "compression": None, "max_size": None}
    settings["open_timeout"] = PATIENCE_S
    socket: ClientConnection = connect(f"ws://127.0.0.1:{served.port}/live", **(settings | changed))
    return socket


def get(served: Served, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=PATIENCE_S)
    try:
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()
    finally:
        connection.close()


def answered(socket: ClientConnection, request: dict[str, Any]) -> dict[str, Any]:
    """The answer to a request, whatever else comes."""
    socket.send(json.dumps({"id": 7, **request}))
    while True:
        message = socket.recv(PATIENCE_S)
        if isinstance(message, str) and json.loads(message).get("answer") == 7:
            answer: dict[str, Any] = json.loads(message)
            return answer


def ticks(message: str | bytes) -> list[int]:
    """Numbers of the ticks in a message."""
    seqs: list[int] = []
    at = 0
    while isinstance(message, bytes) and at < len(message):
        count, axes, _, first, _ = HEADER.unpack_from(message, at)
        columns = 2 + 3 * axes + 7
        at += HEADER.size
        seqs += [int(first + seq) for seq in struct.unpack_from(f"<{count}f", message, at + 4 * count)]
        at += 4 * count * columns
    return seqs


def close_code(socket: ClientConnection) -> int:
    """With what the server closes a connection."""
    with contextlib.suppress(ConnectionClosed):
        while True:
            socket.recv(PATIENCE_S)
    assert socket.close_code is not None
    return socket.close_code


def said(daemon: Daemon) -> list[str]:
    """The log but for what a busy computer brings about, which may come at any time."""
    return [line for line in daemon.output().splitlines() if not line.endswith(" deadlines were missed at once")]


def is_well(served: Served) -> None:
    """A viewer that comes now gets ticks, one after the other."""
    with viewer(served) as socket:
        seqs: list[int] = []
        while len(seqs) < 500:
            seqs += ticks(socket.recv(PATIENCE_S))
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1", "127.0.0.1:1", "localhost.evil.example:{port}", "127.0.0.1:{port}, evil", ""]
)
def test_another_host_is_refused_whatever_is_asked_for(served: Served, host: str) -> None:
    """A name whose owner lets it point to this computer would make a page of theirs look like ours."""
    for path in ("/", "/main.js", "/live"):
        status, _, body = get(served, path, Host=host.format(port=served.port))
        assert (status, b"hapticd" in body) == (421, False)


@pytest.mark.parametrize("host", ["localhost:{port}", "127.0.0.1:{port}"])
def test_its_own_names_are_let_in_each_with_its_own_origin(served: Served, host: str) -> None:
    named = host.format(port=served.port)
    assert get(served, "/", Host=named)[0] == 200
    with connect(f"ws://{named}/live", origin=Origin(f"http://{named}"), compression=None) as socket:
        socket.send('{"do": "hello"}')
        assert json.loads(socket.recv(PATIENCE_S))["hello"]["may_command"] is False


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "null", "https://127.0.0.1:{port}", "http://127.0.0.1", "http://localhost:{port}", None],
)
def test_a_page_of_another_origin_gets_no_socket(served: Served, origin: str | None) -> None:
    given = Origin(origin.format(port=served.port)) if origin else None
    with pytest.raises(InvalidStatus) as refused, viewer(served, served.token, origin=given):
        pass
    assert refused.value.response.status_code == 403


def test_every_answer_says_what_a_browser_may_do_with_it(served: Served) -> None:
    for path, expected in (("/", 200), ("/main.js", 200), ("/vendor/uPlot.LICENSE", 200), ("/nothing", 404)):
        status, headers, _ = get(served, path)
        assert status == expected
        policy = headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert not re.search(r"\bhttps?:|\*", policy)
        assert headers["x-content-type-options"] == "nosniff"
        assert "server" not in headers


@pytest.mark.parametrize(
    "path", ["/../server.py", "/..%2fserver.py", "//etc/passwd", "/vendor", "/vendor/../index.html", "/.", "/server.py"]
)
def test_nothing_but_the_page_is_to_be_had(served: Served, path: str) -> None:
    assert get(served, path)[0] == 404


@pytest.mark.parametrize("token", ["", "x", "ü"])
@pytest.mark.parametrize("do", ["arm", "disarm", "clear", "edit"])
def test_without_the_token_nothing_is_commanded(served: Served, daemon: Daemon, do: str, token: str) -> None:
    before = said(daemon)
    request = {"do": do, **({"hash": "", "law": "none", "values": {}} if do == "edit" else {})}
    with viewer(served, token) as socket:
        answer = answered(socket, request)
    assert answer["ok"] is False
    assert "read only" in answer["text"]
    assert said(daemon) == before
    assert daemon.config.read_text() == CONFIG


def test_what_was_asked_for_long_ago_is_not_done_but_for_disarming(served: Served, daemon: Daemon) -> None:
    """A server that stood still armed the device when it went on, however long after the button was pressed."""
    with viewer(served, served.token) as socket:
        now = json.loads(socket.recv(PATIENCE_S))["now"]
        assert answered(socket, {"do": "disarm", "now": now - 60.0})["ok"] is True
        form = answered(socket, {"do": "form", "now": now - 60.0})["form"]
        edit = {"do": "edit", "hash": form["hash"], "law": "none", "values": {}}
        for request in ({"do": "arm"}, {"do": "clear"}, edit):
            answer = answered(socket, {**request, "now": now - 60.0})
            assert answer["ok"] is False
            assert re.fullmatch(r"was asked for \d\d s ago, and so is not done any more", answer["text"])
        assert daemon.config.read_text() == CONFIG
        assert answered(socket, {"do": "arm", "now": now})["ok"] is True


@pytest.mark.parametrize(
    "message",
    [
        "",
        "{",
        "null",
        "[]",
        '"arm"',
        '{"do": "stop"}',
        '{"do": "calibrate"}',
        '{"do": "arm", "id": "x"}',
        '{"do": "arm", "id": 1, "more": 1}',
        '{"do": ["arm"]}',
        '{"do": "hello", "token": ""}',
        '{"do": "edit", "hash": "", "law": "none", "values": {"safety.max_force_n": NaN}}',
        '{"do": "edit", "hash": "", "law": "none", "values": {"safety.max_force_n": [1]}}',
        '{"do": "edit", "hash": "", "law": 1}',
        '{"do": "edit", "hash": "", "law": "\\ud800", "values": {}}',
        '{"do": "edit", "hash": "", "law": "none", "values": {"safety.max_force_n": 1e999}}',
        "[" * 10_000,
        b"\x00\xff",
    ],
    ids=lambda message: str(message)[:40],
)
def test_a_forged_message_ends_its_connection_and_no_other(served: Served, message: str | bytes) -> None:
    with viewer(served, served.token) as other, viewer(served, served.token) as socket:
        socket.send(message)
        assert close_code(socket) == 1008
        assert answered(other, {"do": "disarm"})["ok"] is True
        assert answered(other, {"do": "arm"})["ok"] is True


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("device.driver", "omega7"),
        ("loop.rate_hz", 8000),
        ("service.reload_on_save", True),
        ("safety.profile", "simulation' # "),
        ("scene.walls[9].axis", "x"),
        ("safety.max_force_n\nx", 1),
        ("controller.law", "os"),
    ],
)
def test_the_form_reaches_no_further_than_its_fields(
    served: Served, daemon: Daemon, key: str, value: str | float | bool
) -> None:
    with viewer(served, served.token) as socket:
        form = answered(socket, {"do": "form"})["form"]
        edit = {"do": "edit", "hash": form["hash"], "law": form["law"], "values": {key: value}}
        assert answered(socket, edit)["ok"] is False
    assert daemon.config.read_text() == CONFIG


def test_an_oversized_message_ends_its_connection_and_no_other(served: Served) -> None:
    with viewer(served, served.token) as socket:
        socket.send(json.dumps({"do": "arm", "more": "x" * LARGEST_REQUEST}))
        assert close_code(socket) == 1009
    is_well(served)


@pytest.mark.parametrize(
    "first", ['{"do": "disarm", "id": 1}', '{"do": "hello", "token": "\\ud800"}', '{"do": "hello", "token": 1}', "\0"]
)
def test_who_does_not_say_hello_gets_nothing(served: Served, first: str) -> None:
    with open_socket(served) as socket:
        socket.send(first)
        with pytest.raises(ConnectionClosed):
            socket.recv(PATIENCE_S)


def test_a_viewer_that_never_reads_is_dropped_and_costs_the_others_nothing(served: Served) -> None:
    deaf = socket.create_connection(("127.0.0.1", served.port))
    deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    # Behind bytes that its full buffer has dropped, a reset is out of its window and not believed: it asks for another.
    deaf.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    deaf.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 1)
    try:
        deaf.sendall(
            (
                f"GET /live HTTP/1.1\r\nHost: 127.0.0.1:{served.port}\r\nOrigin: http://127.0.0.1:{served.port}\r\n"
                "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
                "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
            ).encode()
        )
        hello = json.dumps({"do": "hello"}).encode()
        deaf.sendall(bytes([0x81, 0x80 | len(hello), 0, 0, 0, 0]) + hello)
        with viewer(served) as other:
            before_kb = served.memory_kb()
            seqs: list[int] = []
            while not _was_reset(deaf):
                seqs += ticks(other.recv(PATIENCE_S))
            assert len(seqs) > MOST_UNSENT
            assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))
            assert served.memory_kb() - before_kb < 20_000
    finally:
        deaf.close()
    is_well(served)


def test_a_build_without_the_plots_says_what_to_do(installed: Path, tmp_path: Path) -> None:
    """The wheel of this checkout has them, with their licence; without, the command says which command makes them."""
    vendor = installed / "hapticd_views" / "dashboard" / "page" / "vendor"
    assert "MIT License" in (vendor / "uPlot.LICENSE").read_text()
    plots = vendor / "uPlot.esm.js"
    kept = plots.rename(tmp_path / "kept.js")
    try:
        environment = {**os.environ, "PYTHONPATH": str(installed), "HAPTICD_RUNTIME_DIR": str(tmp_path)}
        done = subprocess.run(
            [HAPTICD, "dashboard"], env=environment, capture_output=True, text=True, timeout=60, check=False
        )
        assert done.returncode == 1
        assert str(plots) in done.stderr
        assert "make web" in done.stderr
    finally:
        kept.rename(plots)


def _was_reset(deaf: socket.socket) -> bool:
    """Whether the other end has given up; what it has sent is left unread."""
    return deaf.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR) != 0
