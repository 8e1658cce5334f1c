"""The input-to-state stable wall is still, even one sample late, and half as stiff as it was asked to be."""

from __future__ import annotations

import itertools

import pytest

from hapticd.law import LawSnapshot, LawTick, fresh_state, plain_object, scalar_params
from hapticd_controllers import damper, input_to_state
from hapticd_controllers.input_to_state import Params

from . import machine
from .plant import Device, Rig, rests

SHOWN = 1.1 / 2.1
"""mu / (k + mu) at mu = 1.1 k."""


@pytest.mark.parametrize("delay_samples", [0, 1])
@pytest.mark.parametrize("stiffness_n_per_m", [12e3, 20e3])
def test_it_is_still_and_shows_little_more_than_half_the_stiffness(
    stiffness_n_per_m: float, delay_samples: int
) -> None:
    device = Device(stiffness_n_per_m=stiffness_n_per_m, delay_samples=delay_samples, hand_n=-6.0)
    for rest in rests(input_to_state, device, drive=machine.drive):
        assert rest.still
        assert not rest.held
        assert 6.0 / rest.depth_m == pytest.approx(SHOWN * stiffness_n_per_m, rel=0.01)


def test_it_pulls_back_who_leaves() -> None:
    rig = Rig(input_to_state, Device(hand_n=-6.0), drive=machine.drive)
    rig.run(1.0)
    left = rig.let_go()
    assert left.pull_n == pytest.approx(1.6, abs=0.1)
    assert left.speed_m_per_s == pytest.approx(0.082, abs=0.005)


def test_one_count_of_the_position_makes_the_force_ring_at_half_the_rate() -> None:
    """The wall gives way to the force of the last sample: it overshoots by k / mu, each time with the other sign."""
    state, tick = fresh_state(input_to_state), LawTick()
    params = plain_object("Params", scalar_params(Params()))
    input_to_state.start(state, params, LawSnapshot())
    tick.dt_s, tick.in_contact = 1e-3, True

    def force_n(x_m: float) -> float:
        tick.x_m = x_m
        tick.spring_n = tick.contact_n = -12e3 * x_m
        return input_to_state.step(state, params, tick)

    for _ in range(400):
        force_n(-250e-6)
    rest_n = SHOWN * 12e3 * 260e-6
    off_n = [force_n(-260e-6) - rest_n for _ in range(20)]
    assert off_n[0] == pytest.approx(0.12 * (4.0 - SHOWN))
    assert off_n[1] == pytest.approx(-0.38, abs=0.01)
    for before, after in itertools.pairwise(off_n[1:]):
        assert after == pytest.approx(-before / 1.1)


def test_a_lead_of_one_sample_is_enough_only_because_the_force_is_a_sample_old() -> None:
    """Solved within the sample the wall would be a spring of k mu / (k + mu) and a damper tau k mu / (k + mu)."""
    late = Device(stiffness_n_per_m=20e3, delay_samples=1)
    assert all(rest.still for rest in rests(input_to_state, late, Params(lead_s=0.001), machine.drive))
    solved = Device(stiffness_n_per_m=SHOWN * 20e3, delay_samples=1)
    for lead_s, still in ((0.001, False), (0.003, True)):
        params = damper.Params(damping_n_s_per_m=lead_s * SHOWN * 20e3)
        assert all(rest.still is still for rest in rests(damper, solved, params, machine.drive))


def test_a_second_touch_is_as_the_first_and_a_start_knows_of_no_force() -> None:
    state, params = fresh_state(input_to_state), Params()
    input_to_state.start(state, params, LawSnapshot(-1e-3, 0.0, 5.0))
    touch = LawTick(x_m=-1e-3, moved_m=-2e-3, velocity_m_per_s=-0.2, in_contact=True, contact_n=12.0, spring_n=12.0)
    first_n = input_to_state.step(state, params, touch)
    assert state.environment_n == pytest.approx(12.0)
    assert input_to_state.step(state, params, LawTick(x_m=1e-3, moved_m=2e-3)) == 0.0
    assert input_to_state.step(state, params, touch) == first_n
    assert state.environment_n == pytest.approx(12.0)
