"""The proxy is the same to the last bit whether it is interpreted, as in the loop, or compiled, as in a study."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from numba import njit

from hapticd.shapes.proxy import follow
from hapticd.shapes.scalars import PART_KINDS, PROXY_KINDS
from hapticd.shapes.solid import Proxy
from hapticd.simulation.compiler.classes import Machine
from hapticd.simulation.compiler.compile import OPTIONS, record_dtype
from tests.shapes.walks import SOLIDS, walk


@cache
def compiled(function: Callable[..., Any]) -> Any:
    """One of the proxy's functions, which takes rows of records instead."""
    inner = Machine({}, {}).compiled(function)

    @njit(**OPTIONS)  # type: ignore[untyped-decorator]  # numba publishes no types
    def step(proxies: Any, others: Any, voxels: Any, x: Any, y: Any, z: Any) -> None:
        inner(proxies[0], others, voxels, x, y, z)

    return step


def records(proxy: Proxy) -> tuple[Any, Any]:
    """A proxy and the other shapes of its solid as records."""
    one = np.zeros(1, record_dtype(PROXY_KINDS))
    for name in PROXY_KINDS:
        one[0][name] = getattr(proxy, name)
    others = np.zeros(max(1, len(proxy.others)), record_dtype(PART_KINDS))
    for row, part in zip(others, proxy.others, strict=False):
        for name in PART_KINDS:
            row[name] = getattr(part, name)
    return one, others


def voxels_of(proxy: Proxy) -> Any:
    """Distances of its fields as numbers of 64 bits, which the loop reads them as."""
    return np.array(proxy.voxels or [0.0], float)


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("friction", [(0.0, 0.0), (0.6, 0.4)])
def test_compiled_and_interpreted_proxies_are_bitwise_equal(name: str, friction: tuple[float, float]) -> None:
    proxy = Proxy(SOLIDS[name], *friction)
    voxels = voxels_of(proxy)
    one, others = records(proxy)
    touched = 0
    for at, now in enumerate(walk(proxy, 7, 500, 0.5)):
        if at == 0:
            one, others = records(proxy)
            continue
        compiled(follow)(one, others, voxels, *now.p)
        touched += proxy.touching
        for field in PROXY_KINDS:
            assert one[0][field] == getattr(proxy, field), (at, field)
    assert touched > 10
