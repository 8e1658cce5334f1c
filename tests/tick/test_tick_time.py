"""What a tick makes of a device that has news at another rate than the loop, and of time on a real device."""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any

import pytest

from hapticd import plugins
from hapticd.config.models import VelocityConfig
from hapticd.config.safety import SafetyConfig
from hapticd.device import Sample
from hapticd.law import LawParams
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd.tick.contact import RunningLaw
from hapticd.tick.event import EventCode
from hapticd.tick.guard import Guard, Mode
from hapticd.tick.tick import ControlTick
from tests.tick.rig import LIMIT_N, RAMP_TICKS, Rig, device, largest_step, law, scene, wall
from tests.tick.transitions import RAMP_STEP_N, pressed

STEP_S = 1.25e-4
"""The model is stepped eight times a millisecond, whatever loop and sensor do."""
LAWS = sorted(set(plugins.names(plugins.CONTROLLERS)))
HAND = {"force": {"profile": "press-and-release", "newton": -4.0, "release_newton": 2.0, "period_s": 0.25}}
RESTING = {"force": {"profile": "constant", "newton": -3.0}}


class Closed:
    """A tick around the device model, each at a rate of its own.

    Args:
        module: the law.
        loop_steps: steps of the model from tick to tick.
        sensor_steps: steps of the model from one sample that is new to the next.
        hand: what presses.
        stiffness_n_per_m: of the wall.
        declared: what the device has: a clock, a count.
    """

    def __init__(
        self,
        module: ModuleType,
        loop_steps: int,
        sensor_steps: int,
        hand: dict[str, Any],
        stiffness_n_per_m: float = 12e3,
        **declared: Any,
    ) -> None:
        options = {"mass_kg": 0.25, "viscous_n_s_per_m": 4.4, "resolution_m": 1e-5, "hand": hand}
        self.model = SimulatedDevice(
            SimulationOptions.model_validate({**options, "max_force_n": LIMIT_N, "initial_position_m": 1e-3}), STEP_S
        )
        self.loop_s = loop_steps * STEP_S
        info = device(nominal_rate_hz=1.0 / (sensor_steps * STEP_S), resolution_m=1e-5, **declared)
        params: LawParams = module.Params()
        self.tick = ControlTick(
            scene(wall(stiffness_n_per_m)),
            VelocityConfig(),
            Guard(SafetyConfig(max_speed_m_per_s=100.0), info),
            info,
            lambda: RunningLaw(module, params),
            self.loop_s,
            0.05,
        )
        self.sample = Sample(1)
        self.told_s = 0.0
        self.positions_m: list[float] = []
        self._loop_steps = loop_steps
        self._sensor_steps = sensor_steps
        self._steps = 0
        self._see()
        self.tick.start(self.sample)
        assert self.tick.arm()

    def run(self, duration_s: float) -> None:
        force_n = 0.0
        for _ in range(round(duration_s / STEP_S)):
            self.model.advance(force_n)
            self._steps += 1
            self._see()
            if self._steps % self._loop_steps == 0:
                force_n = self.tick.step(self.sample, self.loop_s)[0]
                self.told_s += self.tick.motion.dt_s
            self.positions_m.append(self.model.x_m)
        assert self.tick.fault == 0, self.tick.fault_text

    def _see(self) -> None:
        if self._steps % self._sensor_steps == 0:
            self.sample.position_m[0] = self.model.measured_m
            self.sample.sequence = self._steps // self._sensor_steps
            self.sample.time_ns = round(self._steps * STEP_S * 1e9)


def depth_m(closed: Closed) -> tuple[float, float]:
    """Mean and span of the last 0.2 s."""
    last = closed.positions_m[-round(0.2 / STEP_S) :]
    return math.fsum(last) / len(last), max(last) - min(last)


@pytest.mark.parametrize("kind", ["has_clock", "has_sequence"])
@pytest.mark.parametrize("name", LAWS)
def test_a_loop_that_is_faster_than_its_device_settles_what_the_matched_one_settles(name: str, kind: str) -> None:
    """A 1 kHz device at 2, 4 and 8 kHz: its force comes with the news."""
    module = plugins.law(name)
    matched = Closed(module, 8, 8, RESTING, **{kind: True})
    matched.run(1.0)
    for loop_steps in (4, 2, 1):
        faster = Closed(module, loop_steps, 8, RESTING, **{kind: True})
        faster.run(1.0)
        assert depth_m(faster) == pytest.approx(depth_m(matched), rel=0.02, abs=1.1e-5)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize(("loop_steps", "sensor_steps"), [(6, 8), (5, 8), (3, 8), (8, 5), (8, 2), (16, 8), (32, 8)])
