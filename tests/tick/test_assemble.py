"""A simulated device gets to know the wall that its hand goes to."""

from __future__ import annotations

import pytest

from hapticd.config.loading import parse
from hapticd.tick.assemble import place_device

WALL = '[[scene.walls]]\nstiffness_n_per_m = 1000.0\nposition_m = {}\nfree_side = "{}"\n'


class Placed:
    """A driver that keeps what it is given."""

    def __init__(self) -> None:
        self.told: list[tuple[float, int]] = []

    def place(self, position_m: float, side: int) -> None:
        self.told.append((position_m, side))


@pytest.mark.parametrize(("side", "sign"), [("positive", 1), ("negative", -1)])
def test_the_first_wall_counts_and_the_side_of_it_that_is_free(side: str, sign: int) -> None:
    driver = Placed()
    place_device(parse(WALL.format(0.003, side) + WALL.format(0.01, "positive"), "x"), driver)
    assert driver.told == [(0.003, sign)]


def test_without_a_wall_a_device_stays_where_it_is() -> None:
    driver = Placed()
    place_device(parse("", "x"), driver)
    assert driver.told == []
