"""An orientation has length 1 whatever a client says, and one that has no length says nothing."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.shapes.pose import Pose
from hapticd.tick.remote.turning import Turning, unit
from tests.examples import examples
from tests.tick.remote.rig import PERIOD_S, Rig
from tests.tick.remote.test_objects import BALL

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
AROUND_Z = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
"""By a quarter turn."""


def test_one_without_length_is_upright_at_first_and_says_nothing_later() -> None:
    turning = Turning((0.0, 0.0, 0.0, 0.0), 2.0, 0.1)
    assert turning.now == UPRIGHT
    turning.aim(AROUND_Z, None)
    for _ in range(2000):
        turning.move(1e-3)
    assert turning.now == pytest.approx(AROUND_Z)
    turning.aim((0.0, 0.0, 0.0, 0.0), None)
    for _ in range(2000):
        turning.move(1e-3)
    assert turning.now == pytest.approx(AROUND_Z)


@pytest.mark.parametrize("length", [5e-324, 1e-200, 0.5, 1.0, 1e200, 1e308])
def test_any_length_that_a_number_has_is_brought_to_1(length: float) -> None:
    made = unit((0.0, 0.0, -length, 0.0))
    assert made == (0.0, 0.0, -1.0, 0.0)
    skew = unit((0.5 * length, -0.5 * length, 0.5 * length, 0.5 * length))
    if length > 1e-300:
        assert skew == pytest.approx((0.5, -0.5, 0.5, 0.5))


@pytest.mark.parametrize("nothing", [0.0, math.inf, math.nan])
def test_what_has_no_length_is_no_orientation(nothing: float) -> None:
    assert unit((nothing, 0.0, 0.0, 0.0)) is None


def test_it_turns_no_faster_than_its_limit_and_stops_where_it_is_told_to() -> None:
    turning = Turning(UPRIGHT, 2.0, 0.1)
    turning.aim(AROUND_Z, None)
    angles = []
    for _ in range(100):
        turning.move(1e-3)
        angles.append(2.0 * math.atan2(turning.now[3], turning.now[0]))
    steps = [after - before for before, after in zip([0.0, *angles], angles, strict=False)]
    assert max(steps) == pytest.approx(2e-3)
    assert angles[-1] == pytest.approx(0.2, rel=0.05)
    turning.stop()
    turning.move(1e-3)
    turning.move(1e-3)
    assert 2.0 * math.atan2(turning.now[3], turning.now[0]) == pytest.approx(angles[-1])


QUATERNIONS = st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda each: math.hypot(*each) > 0.1)
POINTS = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]


def angle(one: tuple[float, ...], other: tuple[float, ...]) -> float:
    """Between two orientations [rad]."""
    return 2.0 * math.acos(min(1.0, abs(sum(a * b for a, b in zip(one, other, strict=True)))))


@examples(25)
@given(QUATERNIONS, QUATERNIONS)
def test_from_any_orientation_to_any_other_it_goes_straight_by_the_shorter_way(
    of: list[float], to: list[float]
) -> None:
    turning = Turning(of, 1e6, 0.1)
    start, goal = unit(of), unit(to)
    assert start is not None
    assert goal is not None
    turning.aim(to, None)
    whole = angle(start, goal)
    gone = 0.0
    for _ in range(60):
        turning.move(1e-3)
        now = angle(start, turning.now)
        assert now + angle(turning.now, goal) == pytest.approx(whole, abs=1e-6)
        assert now >= gone - 1e-6
        gone = now
        assert math.hypot(*turning.now) == pytest.approx(1.0)
    assert angle(turning.now, goal) < 1e-3


@examples(25)
@given(QUATERNIONS, st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3))
def test_an_angular_velocity_is_one_of_the_frame_around(of: list[float], turning_rad_per_s: list[float]) -> None:
    """What is at r moves by w x r, however it stands."""
    turning = Turning(of, 1e6, 1.0)
    for _ in range(100):
        turning.aim(None, turning_rad_per_s)
        turning.move(1e-3)
    before = Pose.of((0.0, 0.0, 0.0), turning.now)
    turning.move(1e-3)
    after = Pose.of((0.0, 0.0, 0.0), turning.now)
    wx, wy, wz = turning_rad_per_s
    for point in POINTS:
        x, y, z = before.point(point)
        way = [now - was for now, was in zip(after.point(point), (x, y, z), strict=True)]
        turned = (wy * z - wz * y, wz * x - wx * z, wx * y - wy * x)
        assert way == pytest.approx([1e-3 * each for each in turned], abs=3e-5)


@pytest.mark.parametrize(("most_m_per_s", "most_rad_per_s"), [(1.0, 10.0), (0.2, 2.0)])
def test_a_plane_has_no_size_and_turns_as_fast_as_its_limit_is_at_a_tenth_of_a_metre(
    most_m_per_s: float, most_rad_per_s: float
) -> None:
    """Also where the limit comes by a reload."""
    plane = '[[scene.objects]]\nname = "floor"\nshape = "plane"\nstiffness_n_per_m = 1000.0\nremote = true\n'
    limited = plane + f"max_speed_m_per_s = {most_m_per_s}\n"
    for begin in (limited, plane + "max_speed_m_per_s = 0.5\n"):
        rig = Rig(begin, axes="xyz")
        rig.go([0.0, 0.0, 0.5], ticks=2)
        rig.switch(limited)
        steps, was = [], rig["floor"].turning.now
        for _ in range(60):
            rig.say("floor", orientation=[0.0, 1.0, 0.0, 0.0])
            rig.go()
            steps.append(angle(was, rig["floor"].turning.now))
            was = rig["floor"].turning.now
        assert max(steps) == pytest.approx(most_rad_per_s * PERIOD_S, rel=1e-3)


def test_an_objects_stiffness_goes_over_within_the_ramp_of_the_reload() -> None:
    rig = Rig(BALL, axes="xyz")
    rig.go([0.0, 0.0, -0.021], ticks=3)
    slow = rig.loaded.config.safety.model_copy(update={"ramp_s": 0.2})
    for _ in rig.tick.switch(rig.loaded.config.scene, slow):
        pass
    for part in (0.25, 0.5, 0.75, 1.0):
        for _ in range(50):
            rig.say("ball", stiffness_n_per_m=0.0)
            rig.go()
        assert rig["ball"].law_values()[0] == pytest.approx(2000.0 * (1.0 - part), abs=25.0)
