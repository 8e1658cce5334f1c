"""What the ring-damping law leaves alone, what it brakes, what it learns, and how it lets go."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from hapticd.law import LawSnapshot, LawTick, fresh_state, plain_object, scalar_params
from hapticd_controllers import none, ring_damping
from hapticd_controllers.ring_damping import Params

from . import machine
from .plant import PAPER, Device, Rig, held

SOFT = Device(stiffness_n_per_m=4e3)
"""The omega7 model holds this wall by itself."""
HARD = Device(stiffness_n_per_m=12e3, x_m=0.002)
"""And this one not."""


def rig_on(device: Device, params: Params | None = None) -> Rig:
    return Rig(ring_damping, device, params, machine.drive)


def leak(device: Device) -> float:
    """What a sampled spring generates, as damping: k T / 2."""
    return 0.5 * device.stiffness_n_per_m * device.period_s


def tap(rig: Rig, hand_n: float = -4.0, push_s: float = 0.1, away_s: float = 0.4) -> None:
    """Push, then lift off and wait."""
    rig.change(hand_n=hand_n)
    rig.run(push_s)
    rig.change(hand_n=1.0)
    rig.run(0.05)
    rig.change(hand_n=0.0, v_m_per_s=0.0, x_m=0.002)
    rig.run(away_s)


def ticks(rig: Rig, count: int) -> list[Any]:
    """Position, force and damping of each tick."""
    found = []
    for _ in range(count):
        rig.run(rig.device.period_s)
        found.append((rig.tick.x_m, rig.tick.applied_n, rig.state.damping_n_s_per_m, rig.state.brake))
    return found


def watched(x_m: list[float]) -> list[tuple[float, float]]:
    """Brake and leaks of a fresh law that is shown these positions in a wall of 4 kN/m, tick by tick, at 1 kHz."""
    state, params = fresh_state(ring_damping), plain_object("Params", scalar_params(Params()))
    ring_damping.start(state, params, LawSnapshot(x_m=x_m[0]))
    tick, found = LawTick(1e-6), []
    tick.dt_s, tick.in_contact, tick.x_m = 1e-3, True, x_m[0]
    for at_m in x_m:
        tick.moved_m, tick.x_m = at_m - tick.x_m, at_m
        tick.velocity_m_per_s = tick.moved_m / tick.dt_s
        tick.spring_n = tick.contact_n = -4e3 * at_m
        ring_damping.step(state, params, tick)
        found.append((state.brake, state.leaks))
    return found


def shown(x_m: float, times_s: list[float], velocity_m_per_s: float = 0.0) -> tuple[Any, list[float]]:
    """A fresh law with 8 leaks of 4 kN/m that stands at x_m for these times between samples, and its forces."""
    state, params = fresh_state(ring_damping), plain_object("Params", scalar_params(Params(least_brake_ratio=0.0)))
    ring_damping.start(state, params, LawSnapshot(x_m=x_m))
    tick, forces_n = LawTick(1e-6), []
    tick.in_contact, tick.x_m, tick.velocity_m_per_s = True, x_m, velocity_m_per_s
    tick.spring_n = tick.contact_n = -4e3 * x_m
    for number, tick.dt_s in enumerate(times_s):
        if number == 5:
            state.leaks = 8.0
        forces_n.append(ring_damping.step(state, params, tick))
    return state, forces_n


@pytest.mark.parametrize("late_s", [[2.1e-3], [1.9e-3, 0.1e-3], [2.5e-3, 1e-3, 2.5e-3, 1e-3, 2.5e-3], [0.03]])
def test_a_late_tick_is_no_softer_wall(late_s: list[float]) -> None:
    """Where a tick in time followed, half of what was learnt was forgotten: 8 leaks were 1 after three of them."""
    state, _ = shown(-1e-3, [1e-3] * 50 + late_s + [1e-3] * 5)
    assert state.leaks == 8.0
    assert state.base_n_s_per_m == pytest.approx(8.0 * 2.0)


def test_a_late_tick_is_damped_as_at_twice_the_time_at_most() -> None:
    """100 ms late it had 250 N s/m for one tick."""
    times_s = [1e-3] * 50
    on_time, _ = shown(-1e-3, times_s)
    late, _ = shown(-1e-3, [*times_s, 0.1])
    assert late.base_n_s_per_m == pytest.approx(2.0 * on_time.base_n_s_per_m)
    first_late, _ = shown(-1e-3, [0.3, *times_s])
    assert first_late.base_n_s_per_m == pytest.approx(on_time.base_n_s_per_m)


def test_another_rate_is_followed() -> None:
    for dt_s in (0.25e-3, 10e-3):
        state, _ = shown(-1e-3, [1e-3] * 50 + [dt_s] * 200)
        assert state.base_n_s_per_m == pytest.approx(8.0 * 0.5 * 4e3 * dt_s)


def test_damping_pulls_on_neither_side_of_a_surface() -> None:
    """What sticks is stretched either way."""
    for out in (0.1, 0.5):
        (_, low_n), (_, high_n) = (shown(1e-3 * side, [1e-3] * 20, -out * side) for side in (-1.0, 1.0))
        assert high_n == pytest.approx([-newton for newton in low_n])
        assert min(low_n) >= 0.0


# What it leaves alone


def test_a_minute_of_taps_on_a_wall_that_needs_no_law_leaves_the_damping_at_the_leak() -> None:
    rig = rig_on(SOFT)
    for _ in range(100):
        tap(rig)
    assert rig.state.damping_n_s_per_m == pytest.approx(leak(SOFT), rel=1e-9)


def test_the_brake_relaxes_while_rings_die_away_by_themselves() -> None:
    rig = rig_on(SOFT)
    tap(rig)
    fresh = rig.state.first_brake
    for _ in range(40):
        tap(rig)
    assert rig.state.first_brake < 0.1 * fresh


def test_an_arrival_is_braked_by_as_much_as_its_time_and_only_until_the_first_turn() -> None:
    """A quarter of a period after the touch it is the full brake of the device's mass, which no law can know yet."""
    rig, params = rig_on(SOFT), Params()
    rig.run(0.002)
    seen, damping = 0, []
    while rig.tick.velocity_m_per_s <= 0.0 or not rig.tick.in_contact:
        rig.run(1e-3)
        if rig.tick.in_contact:
            seen += 1
            damping.append(rig.state.damping_n_s_per_m - leak(SOFT))
    assert damping == sorted(damping)
    quarter = 0.5 * math.pi * math.sqrt(SOFT.mass_kg / SOFT.stiffness_n_per_m)
    full = 2.0 * params.brake_ratio * math.sqrt(SOFT.mass_kg * SOFT.stiffness_n_per_m)
    assert damping[round(quarter / 1e-3)] == pytest.approx(full, rel=0.15)
    assert seen < 45


