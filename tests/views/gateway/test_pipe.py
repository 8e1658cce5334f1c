"""`hapticd gateway haply | head -0`: what is printed goes nowhere. That is no fault of the port, and no place."""

from __future__ import annotations

import asyncio
import time
from types import SimpleNamespace
from typing import Any

import pytest

from hapticd.client import RefusedError
from hapticd_views.address import Address
from hapticd_views.gateway.cursor import Cursor
from hapticd_views.gateway.follower import ABSENT_S, Follower
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


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_where_no_one_follows_any_more_there_is_no_device() -> None:
    """Every second client's message was answered with the place of the last tick that there was."""
    ticks = iter([Cursor(1, (0.01, 0.0, 0.0), (0.0, 0.0, 0.0))])

    def newest(_timeout_s: float) -> Cursor:
        try:
            return next(ticks)
        except StopIteration:
            raise RefusedError("field belongs to another") from None

    def tell(_line: str) -> None:
        raise BrokenPipeError

    async def follow() -> None:
        device: Any = SimpleNamespace(next=newest)
        follower = Follower(device, tell)
        follower.start()
        follower.join()
        time.sleep(1.1 * ABSENT_S)
        assert await follower.newer(-1) is None

    asyncio.run(follow())
