"""Whatever a law does in a press is what it did before, in each of its modes."""

from __future__ import annotations

import pytest

from tests.recorded.check import check
from tests.recorded.laws import PRESSES


@pytest.mark.parametrize("name", PRESSES)
def test_a_press_is_as_it_was_written_down(name: str) -> None:
    check(name)
