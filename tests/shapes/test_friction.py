"""Friction sticks and slips within a cone, and what it takes is counted."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticd.errors import ConfigError
from hapticd.shapes.solid import Placed, Proxy
from hapticd.shapes.surface import SURFACE_M
from tests.shapes.test_proxy import pulls, seeds, speeds
from tests.shapes.walks import ASKEW, HERE, HOLLOW, SOLIDS, Point, dot, go, norm, spring, stand, walk

DEPTH_M = 1e-3


def pressed(static: float, dynamic: float, tilted: bool = False) -> Proxy:
    """A plane, pressed 1 mm deep at its origin."""
    proxy = Proxy([Placed("plane", ASKEW if tilted else HERE)], static, dynamic)
    stand(proxy, on_plane(proxy, 0.0, 1e-3))
    go(proxy, on_plane(proxy, 0.0, -DEPTH_M))
    return proxy


def on_plane(proxy: Proxy, along: float, height: float) -> Point:
    return proxy.shapes[0].pose.point((0.6 * along, -0.8 * along, height))


@pytest.mark.parametrize("tilted", [False, True])
def test_it_sticks_up_to_the_static_cone_and_slips_back_to_the_dynamic_one(tilted: bool) -> None:
    proxy = pressed(0.5, 0.3, tilted)
    for at in range(1, 100):
        along = 1e-5 * at
        go(proxy, on_plane(proxy, along, -DEPTH_M))
        stretch = norm((proxy.stretch_x, proxy.stretch_y, proxy.stretch_z))
        assert proxy.depth_m == pytest.approx(DEPTH_M, abs=1e-15)
        if at <= 49:
            assert not proxy.sliding
            assert proxy.lost_m2 == 0.0
            assert stretch == pytest.approx(along, abs=1e-15)
        elif at > 50:
            assert proxy.sliding
            assert stretch == pytest.approx(0.3 * DEPTH_M, abs=1e-15)


def test_a_device_that_turns_round_sticks_again() -> None:
    proxy = pressed(0.5, 0.3)
    for at in range(100):
        go(proxy, on_plane(proxy, 1e-5 * at, -DEPTH_M))
    assert proxy.sliding
    go(proxy, on_plane(proxy, 98e-5, -DEPTH_M))
    assert not proxy.sliding
    where = proxy.sx, proxy.sy, proxy.sz
    for at in range(97, 20, -1):  # it lies at 0.69 mm, and holds 0.5 mm to the other side
        go(proxy, on_plane(proxy, 1e-5 * at, -DEPTH_M))
        assert (proxy.sx, proxy.sy, proxy.sz) == where
    go(proxy, on_plane(proxy, 18e-5, -DEPTH_M))
    assert proxy.sliding


def test_what_slipping_takes_is_the_work_against_it() -> None:
    """A steady slip: force mu k depth times way, to the energy that the first tick of slipping lets go."""
    proxy = pressed(0.3, 0.3)
    lost_m2 = 0.0
    for at in range(3001):
        go(proxy, on_plane(proxy, 1e-5 * at, -DEPTH_M))
        lost_m2 += proxy.lost_m2
    slipped_m = 0.03 - 0.3 * DEPTH_M
    assert lost_m2 == pytest.approx(0.3 * DEPTH_M * slipped_m + 0.5e-5 * slipped_m, rel=1e-6)


def test_a_coin_is_not_dragged_sideways_by_a_press_alone() -> None:
    proxy = pressed(0.5, 0.3)
    for at in range(200):
        go(proxy, (0.0, 0.0, -DEPTH_M - 1e-5 * at))
    assert spring(proxy)[:2] == (0.0, 0.0)


@pytest.mark.parametrize("name", SOLIDS)
@settings(max_examples=4, deadline=None)
@given(seed=seeds, speed=speeds, pull=pulls, static=st.floats(0.01, 1.5), share=st.floats(0.0, 1.0))
def test_made_energy_is_what_the_hold_made_less_what_friction_took(
    name: str, seed: int, speed: float, pull: float, static: float, share: float
) -> None:
    """U(n) - U(n-1) + F(n-1).dp = k/2 |dp|^2 - lost, to rounding: a rough proxy loses energy in no other way."""
    proxy = Proxy(SOLIDS[name], static, share * static)
    last: Point | None = None
    for now in walk(proxy, seed, 200, speed, pull):
        if last is not None and norm(last) > 0.0 and proxy.touching:
            made = 0.5 * (dot(now.spring, now.spring) - dot(last, last)) + dot(last, now.dp)
            assert made == pytest.approx(0.5 * dot(now.dp, now.dp) - proxy.lost_m2, abs=1e-15)
            assert proxy.lost_m2 >= 0.0
        last = now.spring


@pytest.mark.parametrize("name", ["plane", *HOLLOW])
@settings(max_examples=4, deadline=None)
@given(seed=seeds, speed=speeds, static=st.floats(0.01, 1.0))
def test_on_a_plane_and_in_a_room_the_proxy_is_in_the_cone(name: str, seed: int, speed: float, static: float) -> None:
    proxy = Proxy(SOLIDS[name], static, 0.8 * static)
    for _ in walk(proxy, seed, 200, speed, reach_m=0.015):
        stretch = norm((proxy.stretch_x, proxy.stretch_y, proxy.stretch_z))
        assert stretch <= 1.01 * static * proxy.depth_m + SURFACE_M
        if not proxy.touching:
            assert stretch == 0.0


@pytest.mark.parametrize(
    ("static", "dynamic"), [(0.3, 0.5), (-0.1, -0.2), (0.3, -0.1), (math.inf, 0.0), (math.nan, 0.0), (0.3, math.nan)]
)
def test_a_cone_that_is_none_is_refused(static: float, dynamic: float) -> None:
    with pytest.raises(ConfigError, match="static_friction = "):
        Proxy([Placed("plane", HERE)], static, dynamic)