def test_single_counts_of_a_slow_arrival_are_no_blows() -> None:
    """Its speed is 0 or a count in a tick, and 45 ms after the touch the brake is 40 times the leak."""
    slow = Device(stiffness_n_per_m=2e3, viscous_n_s_per_m=24.0, hand_n=-0.5, x_m=3e-4)
    for ahead in range(6):
        forces = [force_n for x_m, force_n, *_ in ticks(rig_on(replace(slow, x_m=slow.x_m + ahead * 3.1e-6)), 200)]
        steps = [abs(after - before) for before, after in pairwise(forces)]
        assert max(forces) > 0.4
        assert max(steps) < 0.4


def test_a_hand_that_goes_on_pressing_is_let_through_after_its_half_period() -> None:
    rig = rig_on(replace(SOFT, hand_n=0.0, x_m=1e-5, resolution_m=1e-6))
    seen = []
    for at in range(200):
        rig.change(hand_n=-0.03 * at)
        seen += ticks(rig, 1)
    inside = [damping for x_m, _, damping, _ in seen if x_m < 0.0]
    assert max(inside[:45]) > 10.0 * leak(SOFT)
    assert max(inside[-20:]) == pytest.approx(leak(SOFT))


def test_the_base_that_is_published_outside_is_the_one_that_the_next_touch_gets() -> None:
    """What leaving has halved is known at once, and not only in the wall: a switch or a new start takes it along."""
    rig = rig_on(replace(SOFT, hand_n=-1.0))
    ring_damping.start(rig.state, rig.params, LawSnapshot(damping_n_s_per_m=150.0))
    rig.run(0.2)
    before = rig.state.base_n_s_per_m
    rig.change(hand_n=1.0)
    rig.run(0.2)
    outside = rig.state.base_n_s_per_m
    assert leak(SOFT) < outside <= 0.5 * before
    rig.change(hand_n=-6.0, v_m_per_s=0.0, x_m=2e-5)
    while not rig.tick.in_contact:
        rig.run(1e-3)
    assert rig.state.base_n_s_per_m == pytest.approx(outside)


