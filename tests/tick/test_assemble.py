"""What a configuration makes of a device: its tick, or why not, and for a simulated one where the wall is."""

from __future__ import annotations

import pytest

from hapticd.config.loading import parse
from hapticd.errors import ConfigError
from hapticd.tick.assemble import make_tick, place_device
from tests.tick.rig import device

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


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[safety]\nmax_force_n = 500.0\n", "max_force_n"),
        ('[velocity]\nestimator = "device"\n', "velocity.estimator"),
        (WALL.format(0.0, "positive") + 'axis = "x"\n' + WALL.format(0.0, "positive") + 'axis = "y"\n', "walls[1]"),
    ],
)
def test_what_does_not_fit_the_device_is_told_with_the_file_that_says_it(text: str, problem: str) -> None:
    with pytest.raises(ConfigError) as raised:
        make_tick(parse(text, "lab.toml"), device())
    (said,) = raised.value.problems
    assert said.startswith("lab.toml: ")
    assert problem in said
