"""A device is held from the side from which it came, however late a tick is and whatever a reload does to an object."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from tests.tick.space.rig import INFO, Rig, ball_field, table

REAL = dataclasses.replace(INFO, simulated=False, workspace_m=((-0.2, 0.2),) * 3)
CUBE = table("cube", "box", 5000.0, size_m=(0.01, 0.01, 0.01))


def plate(**keys: object) -> str:
    return named("plate", **keys)


def named(name: str, **keys: object) -> str:
    return table(name, "box", 1000.0, **{"size_m": (0.06, 0.06, 0.004), **keys})


@pytest.mark.parametrize("far", [False, True], ids=["awake before", "out of reach before"])
@pytest.mark.parametrize(("speed_m_per_s", "late_ms"), [(0.7, 22), (1.5, 10)])
def test_a_late_tick_does_not_bring_a_hand_through_a_small_object(
    speed_m_per_s: float, late_ms: int, far: bool
) -> None:
    """It was taken for one that had come from below, and pushed on with 12 N."""
    rig = Rig(CUBE, "none", info=REAL)
    step_m = speed_m_per_s * late_ms * 1e-3
    above_m = -0.0015 + step_m
    rig.start((0.0, 0.0, 0.15 if far else above_m + 0.001)).to((0.0, 0.0, above_m), 200)
    rig.sample.position_m[2] = above_m - step_m
    rig.sample.time_ns += late_ms * 1_000_000
    rig.sample.sequence += 1
    assert rig.tick.advance(rig.sample, late_ms * 1e-3)[2] == 12.0
    rig.to((0.0, 0.0, -0.004), 5)
    assert all(force_n[2] == 12.0 for force_n in rig.forces[-5:])


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (plate(), plate(static_friction=0.3, dynamic_friction=0.2)),
        (plate(static_friction=0.3, dynamic_friction=0.2), plate(static_friction=0.31, dynamic_friction=0.2)),
        (plate(), plate(size_m=(0.061, 0.06, 0.004))),
        (plate(), plate(size_m=(0.06, 0.06, 0.0045))),
        (plate(), plate(rounding_m=1e-4)),
        (plate(), plate() + table("rib", "box", 1000.0, size_m=(0.01, 0.01, 0.01), position_m=(0.03, 0.0, 0.0))),
    ],
    ids=["friction", "more friction", "wider", "thicker", "rounded", "joined"],
)
def test_a_reload_leaves_a_held_device_on_its_side_of_a_thin_object(before: str, after: str) -> None:
    """It is 3 mm deep in 4 mm: by the nearest surface, it was pulled through."""
    rig = Rig(before, "none").start((0.0, 0.0, 0.01)).to((0.0, 0.0, -0.001), 200)
    assert rig.force[2] == pytest.approx(3.0)
    rig.switch(after).to((0.0, 0.0, -0.001), 200)
    assert rig.force[2] == pytest.approx(3.0, abs=0.3)
    assert min(force_n[2] for force_n in rig.forces[-200:]) > 1.0


RIB = table("rib", "box", 1000.0, size_m=(0.01, 0.01, 0.01), position_m=(0.03, 0.0, 0.0))


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (plate(), RIB + plate()),
        (RIB + plate(), plate()),
        (RIB + plate(), RIB.replace("1000.0", "900.0") + plate()),
        (plate(), plate(remote=True)),
        (plate(remote=True), plate()),
        (plate(), plate().replace('"plate"', '"panel"')),
        (table("other", "sphere", 1000.0, radius_m=0.05, position_m=(0.0, 0.0, -0.048)), plate()),
    ],
    ids=["joined in front", "joined no more", "no part any more", "a client's", "no client's", "renamed", "another"],
)
def test_a_reload_that_has_another_solid_hold_a_device_leaves_it_on_its_side(before: str, after: str) -> None:
    """Whatever its name is: 3 N became -1 N, for good."""
    rig = Rig(before, "none").start((0.0, 0.0, 0.01)).to((0.0, 0.0, -0.001), 200)
    assert rig.force[2] == pytest.approx(3.0)
    rig.switch(after).to((0.0, 0.0, -0.001), 200)
    assert rig.force[2] == pytest.approx(3.0, abs=0.3)
    assert min(force_n[2] for force_n in rig.forces[-200:]) > 1.0


AWAY: dict[str, Any] = {"position_m": (0.0, 0.0, -0.1)}
SIDE = table("side", "box", 1000.0, size_m=(0.01, 0.01, 0.01), position_m=(0.08, 0.0, 0.0))


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (SIDE + plate(), SIDE.replace("0.08", "0.03") + plate()),
        (SIDE + plate(), SIDE.replace("[0.01", "[0.12") + plate()),
        (RIB.replace("1000.0", "900.0") + plate(), RIB + plate()),
        (named("a") + named("b", **AWAY), named("a", **AWAY) + named("b")),
        (named("a", **AWAY) + named("b"), named("a") + named("b", **AWAY)),
        (named("a", **AWAY) + named("b"), named("a")),
        (named("a", **AWAY) + named("b"), named("a", rounding_m=1e-4)),
        (named("a", **AWAY) + named("b"), named("a", orientation=(1.0, 0.0, 0.0, 1.0))),
        (named("a", **AWAY, remote=True) + named("b"), named("a", remote=True)),
        (named("a", **AWAY, remote=True) + named("b", remote=True), named("a", remote=True)),
        (RIB + plate() + SIDE.replace("1000.0", "900.0"), RIB + plate() + SIDE.replace("0.08", "0.03")),
        (SIDE.replace("1000.0", "900.0") + RIB + plate(), SIDE.replace("0.08", "-0.03") + RIB + plate()),
        (plate(), plate(orientation=(0.0, 1.0, 0.0, 0.0))),
        (plate(remote=True), plate(remote=True, orientation=(0.0, 1.0, 0.0, 0.0))),
    ],
    ids=[
        *("moved to it", "grown to it", "alike at last", "changed places", "changed places back", "in its place"),
        *("with another shape", "turned", "a client's", "both a client's", "joined a union", "took a union"),
        *("turned over", "turned over by a client's file"),
    ],
)
def test_an_object_that_was_free_takes_a_held_device_over_on_its_side(before: str, after: str) -> None:
    """Only for one that was new, others were asked who hold it: 3 N became -1 N, for good."""
    rig = Rig(before, "none", info=REAL).start((0.0, 0.0, 0.01)).to((0.0, 0.0, -0.001), 200)
    assert rig.force[2] == pytest.approx(3.0)
    rig.switch(after).to((0.0, 0.0, -0.001), 200)
    assert rig.force[2] == pytest.approx(3.0, abs=0.3)
    assert min(force_n[2] for force_n in rig.forces[-200:]) > 1.0
    assert rig.unbalanced_j() < 1e-15


@pytest.mark.parametrize("after", [RIB + plate(), plate(size_m=(0.08, 0.06, 0.004)).replace("plate", "panel")])
def test_of_two_that_hold_a_device_the_one_that_pushes_most_says_on_which_side(after: str) -> None:
    """The side of the other, 0.1 mm deep, is within the one that comes: it was taken to have none."""
    rig = Rig(RIB.replace("1000.0", "900.0") + plate(), "none", info=REAL).start((0.02, 0.0, 0.01))
    rig.to((0.02, 0.0, -0.001), 200).to((0.0251, 0.0, -0.001), 100)
    assert rig.force == pytest.approx((-0.09, 0.0, 3.0))
    rig.switch(after).to((0.0251, 0.0, -0.001), 200)
    assert rig.force[2] >= 3.0 - 1e-9
    assert min(force_n[2] for force_n in rig.forces[-200:]) > 1.0


@pytest.mark.parametrize("listed", [1, -1], ids=["first", "last"])
@pytest.mark.parametrize("after", [plate(size_m=(0.06, 0.06, 0.0041)), RIB.replace("0.03", "-0.03") + plate()])
def test_an_object_tells_the_side_of_its_own_sooner_than_one_that_pushes_more(after: str, listed: int) -> None:
    """That one pushes it to the edge of the plate with 6 N, and would have it come in from there."""
    post = table("post", "box", 5000.0, size_m=(0.02, 0.02, 0.02), position_m=(0.0162, 0.0, 0.0))
    rig = Rig("".join((post, plate())[::listed]), "none", info=REAL).start((0.028, 0.0, 0.01))
    rig.to((0.028, 0.0, -0.001), 200).to((0.025, 0.0, -0.001), 100)
    assert rig.force == pytest.approx((6.0, 0.0, 3.0))
    rig.switch("".join((post, after)[::listed])).to((0.025, 0.0, -0.001), 200)
    assert rig.force == pytest.approx((6.0, 0.0, 3.0), abs=0.1)


FAR = table("far", "sphere", 1000.0, radius_m=0.01, position_m=(0.1, 0.1, 0.1))


@pytest.mark.parametrize(
    ("before", "then", "ms", "after"),
    [
        (plate(), "", 5, plate()),
        (plate() + FAR, FAR, 45, plate() + FAR),
        (plate() + FAR, FAR, 5, FAR.replace("far", "plate") + named("panel")),
        (plate(remote=True) + FAR, FAR, 5, plate(remote=True) + FAR),
        (plate(), plate(**AWAY), 45, plate()),
        (plate(), plate(size_m=(0.06, 0.06, 0.05)), 5, plate()),
    ],
    ids=["the only one", "later", "under another name", "a client's", "moved away", "thicker"],
)
def test_a_reload_that_is_undone_while_its_ramp_goes_on_leaves_a_device_on_its_side(
    before: str, then: str, ms: int, after: str
) -> None:
    """With 2.8 N of it still applied, it was taken for one that nothing holds, and pulled through."""
    rig = Rig(before, "none", info=REAL).start((0.0, 0.0, 0.01)).to((0.0, 0.0, -0.001), 200)
    rig.switch(then).to((0.0, 0.0, -0.001), ms)
    rig.switch(after).to((0.0, 0.0, -0.001), 200)
    assert rig.force[2] == pytest.approx(3.0)


def test_a_device_of_which_nothing_is_held_any_more_is_free_where_an_object_comes_back() -> None:
    rig = Rig(plate() + FAR, "none", info=REAL).start((0.0, 0.0, 0.01)).to((0.0, 0.0, -0.001), 200)
    rig.switch(FAR).to((0.0, 0.0, -0.001), 60)
    assert rig.force == (0.0, 0.0, 0.0)
    rig.switch(plate() + FAR).to((0.0, 0.0, -0.001), 200)
    assert rig.force[2] == pytest.approx(-1.0)


def test_a_reload_under_a_device_that_is_deep_in_a_new_shape_still_finds_a_surface() -> None:
    """Where the surface was is far within it: it leaves by the nearest."""
    rig = Rig(plate(), "none").start((0.0, 0.0, 0.01)).to((0.0, 0.0, -0.001), 200)
    rig.switch(plate(size_m=(0.06, 0.06, 0.05))).to((0.0, 0.0, -0.001), 200)
    assert rig.force[2] == pytest.approx(-12.0)


@pytest.mark.parametrize("stiffness_n_per_m", [5000.0, 6000.0], ids=["nothing else", "stiffness as well"])
def test_a_mesh_that_was_made_anew_under_its_name_is_taken_over(tmp_path: Path, stiffness_n_per_m: float) -> None:
    """The hand went on feeling a shape that no file had."""
    file = tmp_path / "it.field"
    file.write_bytes(ball_field(0.03, 0.002).pack())
    rig = Rig(table("it", "mesh", 5000.0, file=str(file)), "none").start((0.0, 0.0, 0.05)).to((0.0, 0.0, 0.029), 100)
    assert rig.force[2] == pytest.approx(5.0, rel=0.05)
    file.write_bytes(ball_field(0.02, 0.002).pack())
    rig.switch(table("it", "mesh", stiffness_n_per_m, file=str(file))).to((0.0, 0.0, 0.029), 100)
    assert rig.force == (0.0, 0.0, 0.0)
    rig.to((0.0, 0.0, 0.019), 100)
    assert rig.force[2] == pytest.approx(1e-3 * stiffness_n_per_m, rel=0.05)
