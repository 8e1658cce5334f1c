"""The hand of the warm-up touches and leaves whatever is there, or what it warms and times has no contact."""

from __future__ import annotations

from itertools import pairwise

import pytest

from hapticd.config.loading import parse
from hapticd.loop.press import Press
from hapticd.paths import directory
from hapticd.tick.assemble import make_tick
from hapticd.tick.space.tick import SpaceTick
from tests.tick.remote.rig import device

SHAPES = {
    "plane": "",
    "sphere": "radius_m = 0.02",
    "box": "size_m = [0.05, 0.03, 0.04]",
    "capsule": "radius_m = 0.01\nlength_m = 0.03",
    "cylinder": "radius_m = 0.025\nlength_m = 0.06",
    "mesh": f'file = "{directory("config") / "ring.field"}"',
}
WHERE = "position_m = [0.03, -0.01, 0.02]\norientation = [0.6, -0.2, 0.7, 0.1]\nstiffness_n_per_m = 2000.0\n"
PRESSES = 5
PERIOD_TICKS = 40


def touched(tick: SpaceTick) -> list[bool]:
    """Whether the first object is touched, tick by tick."""
    press = Press(tick)
    seen = []
    for _ in range(PRESSES * PERIOD_TICKS):
        press.step()
        seen.append(tick.solids[0].in_contact)
    assert tick.fault == 0, tick.fault_text
    return seen


@pytest.mark.parametrize("inside", [False, True], ids=["outside", "inside"])
@pytest.mark.parametrize("shape", SHAPES)
def test_an_object_is_pressed_and_left_whatever_its_shape(shape: str, inside: bool) -> None:
    """A ring and a cup were never touched: their middle is free, and was taken for a point of the surface."""
    keys = f'name = "it"\nshape = "{shape}"\ninside = {str(inside).lower()}\n{SHAPES[shape]}\n'
    tick = make_tick(parse(f"[[scene.objects]]\n{keys}{WHERE}", "bench"), device("xyz"))
    assert isinstance(tick, SpaceTick)
    seen = touched(tick)
    assert sum(seen) == pytest.approx(len(seen) / 2, abs=2 * PRESSES)
    changes = sum(now != before for before, now in pairwise(seen))
    assert changes == pytest.approx(2 * PRESSES, abs=1)
