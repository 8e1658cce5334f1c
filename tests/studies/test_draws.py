"""A device that was once reported by its seed and index can be replayed for good: what a seed draws never changes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any

import pytest

from hapticd_studies.draws import Draws, digits
from hapticd_studies.robustness.devices import draw as pressed
from hapticd_studies.space_robustness.cases import draw as in_space
from hapticd_studies.transparency.devices import draw as held
from hapticd_studies.transparency.devices import draw_out_of_sample

DRAWN = ("wall", "rate_hz", "surface", "objects", "hand", "index")
"""Of a case what no library has a part in, whose last digits may be others on another computer."""


@pytest.mark.parametrize(
    ("draw", "checksum"),
    [
        (pressed, "97f54e67c99ce74b"),
        (held, "c166bf7c353d8ff4"),
        (draw_out_of_sample, "d33a0453c88492eb"),
        (in_space, "0244a71cd9bc9a33"),
    ],
)
def test_what_a_seed_draws_is_what_it_always_drew(draw: Callable[[int, int], Any], checksum: str) -> None:
    cases = [draw(1, index) for index in range(22)]
    drawn = [repr([getattr(case, name) for name in DRAWN if hasattr(case, name)]) for case in cases]
    assert hashlib.sha256("".join(drawn).encode()).hexdigest()[:16] == checksum


def test_values_lie_in_their_range_and_have_four_digits() -> None:
    source = Draws("any")
    for _ in range(200):
        even, logarithmic = source.even(0.2, 0.3), source.logarithmic(1e-6, 1e-3)
        assert 0.2 <= even <= 0.3
        assert 1e-6 <= logarithmic <= 1e-3
        assert (even, logarithmic) == (digits(even), digits(logarithmic))
