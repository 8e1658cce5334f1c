"""A device is held from the side from which it came, however late a tick is and whatever a reload does to an object."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from tests.tick.space.rig import INFO, Rig, ball_field, table

REAL = dataclasses.replace(INFO, simulated=False, workspace_m=((-0.2, 0.2),) * 3)
CUBE = table("cube", "box", 5000.0, size_m=(0.01, 0.01, 0.01))


def plate(**keys: object) -> str:
    return table("plate", "box", 1000.0, **{"size_m": (0.06, 0.06, 0.004), **keys})


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
