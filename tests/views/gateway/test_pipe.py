"""`hapticd gateway haply | head -0`: what is printed goes nowhere, and that is not the port's fault."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from hapticd_views.address import Address
from hapticd_views.gateway.server import Gateway
from tests.ports import free_port


def test_a_closed_pipe_is_no_error_of_the_address() -> None:
    def ready() -> None:
        raise BrokenPipeError

    async def serve() -> None:
        device: Any = SimpleNamespace(next=lambda _timeout_s: None, let_go=lambda: None)
        address = Address("127.0.0.1", free_port())
        await Gateway(address, device, "default", may_push=False, origins=[], tell=print).run(ready)

    with pytest.raises(BrokenPipeError):
        asyncio.run(serve())