def test_at_any_ratio_of_rates_a_law_settles_what_it_settles_at_the_slower_of_the_two(
    name: str, loop_steps: int, sensor_steps: int
) -> None:
    """A quarter to 2.7 times the device's rate, in a wall that is soft enough for 250 Hz.

    Between whole ratios a sample is late by up to a tick.
    """
    module = plugins.law(name)
    slower = max(loop_steps, sensor_steps)
    matched = Closed(module, slower, slower, RESTING, 1000.0, has_sequence=True)
    matched.run(1.5)
    assert depth_m(matched)[1] < 1e-4
    other = Closed(module, loop_steps, sensor_steps, RESTING, 1000.0, has_sequence=True)
    other.run(1.5)
    assert depth_m(other) == pytest.approx(depth_m(matched), rel=0.03, abs=5e-5)


@pytest.mark.parametrize("kind", ["has_clock", "has_sequence"])
@pytest.mark.parametrize(("loop_steps", "sensor_steps"), [(8, 8), (1, 8), (2, 8), (3, 8), (8, 3), (8, 2)])
def test_laws_and_books_are_told_the_time_that_has_passed(loop_steps: int, sensor_steps: int, kind: str) -> None:
    """C2: at 4 kHz on a 1 kHz device they were told 3.5 s in 2 s."""
    told_s = []

    def step(_state: Any, _params: Any, tick: Any) -> float:
        told_s.append(tick.dt_s)
        force_n: float = tick.contact_n
        return force_n

    closed = Closed(law(step), loop_steps, sensor_steps, HAND, **{kind: True})
    closed.run(2.0)
    assert math.fsum(told_s) == pytest.approx(2.0, abs=0.01)
    assert closed.told_s == pytest.approx(2.0, abs=0.01)


def test_cycles_are_counted_and_timed_alike_whatever_the_loop_does_in_between() -> None:
    """C2: a press and a release a quarter of a second; at 4 kHz on a 1 kHz device a cycle lasted 1.75 times as long."""
    module = plugins.law("energy-cycle")
    ledgers = []
    for loop_steps in (8, 4, 2, 1):
        closed = Closed(module, loop_steps, 8, HAND, has_sequence=True)
        closed.run(3.0)
        ledgers.append((closed.tick.contacts[0].ledger, closed.tick.contacts[0]))
    matched, contact = ledgers[0]
    assert matched.cycle > 10
    assert contact.felt_mass_kg == pytest.approx(0.25, rel=0.3)
    for ledger, other in ledgers[1:]:
        assert ledger.cycle == pytest.approx(matched.cycle, abs=2)
        assert ledger.energy_j == pytest.approx(matched.energy_j, rel=0.05)
        assert ledger.generated_j == pytest.approx(matched.generated_j, rel=0.05)
        assert ledger.cycle_duration_s == pytest.approx(matched.cycle_duration_s, rel=0.05)
        assert other.felt_mass_kg == pytest.approx(contact.felt_mass_kg, rel=0.05)


def test_the_books_of_a_ramp_close_also_where_it_runs_between_samples() -> None:
    rig = pressed(has_sequence=True)
    start_j = rig.books_j
    rig.tick.release()
    for _ in range(60):
        rig.tick.step(rig.sample, 2.5e-4)
    rig.force(-1.5e-3, ticks=3, dt_s=2.5e-4)
    energy_j, stored_j, dissipated_j, generated_j = (now - was for now, was in zip(rig.books_j, start_j, strict=True))
    assert energy_j == pytest.approx(stored_j + dissipated_j - generated_j, abs=1e-12)


# Frozen


@pytest.mark.parametrize(
    ("loop_hz", "nominal_hz", "reads"),
    [
        (1000.0, 1000.0, 20),
        (8000.0, 250.0, 624),
        (8000.0, 4000.0, 156),
        (1000.0, 4000.0, 20),
        (100.0, 1000.0, 3),
        (4000.0, 1000.0, 78),
    ],
)
def test_a_device_is_frozen_by_the_time_that_it_has_been_silent(loop_hz: float, nominal_hz: float, reads: int) -> None:
    """C11: not by ticks: at 8 kHz a device of 250 Hz had that many repeats from the first sample to the next.

    Half a sample less than twenty of them; a clock's rounding makes it a read more where a read is a fraction of that.
    """
    rig = pressed(has_sequence=True, nominal_rate_hz=nominal_hz)
    count = 0
    while not rig.tick.fault:
        rig.tick.step(rig.sample, 1.0 / loop_hz)
        count += 1
        assert count < 1000
    assert rig.tick.fault == EventCode.DEVICE_FROZEN
    assert count in ((reads, reads + 1) if loop_hz > nominal_hz else (reads,))


