"""Whatever a law does is what it did before: in a press in each of its modes, and on courses that make it learn."""

from __future__ import annotations

import pytest

from tests.recorded.check import check
from tests.recorded.courses import FOLLOWED
from tests.recorded.laws import PRESSES


@pytest.mark.parametrize("name", PRESSES)
def test_a_press_is_as_it_was_written_down(name: str) -> None:
    check(name)


@pytest.mark.parametrize("name", FOLLOWED)
def test_a_course_is_as_it_was_written_down(name: str) -> None:
    check(name)