def test_a_stroke_of_the_hand_is_not_braked() -> None:
    """2 Hz, 250 ms from turn to turn, against a ring of 20 Hz that looks alike otherwise."""
    seen = watched([-1e-3 + 5e-4 * math.sin(math.tau * 2.0 * at * 1e-3) for at in range(4000)])
    assert max(brake for brake, _ in seen) == 0.0
    rings = watched([-1e-3 + 5e-4 * math.sin(math.tau * 20.0 * at * 1e-3) for at in range(400)])
    assert max(brake for brake, _ in rings) > 0.0


def test_it_does_not_hold_on_to_a_device_that_leaves() -> None:
    dropped = replace(HARD, x_m=0.004)
    rig = rig_on(dropped)
    lowest_n = min(force_n for x_m, force_n, _, _ in ticks(rig, 60))
    pulls = rig_on(dropped, Params(pull_after=0))
    assert lowest_n == 0.0
    assert min(force_n for x_m, force_n, _, _ in ticks(pulls, 60)) < -0.1


# What it holds


@pytest.mark.parametrize("stiffness_n_per_m", [12e3, 18e3, 20e3])
@pytest.mark.parametrize("hand_n", [-1.0, -3.0, -6.0])
def test_the_omega7_model_settles_however_it_arrives(stiffness_n_per_m: float, hand_n: float) -> None:
    devices = [Device(stiffness_n_per_m=stiffness_n_per_m, hand_n=hand_n, x_m=at * 0.0005) for at in range(20)]
    assert all(rig_on(device).run(4.0).held for device in devices)
    assert not all(held(none, device) for device in devices)


@pytest.mark.parametrize("start", [PAPER, replace(PAPER, x_m=0.005)], ids=["on the wall", "dropped 5 mm"])
@pytest.mark.parametrize("active", ["nothing", "device", "wall"])
def test_every_simulation_of_the_paper_converges(start: Device, active: str) -> None:
    """Fig. 6: no damping at all; in d-f -1 N s/m from 0.2 s on, in the device or in the wall."""
    rig = rig_on(start)
    rig.run(0.2)
    if active == "device":
        rig.change(viscous_n_s_per_m=-1.0)
    elif active == "wall":
        rig.change(damping_n_s_per_m=-1.0)
    assert rig.run(3.0).held


def test_one_sample_of_delay_grows_the_base() -> None:
    """Three leaks are due then; only the swings that do not die away tell it."""
    late = Device(stiffness_n_per_m=15e3, resolution_m=2e-6, delay_samples=1, hand_n=-3.3, x_m=0.002)
    rig = rig_on(late)
    assert rig.run(6.0).held
    assert rig.state.base_n_s_per_m > 1.3 * leak(late)


# How it lets go


def test_after_silence_the_brake_is_off_and_the_damping_is_the_base() -> None:
    rig = rig_on(HARD)
    braked = [damping for _, _, damping, brake in ticks(rig, 200) if brake > 0.0]
    assert max(braked) > 5.0 * leak(HARD)
    rig.run(1.0)
    assert rig.state.brake == 0.0
    assert rig.state.damping_n_s_per_m == rig.state.base_n_s_per_m


def test_outside_the_wall_nothing_but_the_base_is_published() -> None:
    rig = rig_on(HARD)
    rig.run(0.05)
    rig.change(hand_n=6.0)
    rig.run(0.5)
    assert rig.tick.x_m > 0.0
    assert rig.state.damping_n_s_per_m == rig.state.base_n_s_per_m


@pytest.mark.parametrize("hand_n", [-1.8, -2.4, -3.0, -4.2])
def test_a_wall_that_softens_takes_its_damping_along_within_a_second(hand_n: float) -> None:
    """12 -> 2 kN/m at run time: both parts of the damping are in units of the wall, and what then rings arrives."""
    rig = rig_on(replace(HARD, hand_n=hand_n))
    rig.run(3.0)
    assert rig.state.damping_n_s_per_m >= 0.999 * leak(HARD)
    rig.change(stiffness_n_per_m=2e3)
    rig.run(1.0)
    assert rig.state.damping_n_s_per_m == pytest.approx(1.0)
    assert rig.run(1.0).held


def test_the_base_relaxes_when_another_hand_takes_over() -> None:
    """What a device without any damping had asked for is not what a damped hand gets."""
    late = Device(stiffness_n_per_m=15e3, viscous_n_s_per_m=1.0, resolution_m=2e-6, delay_samples=1, hand_n=-3.3)
    rig = rig_on(late)
    rig.run(6.0)
    learned = rig.state.base_n_s_per_m
    assert learned > 2.0 * leak(late)
    rig.change(viscous_n_s_per_m=30.0)
    for _ in range(10):
        tap(rig)
    assert rig.state.base_n_s_per_m < 1.1 * leak(late)


