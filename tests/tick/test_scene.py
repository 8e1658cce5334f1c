"""Walls: planes on an axis, the force and the energy behind them."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.config.models import SceneConfig
from hapticd.config.walls import WallConfig
from hapticd.device import DeviceInfo
from hapticd.errors import ConfigError
from hapticd.tick.scene import Wall, compile_walls


def wall(stiffness_n_per_m: float = 1000.0, period_s: float = 1e-3, **keys: Any) -> Wall:
    config = WallConfig.model_validate({"stiffness_n_per_m": stiffness_n_per_m, **keys})
    return Wall(config, 0, period_s)


def device(*axes: str) -> DeviceInfo:
    span = ((-0.1, 0.1),) * len(axes)
    return DeviceInfo("a device", "", axes, 12.0, 1e-5, span, 1000.0, 5.0, None)


def test_a_wall_pushes_out_with_its_spring_and_resists_motion_with_its_damping() -> None:
    assert wall(1000.0).force(-0.002, 0.5) == 2.0
    assert wall(1000.0, damping_n_s_per_m=3.0).force(-0.002, 0.5) == 0.5
    assert wall(1000.0, damping_n_s_per_m=-3.0).force(-0.002, 0.5) == 3.5


def test_a_wall_without_damping_never_looks_at_the_velocity() -> None:
    assert wall(1000.0).force(-0.002, math.nan) == 2.0


def test_the_springs_part_of_the_force_is_known_apart() -> None:
    damped = wall(1000.0, damping_n_s_per_m=3.0)
    assert damped.spring_n == 0.0, "nothing has touched it: a reload puts it under a device between two samples"
    damped.force(-0.002, 0.5)
    assert damped.spring_n == 2.0


@given(x_m=st.floats(-0.1, 0.1), stiffness=st.floats(0.0, 1e5), limit_n=st.floats(1e-3, 100.0) | st.just(math.inf))
def test_stored_energy_is_the_work_of_pressing_slowly_against_the_limited_spring(
    x_m: float, stiffness: float, limit_n: float
) -> None:
    """The integral of min(k s, limit) from 0 to the depth, by pieces."""
    stored_j = wall(stiffness).stored_j(x_m, limit_n)
    depth_m = max(0.0, -x_m)
    knee_m = min(depth_m, limit_n / stiffness if stiffness else math.inf)
    beyond_j = limit_n * (depth_m - knee_m) if depth_m > knee_m else 0.0
    assert stored_j == pytest.approx(0.5 * stiffness * knee_m**2 + beyond_j, rel=1e-9, abs=1e-15)
    assert stored_j >= 0.0


def test_a_wall_without_stiffness_stores_nothing() -> None:
    assert wall(0.0).stored_j(-0.01, 0.0) == 0.0
    assert wall(0.0).force(-0.01, 1.0) == 0.0


@pytest.mark.parametrize("at_s", [0.0, 0.0005, 0.003, 0.0031])
def test_a_change_comes_at_the_first_tick_at_or_after_its_time(at_s: float) -> None:
    changing = wall(1000.0, changes=[{"at_s": at_s, "stiffness_n_per_m": 2000.0}])
    for count in range(6):
        changing.pass_time(1.0)
        assert changing.stiffness_n_per_m == (2000.0 if count * 1e-3 >= at_s - 1e-12 else 1000.0)
    assert not changing.changes_left


@pytest.mark.parametrize("rate_hz", [1000.0, 4000.0, 8000.0])
def test_a_change_on_a_tick_is_not_put_off_by_rounding(rate_hz: float) -> None:
    """1.00025 s at 4 kHz is 4001.0000000000005 periods of 250 us, as the loop counts them; it means the 4001st."""
    period_s = round(1e9 / rate_hz) * 1e-9
    for at_tick in (1, 7, 700, 4_001, 5_600, 1_000_003):
        changing = wall(1000.0, period_s, changes=[{"at_s": at_tick / rate_hz, "stiffness_n_per_m": 5.0}])
        changing._periods = at_tick - 2
        changing.pass_time(1.0)
        assert changing.changes_left
        changing.pass_time(1.0)
        assert not changing.changes_left


def test_changes_name_what_they_change_and_leave_the_rest() -> None:
    changing = wall(
        1000.0,
        damping_n_s_per_m=2.0,
        changes=[{"at_s": 0.001, "damping_n_s_per_m": -1.0}, {"at_s": 0.002, "stiffness_n_per_m": 0.0}],
    )
    seen = []
    for _ in range(4):
        changing.pass_time(1.0)
        seen.append((changing.stiffness_n_per_m, changing.damping_n_s_per_m))
    assert seen == [(1000.0, 2.0), (1000.0, -1.0), (0.0, -1.0), (0.0, -1.0)]


def test_walls_stand_on_the_axes_of_the_device() -> None:
    scene = SceneConfig.model_validate({"walls": [{"axis": axis, "stiffness_n_per_m": 1.0} for axis in "zxy"]})
    assert [each.axis for each in compile_walls(scene.walls, device("x", "y", "z"), 1e-3)] == [2, 0, 1]


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_single_axis_is_wherever_the_scene_puts_the_wall(axis: str) -> None:
    scene = SceneConfig.model_validate({"walls": [{"axis": axis, "stiffness_n_per_m": 1.0}] * 2})
    assert [each.axis for each in compile_walls(scene.walls, device("x"), 1e-3)] == [0, 0]


def test_a_second_axis_on_a_single_axis_device_is_refused_by_the_name_of_the_wall() -> None:
    scene = SceneConfig.model_validate({"walls": [{"axis": axis, "stiffness_n_per_m": 1.0} for axis in "zzx"]})
    with pytest.raises(ConfigError, match=r'scene\.walls\[2\]\.axis = "x": a device has a single axis.*"z"'):
        compile_walls(scene.walls, device("x"), 1e-3)


def test_an_axis_that_the_device_has_not_is_refused_by_the_name_of_the_wall() -> None:
    scene = SceneConfig.model_validate({"walls": [{"axis": axis, "stiffness_n_per_m": 1.0} for axis in "xz"]})
    with pytest.raises(ConfigError, match=r'scene\.walls\[1\]\.axis = "z": a device has only x, y'):
        compile_walls(scene.walls, device("x", "y"), 1e-3)


def test_walls_are_in_the_same_place_when_plane_and_free_side_are() -> None:
    here = wall(1000.0, position_m=0.01)
    assert here.same_place(wall(5.0, position_m=0.01, damping_n_s_per_m=2.0))
    assert not here.same_place(wall(1000.0, position_m=0.02))
    assert not here.same_place(wall(1000.0, position_m=0.01, free_side="negative"))


@pytest.mark.parametrize(("free_side", "outward"), [("positive", 1.0), ("negative", -1.0)])
def test_the_free_side_is_a_direction_of_length_one(free_side: str, outward: float) -> None:
    assert wall(free_side=free_side).outward == outward


def test_a_wall_tells_of_a_change_at_the_tick_that_brings_it() -> None:
    changing = wall(changes=[{"at_s": 0.002, "stiffness_n_per_m": 5.0}, {"at_s": 0.003, "damping_n_s_per_m": 1.0}])
    assert [changing.pass_time(1.0) for _ in range(6)] == [False, False, True, True, False, False]
    late = wall(changes=[{"at_s": 0.002, "stiffness_n_per_m": 5.0}, {"at_s": 0.003, "damping_n_s_per_m": 1.0}])
    assert [late.pass_time(1.5) for _ in range(4)] == [False, True, True, False]


def test_a_wall_that_is_let_go_has_neither_spring_nor_damper_nor_a_future() -> None:
    gone = wall(1000.0, damping_n_s_per_m=3.0, changes=[{"at_s": 1.0, "stiffness_n_per_m": 5.0}])
    gone.let_go()
    assert gone.force(-0.002, 0.5) == 0.0
    assert gone.stored_j(-0.002, 12.0) == 0.0
    assert not gone.changes_left
    gone.pass_time(2000.0)
    assert gone.force(-0.002, 0.5) == 0.0
