"""What the rig of faults says of a computer that was too busy to run the loop."""

from __future__ import annotations

import pytest

from tests.faults.rig import LATE, was_held_up


@pytest.mark.parametrize(
    ("late", "orders", "held_up"),
    [
        (0, [], False),
        (1, ["nan"], True),
        (1, ["slow 20"], True),  # 20 deadlines missed are not enough for it
        (1, ["slow 70"], False),
        (2, ["slow 70", "jump"], True),
    ],
)
def test_a_loop_that_was_late_more_often_than_it_was_told_to_be_was_held_up(
    late: int, orders: list[str], held_up: bool
) -> None:
    assert was_held_up(f"ERROR   51 {LATE}\nINFO    armed\n" * late, orders) == held_up
