"""Off loopback, where anybody may look, nothing is shown without the token."""

from __future__ import annotations

import asyncio
import json
import re
from pathlib import Path

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Origin

from hapticd.errors import ClientError
from hapticd_views.address import Address
from hapticd_views.commands.dashboard import PORT
from hapticd_views.dashboard.server import Dashboard
from hapticd_views.dashboard.target import Target
from tests.ports import free_port


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "", "lab.example", "127.0.0.1:80"])
def test_a_host_is_one_address(host: str) -> None:
    with pytest.raises(ClientError, match="--host"):
        Address(host, 9874)


@pytest.mark.parametrize(
    ("host", "named", "others"),
    [
        ("127.0.0.1", ["127.0.0.1:9874", "localhost:9874", "LOCALHOST:9874"], ["127.0.0.1", "127.0.0.2:9874"]),
        ("192.0.2.7", ["192.0.2.7:9874"], ["localhost:9874", "127.0.0.1:9874", "192.0.2.7:98740"]),
        ("::1", ["[::1]:9874", "localhost:9874"], ["::1:9874", "[::1]"]),
    ],
)
def test_it_goes_by_its_own_names_only(host: str, named: list[str], others: list[str]) -> None:
    address = Address(host, 9874)
    assert all(address.is_named([name]) for name in named)
    assert not any(address.is_named([name]) for name in others)
    assert not address.is_named([])
    assert not address.is_named(named[:1] * 2)
    assert address.is_origin(named[:1], [f"http://{named[0]}"])
    assert not address.is_origin(named[:1], [f"https://{named[0]}"])
    assert not address.is_origin(named[:1], [])


async def _first(connection: ClientConnection, token: str) -> str:
    """What a viewer with this token hears first, or with what it is sent away."""
    await connection.send(json.dumps({"do": "hello", "token": token}))
    try:
        return str(await connection.recv())
    except ConnectionClosed as closed:
        return str(closed.rcvd)


def test_off_loopback_watching_takes_the_token() -> None:
    """The address is a loopback one all the same: what it is taken for is what counts."""
    address = Address("127.0.0.1", free_port())
    address.is_loopback = False

    async def heard() -> list[str]:
        ready = asyncio.Event()
        serving = asyncio.create_task(Dashboard(Target("absent"), address, "right").run(ready.set))
        await ready.wait()
        said = []
        for token in ("", "wrong", "right"):
            origin = Origin(address.url.rstrip("/"))
            async with connect(f"{address.live[0]}/live", origin=origin) as connection:
                said.append(await _first(connection, token))
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
        return said

    without, wrong, right = asyncio.run(heard())
    assert "4401" in without
    assert "4401" in wrong
    assert json.loads(right)["hello"]["may_command"] is True


def test_the_page_takes_no_port_that_the_pages_give_to_a_daemon_or_its_metrics() -> None:
    root = Path(__file__).parents[3]
    others = "".join((root / page).read_text() for page in ("config/hapticd.toml", "docs/remote.md", "docs/metrics.md"))
    named = {int(port) for port in re.findall(r":(\d{4,5})\b", others)}
    assert {9872, 9874, 9876} <= named
    assert PORT not in named
