"""What a shell hands on that is no UTF-8 is refused in one line, and not said to be a defect of ours."""

from __future__ import annotations

import pytest

from hapticd.cli.metrics.command import metrics
from hapticd.client import RefusedError
from hapticd.client.commands import command
from hapticd.client.connection import Client
from hapticd.errors import EndpointError, HapticdError

BYTES = b"\xff\xfe".decode(errors="surrogateescape")


def test_an_endpoint_of_other_bytes_is_none() -> None:
    with pytest.raises(EndpointError, match=r"an endpoint is ipc://PATH"):
        Client(f"ipc:///{BYTES}")
    with pytest.raises(EndpointError, match=r"an endpoint is tcp://HOST:PORT"):
        command("status", connect=f"ipc:///{BYTES}")


def test_a_marker_of_other_bytes_is_not_sent() -> None:
    with pytest.raises(RefusedError, match="mark: a text that is no UTF-8 cannot be sent"):
        command("mark", connect="ipc:///nowhere", text=f"trial {BYTES}")


@pytest.mark.parametrize("host", [BYTES, "lab..example", "x" * 64])
def test_a_host_that_cannot_be_one_is_named(host: str) -> None:
    with pytest.raises(HapticdError, match=r"--listen .*:9876: is no name of a host; name another"):
        metrics(listen=f"{host}:9876")
