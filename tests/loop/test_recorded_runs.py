"""Whatever a loop tells, writes and leaves in a run is what it was before, with walls, clients and objects."""

from __future__ import annotations

import pytest

from tests.recorded.check import check
from tests.recorded.scripts import SCRIPTS


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_run_is_as_it_was_written_down(name: str) -> None:
    check(name)