def test_one_read_without_news_after_a_long_pause_is_no_frozen_device() -> None:
    rig = pressed(has_sequence=True)
    rig.tick.step(rig.sample, 0.09)
    rig.force(-2e-3)
    assert rig.tick.fault == 0


# Over-speed


@pytest.mark.parametrize(
    "velocity",
    [
        {"estimator": "lowpass", "cutoff_hz": 1.0},
        {"samples": 50},
        {"estimator": "foaw", "samples": 30},
        {"estimator": "device"},
    ],
    ids=str,
)
def test_no_filter_of_the_user_hides_a_device_that_is_too_fast(velocity: dict[str, Any]) -> None:
    """C6: 3 m/s over 147 mm did not trip a limit of 1 m/s behind a low-pass of 1 Hz."""
    rig = Rig(
        at_m=0.0,
        velocity=VelocityConfig.model_validate(velocity),
        safety={"max_speed_m_per_s": 1.0},
        has_velocity=True,
    )
    for count in range(3):
        rig.force(3e-3 * (count + 1))
    assert rig.tick.fault == EventCode.OVER_SPEED
    assert rig.tick.fault_text.startswith("3 m/s")


def test_a_limit_of_speed_that_comes_later_counts_from_where_the_device_is_then() -> None:
    rig = Rig(at_m=0.0, simulated=True, safety={"profile": "simulation", "max_speed_m_per_s": None})
    rig.force(0.05, ticks=2)
    rig.switch(safety=SafetyConfig(max_speed_m_per_s=1.0))
    rig.force(0.0505)
    assert rig.tick.fault == 0
    rig.force(0.0525)
    assert rig.tick.fault == EventCode.OVER_SPEED


# Changes of a wall


def test_a_wall_that_changes_in_time_comes_in_by_a_ramp_on_a_real_device() -> None:
    """C7: it stepped by 11.5 N in one tick."""
    rig = pressed(wall(250.0, changes=[{"at_s": 0.02, "stiffness_n_per_m": 6000.0}]))
    forces = rig.forces(-2e-3, 200)
    assert forces[0] == 0.5
    assert forces[-1] == 12.0
    assert largest_step(forces) <= 2.0 * RAMP_STEP_N
    assert forces.index(12.0) == pytest.approx(20 + RAMP_TICKS, abs=3)


def test_in_a_simulation_it_steps_as_it_says() -> None:
    rig = pressed(wall(250.0, changes=[{"at_s": 0.02, "stiffness_n_per_m": 6000.0}]), simulated=True)
    forces = rig.forces(-2e-3, 30)
    assert forces[17] == 0.5
    assert forces[18:] == [12.0] * 12


def test_its_time_goes_on_while_ticks_are_missed() -> None:
    rig = pressed(wall(250.0, changes=[{"at_s": 0.2, "stiffness_n_per_m": 500.0}]))
    rig.force(-2e-3, ticks=4, dt_s=0.05)
    assert rig.tick.contacts[0].wall.stiffness_n_per_m == 500.0


# Calibration


def test_an_armed_device_that_is_not_calibrated_any_more_is_a_fault_though_its_position_is_possible() -> None:
    """C12: forces went on."""
    rig = pressed()
    rig.sample.calibrated = False
    forces = [4.0, *rig.forces(-2e-3, 12)]
    assert forces == pytest.approx([4.0 * max(0.0, 1.0 - count / 10.0) for count in range(13)], abs=1e-12)
    assert rig.tick.fault == EventCode.SAMPLE_IMPOSSIBLE
    assert "where it is" in rig.tick.fault_text
    assert rig.tick.guard.latched


def test_one_that_forgets_it_while_it_is_let_go_loses_the_rest_of_its_force_at_once() -> None:
    rig = pressed()
    rig.tick.release()
    rig.forces(-2e-3, 5)
    rig.sample.calibrated = False
    assert rig.forces(-2e-3, 11)[-1] == 0.0
    assert rig.tick.guard.mode is Mode.DISARMED
    assert rig.tick.fault == 0


@pytest.mark.parametrize("clock_dt_s", [-1e-3, -math.inf, math.inf, math.nan, 0.0])
def test_a_clock_that_goes_back_or_tells_no_time_takes_no_ramp_further(clock_dt_s: float) -> None:
    rig = pressed()
    rig.tick.release()
    (before_n,) = rig.forces(-2e-3, 10)[-1:]
    rig.sample.time_ns += 1_000_000
    rig.sample.sequence += 1
    assert list(rig.tick.advance(rig.sample, clock_dt_s)) == pytest.approx([before_n])
    assert before_n > 0.5
    assert rig.forces(-2e-3, 1)[-1] == pytest.approx(before_n - 4.0 / RAMP_TICKS)
