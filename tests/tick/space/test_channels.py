"""What the law of each direction of an object is shown, holds and forgets."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd import plugins
from hapticd.law import LawSnapshot
from hapticd.tick.contact import RunningLaw
from hapticd.tick.energy import EnergyLedger
from hapticd.tick.space.channel import Channel, lay_along, slip_along
from hapticd_controllers import none
from tests.tick.rig import law, running
from tests.tick.space.rig import PERIOD_S, Point, Rig, apart, ball, length, table

ROUGH: dict[str, Any] = {"static_friction": 0.8, "dynamic_friction": 0.6}
ABOVE: Point = (0.0, 0.0, 0.031)


def pressed(scene: str, name: str = "none") -> Rig:
    return Rig(scene, name).start(ABOVE).to((0.0, 0.0, 0.0292), 60)


def test_a_device_that_says_the_same_once_more_is_pushed_as_before() -> None:
    """Walls and objects alike hold their force; nothing is entered into the books until it has news."""
    wall = '[[scene.walls]]\naxis = "x"\nposition_m = 0.001\nstiffness_n_per_m = 1000.0\n'
    rig = pressed(wall + ball(**ROUGH))
    force, energy_j = rig.force, rig.totals.ledger.energy_j
    assert force[0] > 0.5
    assert force[2] > 3.0
    assert rig.unbalanced_j() < 1e-12
    for _ in range(5):
        rig.tick.advance(rig.sample, PERIOD_S)
        assert tuple(rig.tick.force_n) == force
    assert rig.totals.ledger.energy_j == energy_j
    rig.go((0.0, 0.0, 0.0291))
    assert rig.force[2] == pytest.approx(4.5, rel=1e-3)


def test_the_forces_of_all_directions_add_up_to_the_spring_between_device_and_proxy() -> None:
    """Also where the device sticks on a curved surface, on which the way to the proxy is not along the normal."""
    rig = pressed(ball(**ROUGH)).to((0.002, 0.001, 0.0291), 20)
    proxy = rig.tick.solids[0].solid.proxy
    normal = (proxy.normal_x, proxy.normal_y, proxy.normal_z)
    stretch = (proxy.stretch_x, proxy.stretch_y, proxy.stretch_z)
    assert apart(stretch, (0.0, 0.0, 0.0)) > 1e-4
    spring = [5000.0 * (proxy.depth_m * n + s) for n, s in zip(normal, stretch, strict=True)]
    assert apart(rig.force, spring) < 1e-9
    assert apart(rig.force, (0.0, 0.0, 0.0)) > 3.0
    assert rig.tick.requested_n == pytest.approx(rig.force)
    assert rig.totals.friction_stored_j == pytest.approx(0.5 * 5000.0 * length(stretch) ** 2, rel=1e-9)


def test_a_device_that_went_round_an_object_out_of_its_reach_is_pushed_out_on_the_other_side() -> None:
    rig = pressed(ball()).to(ABOVE, 20)
    rig.go((0.0, 0.0, 0.3), (0.3, 0.0, 0.0), (0.0, 0.0, -0.3), (0.0, 0.0, -0.0305))
    rig.to((0.0, 0.0, -0.0295), 20)
    assert rig.force == pytest.approx((0.0, 0.0, -2.5), abs=1e-6)


def test_a_law_that_takes_over_on_an_object_knows_how_fast_the_device_is() -> None:
    rig = pressed(ball()).to((0.0, 0.0, 0.0290), 4)  # 50 mm/s inwards
    assert rig.tick.solids[0].normal.snapshot().velocity_m_per_s == pytest.approx(-0.05, rel=1e-6)


CHANNELS = [Channel(RunningLaw(none, none.Params()), 0.0, EnergyLedger()) for _ in range(3)]


@given(st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda n: length(n) > 0.1))
def test_the_three_directions_of_a_rough_surface_stand_across_each_other(normal: Point) -> None:
    CHANNELS[0].dx, CHANNELS[0].dy, CHANNELS[0].dz = (value / length(normal) for value in normal)
    lay_along(CHANNELS)
    along = [(channel.dx, channel.dy, channel.dz) for channel in CHANNELS]
    for number, one in enumerate(along):
        for other_number, other in enumerate(along):
            across = sum(a * b for a, b in zip(one, other, strict=True))
            assert across == pytest.approx(float(number == other_number), abs=1e-12)


def turned(by_deg: float) -> list[Point]:
    """The directions after the normal has turned towards the first one."""
    normal, first, _ = CHANNELS
    cos, sin = math.cos(math.radians(by_deg)), math.sin(math.radians(by_deg))
    first.dx, first.dy, first.dz = 0.48, 0.6, 0.64
    normal.dx, normal.dy, normal.dz = 0.8 * cos + 0.48 * sin, 0.6 * sin, 0.64 * sin - 0.6 * cos
    still = (0.0, 0.0, 0.0)
    slip_along(CHANNELS, 0, 0.0, still, 0.0, still, still, PERIOD_S)
    return [(channel.dx, channel.dy, channel.dz) for channel in CHANNELS]


@pytest.mark.parametrize(("by_deg", "sign"), [(10.0, 1.0), (55.0, 1.0), (125.0, -1.0)])
def test_where_a_surface_turns_the_first_direction_stays_as_near_as_it_can(by_deg: float, sign: float) -> None:
    (a, b, c), (d, e, f), across = turned(by_deg)
    cos, sin = math.cos(math.radians(by_deg)), math.sin(math.radians(by_deg))
    nearest = (0.48 * cos - 0.8 * sin, 0.6 * cos, 0.64 * cos + 0.6 * sin)
    assert (d, e, f) == pytest.approx([sign * each for each in nearest])
    assert across == pytest.approx((b * f - c * e, c * d - a * f, a * e - b * d))


@pytest.mark.parametrize("by_deg", [65.0, 89.0])
def test_where_the_first_direction_nearly_becomes_the_normal_both_are_laid_anew(by_deg: float) -> None:
    after = turned(by_deg)
    lay_along(CHANNELS)
    assert after == [(channel.dx, channel.dy, channel.dz) for channel in CHANNELS]


def test_a_straight_press_has_the_same_books_on_a_rough_surface_and_on_a_smooth_one() -> None:
    """Pressed, let out half, pressed beyond the limit: what is stored, made and taken, each for itself."""
    books = []
    for keys in ({}, ROUGH):
        rig = Rig(table("table", "plane", **keys), "none").start((0.0, 0.0, 0.001))
        for z_m in (-0.001, -0.0005, -0.003):
            rig.to((0.0, 0.0, z_m), 30)
        ledger = rig.totals.ledger
        books.append((ledger.stored_j, ledger.generated_j, ledger.dissipated_j))
    assert books[0] == pytest.approx(books[1], rel=1e-9, abs=1e-12)
    assert books[0][0] == pytest.approx(12.0 * (0.003 - 0.5 * 12.0 / 5000.0))  # flat from 12 N on
    assert books[0][1] > 1e-4


def test_a_law_is_shown_what_of_its_force_and_of_the_contacts_was_applied() -> None:
    shown: list[tuple[float, float, float]] = []

    def step(_state: Any, _params: Any, tick: Any) -> float:
        shown.append((tick.contact_n, tick.applied_n, tick.applied_contact_n))
        return float(tick.contact_n) + 0.25

    rig = Rig(ball(), "none").start(ABOVE)
    for _ in rig.tick.switch(make_law=running(law(step))):
        pass
    rig.to((0.0, 0.0, 0.0292), 60)
    shown.clear()
    rig.go((0.0, 0.0, 0.0291), (0.0, 0.0, 0.029))
    (first_n, *_), (_, applied_n, applied_contact_n) = shown
    assert first_n == pytest.approx(4.5)
    assert (applied_n, applied_contact_n) == pytest.approx((4.75, 4.5))


def test_an_object_that_changed_goes_on_from_nothing_since_its_shade_holds_its_force() -> None:
    rig = pressed(ball(**ROUGH)).to((0.001, 0.0005, 0.0291), 20)
    assert any(channel.held_n for channel in rig.tick.solids[0].channels)
    rig.switch(ball(stiffness=4000.0, **ROUGH))
    for channel in rig.tick.solids[0].channels:
        assert (channel.applied_n, channel.held_n, channel.way_m) == (0.0, 0.0, 0.0)
        assert (channel.tick.applied_n, channel.tick.applied_contact_n) == (0.0, 0.0)
    assert [channel.snapshot().x_m for channel in rig.tick.solids[0].channels[1:]] == [0.0, 0.0]


def test_a_law_that_keeps_time_is_asked_for_half_a_second_after_the_touch_and_no_longer() -> None:
    asked = 0

    def step(_state: Any, _params: Any, tick: Any) -> float:
        nonlocal asked
        asked += 1
        return float(tick.contact_n)

    rig = Rig(ball(), "none").start(ABOVE)
    for _ in rig.tick.switch(make_law=running(law(step))):
        pass
    rig.to((0.0, 0.0, 0.0292), 60).to((0.0, 0.0, 0.0301), 10)
    asked = 0
    for count in range(1000):
        rig.go((0.0, 0.0, 0.0301 + 1e-6 * (count % 2)))
    assert asked == pytest.approx(500, abs=5)


def test_a_start_beside_an_object_is_as_far_from_it_as_the_device_is() -> None:
    at = (0.012, 0.005, 0.034)
    rig = Rig(ball(position_m=(0.01, 0.0, 0.0))).start(at)
    free_m = pytest.approx(apart(at, (0.01, 0.0, 0.0)) - 0.03, abs=1e-9)
    assert rig.tick.solids[0].solid.proxy.d == free_m
    rig.go((0.3, -0.2, 0.4), (0.3, -0.2, 0.4), at)  # and once more where it comes back from afar
    assert rig.tick.solids[0].solid.proxy.d == free_m


def test_a_law_sees_a_surface_as_a_wall_below_nothing_by_the_depth_and_pushing_out() -> None:
    shown: list[tuple[float, float, float, float]] = []

    def step(_state: Any, _params: Any, tick: Any) -> float:
        if tick.in_contact:
            shown.append((tick.x_m, tick.moved_m, tick.velocity_m_per_s, tick.spring_n))
        return float(tick.contact_n)

    rig = Rig(ball(), "none").start(ABOVE)
    for _ in rig.tick.switch(make_law=running(law(step))):
        pass
    rig.to((0.0, 0.0, 0.0301), 60).to((0.0, 0.0, 0.029), 11)
    x_m, moved_m, speed_m_per_s, spring_n = shown[-1]
    assert x_m == pytest.approx(-1e-3)
    assert moved_m == pytest.approx(-1e-4)
    assert speed_m_per_s < -0.05
    assert spring_n == pytest.approx(5.0)


def test_laws_of_what_comes_begin_at_rest_where_the_device_is(monkeypatch: pytest.MonkeyPatch) -> None:
    tdpa = plugins.law("tdpa")
    before, started = tdpa.start, []

    def start(state: Any, params: Any, snapshot: LawSnapshot) -> None:
        started.append((snapshot.x_m, snapshot.velocity_m_per_s, snapshot.applied_n))
        before(state, params, snapshot)

    rig = pressed(ball(), "tdpa")
    monkeypatch.setattr(tdpa, "start", start)
    rig.switch(ball(**ROUGH))
    assert started == [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    started.clear()
    rig.switch(ball(**ROUGH) + ball("new", position_m=(0.0, 0.001, 0.0), stiffness=100.0))
    inside_m = 0.03 - length((0.0, 0.001, 0.0292))
    (comes,) = started  # one that comes about the device
    assert comes == pytest.approx((-inside_m, 0.0, 0.0))


def test_an_object_is_looked_at_from_as_far_as_a_device_of_five_metres_a_second_comes_in_a_tick() -> None:
    rig = Rig(ball()).start((0.0, 0.0, 0.3)).go((0.0, 0.0, 0.0351))
    assert rig.tick.awake == []
    rig.go((0.0, 0.0, 0.0349))
    (contact,) = rig.tick.awake
    rig.go((0.0, 0.0, 0.0348), (0.0, 0.0, 0.0351))
    assert contact.solid.proxy.d == pytest.approx(0.0048)


@pytest.mark.parametrize(("before", "after"), [("energy-cycle", "none"), ("none", "energy-cycle")])
def test_what_a_law_has_learnt_is_for_one_that_learns_it_too(before: str, after: str) -> None:
    rig = pressed(ball(**ROUGH), before)
    for channel in rig.tick.solids[0].channels:
        channel.damping_n_s_per_m = 300.0
    rig.switch(ball(**ROUGH), law=after)
    assert [channel.damping_n_s_per_m for channel in rig.tick.solids[0].channels] == [0.0, 0.0, 0.0]
    other = pressed(ball(**ROUGH), "energy-cycle")
    other.tick.solids[0].normal.damping_n_s_per_m = 300.0
    assert other.switch(ball(**ROUGH), law="energy-cycle").tick.solids[0].normal.damping_n_s_per_m == 300.0


def test_a_law_that_takes_over_is_shown_what_of_the_contact_was_applied_last() -> None:
    rig = pressed(ball(**ROUGH)).to((0.0005, 0.0003, 0.0291), 20)
    before = [channel.tick.applied_contact_n for channel in rig.tick.solids[0].channels]
    assert min(abs(newton) for newton in before) > 0.5
    rig.switch(ball(**ROUGH), law="damper")
    assert [channel.tick.applied_contact_n for channel in rig.tick.solids[0].channels] == before
    velocity = [channel.velocity_m_per_s for channel in rig.tick.solids[0].channels]
    assert [channel.tick.velocity_m_per_s for channel in rig.tick.solids[0].channels] == velocity
    assert max(velocity) > 0.01


@pytest.mark.parametrize("keys", [{}, ROUGH], ids=["smooth", "rough"])
def test_a_pressed_device_that_was_armed_while_blind_comes_in_by_a_ramp(keys: dict[str, Any]) -> None:
    """As on a wall: the arming falls between the last bad sample and the first good one."""
    rig = pressed(ball(**keys))
    rig.go(*[(math.nan, 0.0, 0.0292)] * 20)
    rig.tick.guard.clear()
    assert rig.tick.arm()
    rig.go(*[(0.0, 0.0, 0.0292)] * 51)
    assert [z for _, _, z in rig.forces[-51:]] == pytest.approx([4.0 * n / 50 for n in range(51)])
