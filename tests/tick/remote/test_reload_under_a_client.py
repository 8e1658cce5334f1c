"""What a client has said stays in force through a reload of something else."""

from __future__ import annotations

from typing import Any

import pytest

from tests.tick.remote.rig import COUPLING, Rig


def ball(**keys: Any) -> str:
    table = {"radius_m": 0.03, "stiffness_n_per_m": 5000.0, "max_speed_m_per_s": 1.0, "static_friction": 0.3, **keys}
    lines = "".join(f"{key} = {value}\n" for key, value in table.items())
    return f'[[scene.objects]]\nname = "it"\nshape = "sphere"\nremote = true\n{lines}'


def held(rig: Rig, name: str, ticks: int, every: int, **said: Any) -> list[float]:
    """Largest part of the force in each tick, with a client that speaks every so often."""
    forces_n = []
    for tick in range(ticks):
        if tick % every == every - 1:
            rig.say(name, **said)
        forces_n.append(max(map(abs, rig.go())))
    return forces_n


@pytest.mark.parametrize("every", [4, 16, 50])
@pytest.mark.parametrize(
    ("name", "before", "after", "at"),
    [
        ("it", ball(), ball(max_speed_m_per_s=0.9), [0.0, 0.0, 0.020]),
        ("it", ball(), ball(stiffness_n_per_m=6000.0), [0.0, 0.0, 0.020]),
        ("tool", COUPLING + "hold_s = 0.1\n", COUPLING + "hold_s = 0.11\n", [0.0, 0.0, 0.010]),
    ],
    ids=["speed of an object", "stiffness of an object", "hold_s of a coupling"],
)
def test_a_spring_that_a_client_has_softened_stays_soft(
    name: str, before: str, after: str, at: list[float], every: int
) -> None:
    """It rose to the file's until the client's next word: 12 N for 1."""
    rig = Rig(before, axes="xyz", arm=False)
    rig.at = [0.0, 0.0, 0.035] if name == "it" else [0.0, 0.0, 0.0]
    rig.sample.position_m[:] = rig.at
    rig.tick.start(rig.sample)
    assert rig.tick.arm()
    said: dict[str, Any] = {"position_m": [0.0, 0.0, 0.0], "stiffness_n_per_m": 100.0, "damping_n_s_per_m": 0.0}
    rig.say(name, **said)
    start = list(rig.at)
    for step in range(1, 301):
        rig.go([of + (to - of) * step / 300 for of, to in zip(start, at, strict=True)])
        if step % every == 0:
            rig.say(name, **said)
    assert held(rig, name, 200, every, **said)[-1] == pytest.approx(1.0, rel=1e-3)
    rig.switch(after)
    assert max(held(rig, name, 300, every, **said)) == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize("after", [ball(static_friction=0.31), ball(radius_m=0.0301)], ids=["friction", "size"])
def test_an_object_stays_where_its_client_has_it(after: str) -> None:
    """It went back to the place in the file, where a hand may be by then."""
    rig = Rig(ball(), axes="xyz", arm=False)
    rig.at = [0.0, 0.0, 0.1]
    rig.sample.position_m[:] = rig.at
    rig.tick.start(rig.sample)
    assert rig.tick.arm()
    held(rig, "it", 300, 4, position_m=[0.0, 0.0, -0.1])
    for step in range(1, 301):
        rig.go([0.02 * step / 300, 0.0, 0.1 - 0.1 * step / 300])
        rig.say("it", position_m=[0.0, 0.0, -0.1])
    assert rig["it"].target_m[2] == pytest.approx(-0.1)
    rig.switch(after)
    assert max(held(rig, "it", 90, 91)) == 0.0
    assert rig["it"].target_m[2] == pytest.approx(-0.1)
    rig.switch(after.replace("radius_m", "position_m = [0.0, 0.0, 0.3]\nradius_m"))
    rig.go(ticks=5)
    assert rig["it"].target_m[2] == pytest.approx(0.3), "a place that the file says anew counts"
