"""Many of everything at the page's server: connections that say nothing, commands without an end."""

from __future__ import annotations

import contextlib
import json
import socket
from collections.abc import Iterator

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection

from tests.daemon.running import Daemon
from tests.daemon.test_flood import FEW_DESCRIPTORS, flood
from tests.views.dashboard.served import Served
from tests.views.dashboard.test_hostile import CONFIG, PATIENCE_S, answered, close_code, get, is_well, viewer

HALF_OPEN = 1500
COMMANDS = 10_000
LARGEST_KB = 150_000


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    with Daemon(CONFIG) as daemon, Served(daemon.wait_ready().directory / "run", prefix=FEW_DESCRIPTORS) as served:
        yield served


def test_connections_that_say_nothing_do_not_keep_a_page_from_disarming(served: Served) -> None:
    """More than a shell's descriptors; a page that comes then is let in when they have been dropped."""
    with viewer(served, served.token) as page:
        assert answered(page, {"do": "arm"})["ok"]
        with flood(("127.0.0.1", served.port), HALF_OPEN) as opened:
            opened[0].sendall(b"GET / HTTP/1.1\r\nHost: ")
            assert answered(page, {"do": "disarm"})["ok"]
            assert get(served, "/")[0] == 200
            with viewer(served, served.token) as another:
                assert answered(another, {"do": "arm"})["ok"]
    is_well(served)
    assert served.memory_kb() < LARGEST_KB


def test_ten_thousand_commands_of_one_page_do_not_keep_another_from_disarming(served: Served) -> None:
    with viewer(served, served.token) as busy, viewer(served, served.token) as page:
        for number in range(COMMANDS):
            try:
                busy.send(json.dumps({"do": "arm", "id": number}))
            except ConnectionClosed:  # it may be dropped for what it does not read
                break
            if number in (COMMANDS // 4, COMMANDS // 2):
                was_disarmed(page)
        was_disarmed(page)
    is_well(served)
    assert served.memory_kb() < LARGEST_KB


def was_disarmed(page: ClientConnection) -> None:
    """Whoever goes on arming may have done so by the time that the device had let go: then that is the answer."""
    said = answered(page, {"do": "disarm"})
    assert said["ok"] or said["text"] == "it was disarmed, and somebody has armed it again since"


def test_a_message_in_endless_pieces_ends_its_connection(served: Served) -> None:
    """Each piece is small; together they are larger than what a page may ask for."""
    with viewer(served, served.token) as rude:
        with contextlib.suppress(ConnectionClosed):
            rude.send("x" * 1000 for _ in range(10_000))
        assert close_code(rude) == 1009
    is_well(served)


@pytest.mark.nightly
def test_a_request_that_never_ends_is_given_up(served: Served) -> None:
    with socket.create_connection(("127.0.0.1", served.port), timeout=PATIENCE_S) as slow:
        slow.sendall(b"GET /live HTTP/1.1\r\nHost: 127.0.0.1\r\n")
        slow.settimeout(PATIENCE_S)
        assert slow.recv(1000) == b""
    is_well(served)
