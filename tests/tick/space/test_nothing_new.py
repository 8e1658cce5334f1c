"""A reload that says the same of an object, or something else of another one, is not felt on it."""

from __future__ import annotations

import pytest

from tests.tick.space.course import Moment, of_objects
from tests.tick.space.rig import Rig, ball
from tests.tick.space.test_standing_anew import SCENES, swings, swung

FAR = ball("far", 4000.0, position_m=(0.4, 0.0, 0.0))
CHANGED = {
    "the same": "{scene}" + FAR,
    "without the far one": "{scene}",
    "the far one moved": "{scene}" + FAR.replace("0.4", "0.5"),
    "another far one first": ball("new", 3000.0, position_m=(0.0, 0.7, 0.0)) + "{scene}" + FAR.replace("4000", "5000"),
}


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("notch", "the same"),
        ("rough room", "the same"),
        ("notch", "another far one first"),
        ("rough room", "without the far one"),
        ("notch", "the far one moved"),
    ],
)
def test_what_did_not_change_is_as_it_was(name: str, change: str) -> None:
    runs: list[list[Moment]] = []
    for after in ("", CHANGED[change]):
        rig = swung(Rig(SCENES[name] + FAR, "energy-cycle"))
        if after:
            rig.switch(after.replace("{scene}", SCENES[name]))
        runs.append([])
        (here,) = [solid for solid in rig.tick.solids if solid.in_contact]
        for at in swings(60):
            rig.go(at)
            far = [solid for solid in rig.tick.solids if solid is not here]
            rig.tick.solids = [here]
            runs[-1].append(of_objects(rig))
            rig.tick.solids = [here, *far]
    without, after_it = runs
    assert after_it == without
    assert all(any(moment[:3]) for moment in without)
