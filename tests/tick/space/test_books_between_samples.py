"""A device that is slower than the loop: an object's force may change between two samples, and the device moves on."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from hapticd.tick.space.tick import SpaceTick
from tests.tick.remote.rig import PERIOD_S, Metered, Rig
from tests.tick.space.rig import ball, table

ROUGH: dict[str, Any] = {"static_friction": 0.7, "dynamic_friction": 0.5}
WALL = '[[scene.walls]]\naxis = "z"\nposition_m = 0.031\nstiffness_n_per_m = 500.0\n'
SCENES = {
    "a ball": ball(stiffness=1000.0, damping_n_s_per_m=1.0),
    "a rough ball": ball(stiffness=1000.0, **ROUGH),
    "a floor and a wall": table("floor", "plane", 800.0, position_m=(0.0, 0.0, 0.03)) + WALL,
    "one that its client moves": ball(stiffness=1000.0, remote=True),
    "a rough one that its client moves": ball(stiffness=1000.0, remote=True, **ROUGH),
}
SOFTER = {"1000.0": "600.0", "800.0": "500.0"}


def softer(scene: str) -> str:
    for of, to in SOFTER.items():
        scene = scene.replace(of, to)
    return scene


def go_about(rig: Rig, gap: int, at_ms: dict[int, Callable[[], object]]) -> float:
    """A hand that wanders on it while this happens, with a sample each `gap` ticks; the impulse that it got [N s]."""
    given_n_s = 0.0
    for n in range(1, 1001):
        if n in at_ms:
            at_ms[n]()
        for port in rig.ports:
            if n % 9 == 0 and n < 900:
                rig.say(port.name, position_m=[0.0, 0.0, 1e-3 * math.sin(0.03 * n)], velocity_m_per_s=[0.0, 0.0, 0.0])
        given_n_s += rig.force[2] * PERIOD_S
        if n % gap:
            rig.repeat()
        else:
            rig.go([2e-3 * math.sin(0.02 * n), 1e-3, 0.0295 + 1e-3 * math.sin(0.013 * n)], dt_s=gap * PERIOD_S)
        if n % gap == 0:
            assert rig.unbalanced_j() < 1e-12, n
    return given_n_s


@pytest.mark.parametrize("gap", [1, 4, 10])
@pytest.mark.parametrize("law", ["none", "tdpa"])
@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_the_books_have_what_a_force_took_while_a_ramp_changed_it(scene: str, law: str, gap: int) -> None:
    rig = Rig(scene, law=law, axes="xyz", nominal_rate_hz=1000.0 / gap)
    smooth = scene.replace("0.7", "0.0").replace("0.5\n", "0.0\n")
    go_about(
        rig,
        gap,
        {
            203: rig.tick.release,
            274: rig.tick.arm,
            455: lambda: rig.switch(softer(scene)),
            603: lambda: rig.switch(smooth),
            777: rig.tick.release,
            850: rig.tick.arm,
            911: lambda: rig.switch(""),
        },
    )
    assert rig.tick.fault == 0
    assert abs(rig.energy_j) > 1e-4


@pytest.mark.parametrize("gap", [1, 4, 10])
@pytest.mark.parametrize("rough", [{}, ROUGH], ids=["smooth", "rough"])
def test_a_clients_impulse_is_that_of_each_force_for_as_long_as_it_was_held(rough: dict[str, Any], gap: int) -> None:
    rig = Rig(ball(stiffness=1000.0, remote=True, **rough), axes="xyz", nominal_rate_hz=1000.0 / gap)
    given_n_s = go_about(rig, gap, {203: rig.tick.release, 274: rig.tick.arm, 777: rig.tick.release})
    assert given_n_s > 0.1
    assert rig.ports[0].impulse_n_s[2] == pytest.approx(given_n_s, rel=1e-9)


@pytest.mark.parametrize("gap", [1, 10])
def test_a_law_is_shown_the_mean_of_what_was_applied(gap: int) -> None:
    rig = Rig(SCENES["a ball"], axes="xyz", nominal_rate_hz=1000.0 / gap)
    assert isinstance(rig.tick, SpaceTick)
    metered = Metered(rig.tick.solids[0].normal)
    rig.go([0.0, 0.0, 0.031])
    for n in range(1, 301):
        if n == 103:
            rig.tick.release()
        if n % gap:
            rig.repeat()
        else:
            rig.go([0.0, 0.0, 0.031 - 2e-5 * n], dt_s=gap * PERIOD_S)
    assert rig.energy_j > 1e-4
    assert metered.taken_j == pytest.approx(rig.energy_j, rel=1e-9)
