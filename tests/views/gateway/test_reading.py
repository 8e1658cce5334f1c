"""Clients that read: Isaac Lab's as its authors wrote it, our own driver, and what is not let in."""

from __future__ import annotations

import contextlib
import http.client
import math
import os
import subprocess
import time
from collections.abc import Iterator

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.typing import Origin

from hapticd_drivers.haply.driver import Inverse3, Inverse3Options
from hapticd_views.gateway.server import LARGEST_MESSAGE, MOST_CLIENTS
from tests.daemon.running import HAPTICD, Daemon
from tests.views.gateway.isaac import Isaac
from tests.views.gateway.served import PATIENCE_S, PROBE, Served, answer, force, position_m, told

CONFIG = """
[device.options]
axes = 3
space.position_m = [0.01, -0.02, 0.03]
[[scene.objects]]
name = "ball"
shape = "sphere"
radius_m = 0.01
position_m = [0.2, 0.0, 0.0]
stiffness_n_per_m = 1000.0
"""
HERE_M = (0.01, -0.02, 0.03)
ORIGIN = "http://127.0.0.1:8080"


@pytest.fixture(scope="module")
def daemon() -> Iterator[Daemon]:
    with Daemon(CONFIG) as daemon:
        yield daemon.wait_ready()


@pytest.fixture(scope="module")
def served(daemon: Daemon) -> Iterator[Served]:
    with Served(daemon.directory / "run", "--origin", ORIGIN) as served:
        yield served


def test_isaac_lab_reads_a_live_device_as_it_is(served: Served) -> None:
    with Isaac(served.url) as isaac:
        assert isaac.said.split() == ["connected", "default", "default"]
        read = isaac.read()
    assert read[:3] == pytest.approx(HERE_M, abs=1e-4)
    assert read[3:] == [0, 0, 0, 1, 0, 0, 0]  # upright, no button


def test_our_own_driver_reads_it_too(served: Served) -> None:
    (found,) = Inverse3.find(Inverse3Options(url=served.url))
    assert found.serial == "default"
    with Inverse3(Inverse3Options(url=served.url), 0.001) as driver:
        driver._state_wait_s = 1.0
        first, sequence = driver.read().position_m, driver.read().sequence
        assert list(first) == pytest.approx(HERE_M, abs=1e-4)
        assert driver.read().sequence > sequence


def test_the_first_message_is_an_inventory_and_then_each_message_brings_one_state(served: Served) -> None:
    with served.client() as client:
        first = told(client)
        assert first["inverse3"][0]["config"] == {"handedness": "right"}
        later = [answer(client) for _ in range(3)]
        assert all("config" not in said["inverse3"][0] for said in later)
        assert all(
            said["wireless_verse_grip"][0]["state"]["buttons"] == {"a": False, "b": False, "c": False} for said in later
        )
        with pytest.raises(TimeoutError):
            client.recv(0.2)


def test_forces_are_not_handed_on_unless_asked_for(served: Served, daemon: Daemon) -> None:
    before = served.log.read_text().count("start with --force NAME")
    with served.client() as client:
        told(client)
        for _ in range(5):
            said = answer(client, force(3.0))
    assert position_m(said) == pytest.approx(HERE_M, abs=1e-4)
    assert served.log.read_text().count("start with --force NAME") == before + 1


@pytest.mark.parametrize(
    "message",
    [
        "",
        "{",
        "null",
        "[]",
        '{"inverse3": 5}',
        '{"inverse3": [5]}',
        '{"inverse3": [{"device_id": "default", "commands": 5}]}',
        '{"inverse3": [{"device_id": "default", "commands": {"set_cursor_force": 5}}]}',
        force(math.nan),
        force(math.inf),
        force("1"),
        force(True),
        force(None),
        force(0.125).replace("0.125", "1e999"),
        f'{{"inverse3": {"9" * 5000}}}',
        "[" * 10_000,
        b"\x00\xff",
    ],
    ids=lambda message: str(message)[:60],
)
def test_what_is_not_understood_is_answered_with_a_state_and_told(served: Served, message: str | bytes) -> None:
    with served.client() as client:
        told(client)
        before = served.log.read_text().count("is not understood")
        for _ in range(2):
            assert position_m(answer(client, message)) == pytest.approx(HERE_M, abs=1e-4)
        assert served.log.read_text().count("is not understood") == before + 1


@pytest.mark.parametrize("message", ["{}", '{"inverse3": []}', force(1.0, device="another"), '{"unknown": [1, {}]}'])
def test_what_it_does_not_know_is_ignored(served: Served, message: str) -> None:
    with served.client() as client:
        told(client)
        before = served.log.read_text()
        answer(client, message)
        assert served.log.read_text() == before


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:8081", "https://127.0.0.1:8080"])
def test_a_page_of_another_origin_gets_no_socket(served: Served, origin: str) -> None:
    with pytest.raises(InvalidStatus) as refused, served.client(origin=Origin(origin)):
        pass
    assert refused.value.response.status_code == 403


def test_a_page_of_an_origin_that_was_named_is_let_in(served: Served) -> None:
    with served.client(origin=Origin(ORIGIN)) as client:
        assert told(client)["inverse3"]


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "localhost.evil.example:{port}", ""])
def test_another_host_is_refused(served: Served, host: str) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=PATIENCE_S)
    connection.request("GET", "/", headers={"Host": host.format(port=served.port)})
    assert connection.getresponse().status == 421
    connection.close()


def test_a_message_that_is_too_long_ends_its_connection_and_no_other(served: Served) -> None:
    with served.client() as other, served.client() as client:
        told(client)
        client.send(" " * (LARGEST_MESSAGE + 1))
        with pytest.raises(ConnectionClosed):
            client.recv(PATIENCE_S)
        assert client.close_code == 1009
        assert told(other)["inverse3"]


def test_so_many_clients_and_no_more(served: Served) -> None:
    with contextlib.ExitStack() as stack:
        for _ in range(MOST_CLIENTS):
            told(stack.enter_context(served.client()))
        with pytest.raises(InvalidStatus) as refused, served.client():
            pass
        assert refused.value.response.status_code == 503


def test_a_client_that_never_reads_costs_the_others_nothing(served: Served) -> None:
    """It asks for states as fast as it can and takes none."""
    before_kb = served.memory_kb()
    with served.client() as other, served.deaf() as deaf:
        told(other)
        for _ in range(20):
            deaf.say(PROBE)
            assert position_m(answer(other)) == pytest.approx(HERE_M, abs=1e-4)
    assert served.memory_kb() < before_kb + 2_000


def test_while_the_daemon_is_away_there_is_no_device_and_then_there_is_again() -> None:
    with Daemon(CONFIG) as daemon:
        daemon.wait_ready()
        runtime = daemon.directory / "run"
        with Served(runtime) as served, served.client() as client:
            told(client)
            daemon.process.terminate()
            daemon.wait_exit()
            end_s = time.monotonic() + PATIENCE_S
            while answer(client)["inverse3"]:
                assert time.monotonic() < end_s
            env = {"HAPTICD_RUNTIME_DIR": str(runtime), "HAPTICD_STATE_DIR": str(daemon.directory / "state")}
            again = subprocess.Popen([HAPTICD, "run", "--config", str(daemon.config)], env={**os.environ, **env})
            try:
                while not answer(client)["inverse3"]:
                    assert time.monotonic() < end_s
            finally:
                again.terminate()
                again.wait(PATIENCE_S)
