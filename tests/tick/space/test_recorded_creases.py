"""What a hand in a crease feels, and what the laws there are shown, is what it was when it was written down."""

from __future__ import annotations

import pytest

from tests.recorded.check import check
from tests.recorded.creases import VISITED


@pytest.mark.parametrize("name", VISITED)
def test_a_visit_to_a_crease_is_as_it_was_written_down(name: str) -> None:
    check(name)