def test_a_base_that_the_mass_limits_relaxes_from_where_it_is() -> None:
    """No base holds this wall undamped: its leaks grow without end, and the next hand does not wait for them."""
    late = Device(stiffness_n_per_m=25e3, viscous_n_s_per_m=0.5, resolution_m=2e-6, delay_samples=1, hand_n=-3.3)
    rig = rig_on(late)
    rig.run(6.0)
    learned = rig.state.base_n_s_per_m
    assert rig.state.leaks > 10.0 * learned / leak(late)
    rig.change(viscous_n_s_per_m=30.0)
    tap(rig)
    assert rig.state.base_n_s_per_m <= 0.5 * learned


# What it learns


@pytest.mark.parametrize("mass_kg", [0.05, 0.25, 1.0])
def test_the_swing_tells_the_mass(mass_kg: float) -> None:
    device = Device(
        mass_kg=mass_kg, viscous_n_s_per_m=16.0 * mass_kg, stiffness_n_per_m=2e4 * mass_kg, resolution_m=1e-6
    )
    rig = rig_on(device, Params(brake_ratio=0.0, least_brake_ratio=0.0))
    rig.run(0.5)
    assert rig.state.felt_mass_kg == pytest.approx(mass_kg, rel=0.15)


@pytest.mark.parametrize("drop_m", [4.75e-3, 8.98e-3, 9.15e-3])
def test_a_wall_whose_force_is_limited_makes_no_device_heavy(drop_m: float) -> None:
    """12 N stop it later than 20 kN/m would have: a long swing, and no heavy device."""
    pressed = Device(stiffness_n_per_m=20e3, hand_n=-6.0, x_m=drop_m)
    rig = rig_on(pressed)
    assert rig.run(4.0).held
    assert rig.state.felt_mass_kg < 2.5 * pressed.mass_kg


def test_damping_of_the_law_before_becomes_a_base_and_never_a_spike() -> None:
    rig = rig_on(SOFT, Params(brake_ratio=0.0, least_brake_ratio=0.0))
    ring_damping.start(rig.state, rig.params, LawSnapshot(damping_n_s_per_m=150.0))
    largest = max(damping for x_m, _, damping, brake in ticks(rig, 5) if x_m < 0.0)
    assert largest == pytest.approx(4.0 * leak(SOFT))
    for _ in range(5):
        tap(rig)
    assert rig.state.base_n_s_per_m == pytest.approx(leak(SOFT), rel=1e-9)


@pytest.mark.parametrize(("stiffness_n_per_m", "before_n_s_per_m"), [(4e3, 3.0), (1e3, 1.5), (1e3, 0.6)])
def test_damping_of_the_law_before_that_is_within_four_leaks_goes_on_as_it_was(
    stiffness_n_per_m: float, before_n_s_per_m: float
) -> None:
    state, params = fresh_state(ring_damping), plain_object("Params", scalar_params(Params()))
    ring_damping.start(state, params, LawSnapshot(x_m=-1e-3, damping_n_s_per_m=before_n_s_per_m))
    tick = LawTick(1e-6)
    tick.dt_s, tick.in_contact, tick.x_m = 1e-3, True, -1e-3
    tick.spring_n = tick.contact_n = 1e-3 * stiffness_n_per_m
    ring_damping.step(state, params, tick)
    assert state.damping_n_s_per_m == pytest.approx(before_n_s_per_m)


def test_a_law_that_takes_over_in_mid_contact_does_not_take_the_depth_for_a_swing() -> None:
    seen = watched([-1e-3] * 5 + [-1e-3 + 2e-6 * at for at in range(100)])
    assert max(brake for brake, _ in seen) == 0.0


# What it endures


def test_noise_is_not_taken_for_swings() -> None:
    """4 um of it on a wall that rests: without a threshold of its own every other tick would turn."""
    draw = random.Random(3)
    seen = watched([-1e-3 + draw.gauss(0.0, 4e-6) for _ in range(5000)])
    assert max(brake for brake, _ in seen[200:]) == 0.0
    assert max(leaks for _, leaks in seen) < 1.5


def test_a_period_that_varies_by_a_third_changes_nothing_that_matters() -> None:
    rig = rig_on(HARD)
    for at in range(4000):
        rig.tick.dt_s = 1e-3 * (1.0 + 0.3 * math.sin(at * at * 0.3))
        rig.run(1e-3)
    rig.tick.dt_s = 1e-3
    assert rig.run(1.0).held
