"""Whatever a proxy gives on a walk is what it gave before, on every solid, smooth and rough, still and moved."""

from __future__ import annotations

import pytest

from tests.recorded.check import check
from tests.recorded.walks import WALKS


@pytest.mark.parametrize("name", WALKS)
def test_a_walk_is_as_it_was_written_down(name: str) -> None:
    check(name)
