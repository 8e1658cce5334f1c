"""The paper's walls on the fake omega.7 in the daemon's own loop, in the device's time: one run decides."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from hapticd.config.loading import parse
from hapticd.config.plugin_tables import ControllerConfig
from hapticd.config.walls import MAX_WALLS
from hapticd.loop.loop import ControlLoop
from hapticd.loop.memory import EventReader, RecordReader, SharedMemory
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd.tick.assemble import make_tick
from hapticd.tick.event import EventCode
from hapticd.tick.record import RecordLayout
from tests.drivers.device_time import DeviceTime
from tests.drivers.forcedimension.bench import LEFT, RIGHT, Bench
from tests.drivers.forcedimension.lab import AXES, PRESS_N, Rest, config, press, rest_of

FALCON = 60


def run(
    bench: Bench,
    monkeypatch: pytest.MonkeyPatch,
    stiffness_n_per_m: float,
    law: str,
    rate_hz: float,
    drop_m: float,
    seconds: float = 6.0,
    axis: str = "z",
) -> Rest:
    """The daemon's own loop, from arming to the end of its ramp."""
    press(bench, drop_m, rate_hz, axis)
    loaded = parse(config(bench, stiffness_n_per_m, law, rate_hz, axis), "test")
    loop = loaded.config.loop
    driver = loaded.driver(loaded.options, loop.period_s)
    info = driver.open()
    ticks = round(seconds * rate_hz)
    clock = DeviceTime(ticks)
    monkeypatch.setattr("hapticd.loop.loop.time", clock)
    shared = SharedMemory(RecordLayout(3, info.has_orientation, MAX_WALLS), rate_hz)
    tick = make_tick(loaded, info)
    control = clock.loop = ControlLoop(driver, tick, shared, loop, loaded.config.safety, True, clock.sleep_until)
    control.run()
    told = [event.code for event in EventReader(shared).read()]
    records = RecordReader(shared).read(ticks)
    shared.close()
    assert told == [EventCode.STARTED, EventCode.ARMED]
    assert (len(records), records[-1].skipped, clock.ticks > ticks) == (ticks, 0, True)
    assert {round(record.dt_s * rate_hz, 6) for record in records[1:]} == {1.0}
    return rest_of([record.position_m[AXES.index(axis)] for record in records[-round(0.5 * rate_hz) :]])


@pytest.mark.parametrize("stiffness_n_per_m", [12000.0, 18000.0, 20000.0])
@pytest.mark.parametrize(
    ("rate_hz", "device_type", "drop_m"),
    [
        *((rate_hz, RIGHT, drop_m) for rate_hz in (1000.0, 4000.0) for drop_m in (0.0, 0.003, 0.01)),
        (1000.0, LEFT, 0.003),  # whose hand makes a difference to its gripper only
    ],
)
def test_energy_cycle_holds_the_papers_walls(
    bench: Bench,
    monkeypatch: pytest.MonkeyPatch,
    stiffness_n_per_m: float,
    rate_hz: float,
    drop_m: float,
    device_type: int,
) -> None:
    bench.set(type=device_type)
    rest = run(bench, monkeypatch, stiffness_n_per_m, "energy-cycle", rate_hz, drop_m, 6000 / rate_hz)
    assert rest.held(stiffness_n_per_m), rest


@pytest.mark.parametrize("late_forces", [0, 3, 90])
def test_the_force_comes_in_by_the_ramp_though_the_device_is_late_to_switch_its_motors_on(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, late_forces: int
) -> None:
    """It came in one step, once the ramp was over."""
    bench.set(late_forces=late_forces, mass_kg=1e6)  # nothing moves it
    given_n: list[float] = []
    sleep_until = DeviceTime.sleep_until

    def note(self: DeviceTime, deadline_ns: int) -> int:
        given_n.append(bench.get("force_n", index=2))
        return sleep_until(self, deadline_ns)

    monkeypatch.setattr(DeviceTime, "sleep_until", note)
    run(bench, monkeypatch, 1000.0, "none", 1000.0, -0.005, 0.2)
    assert not any(given_n[:late_forces])
    assert max(given_n) == pytest.approx(5.0, rel=0.01)
    rising = given_n[: given_n.index(max(given_n)) + 1]
    assert max(after - before for before, after in itertools.pairwise(rising)) <= 1.1 * 5.0 / 50.0


@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_wall_stands_on_whichever_axis_the_configuration_picks(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, axis: str
) -> None:
    rest = run(bench, monkeypatch, 20000.0, "energy-cycle", 1000.0, 0.003, axis=axis)
    assert rest.held(20000.0), rest


@pytest.mark.parametrize(("device_type", "resolution_m"), [(RIGHT, 1e-5), (FALCON, 6e-5)])
def test_the_default_law_holds_a_wall_that_oscillates_without_one(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, device_type: int, resolution_m: float
) -> None:
    bench.set(type=device_type, resolution_m=resolution_m, motor_n=8.0)
    rest = run(bench, monkeypatch, 12000.0, ControllerConfig().law, 1000.0, 0.003)
    assert rest.peak_to_peak_m < 4.5 * resolution_m
    assert rest.depth_m == pytest.approx(PRESS_N / 12000.0, abs=resolution_m)
    assert run(bench, monkeypatch, 12000.0, "none", 1000.0, 0.003).peak_to_peak_m > 5e-4


@pytest.mark.parametrize("period_us", [250.0, 1000.0])
@pytest.mark.parametrize("viscous_n_s_per_m", [0.0, 1e-4, 4.4, 300.0, -2.0])
def test_the_fakes_mechanics_are_the_loopbacks(bench: Bench, period_us: float, viscous_n_s_per_m: float) -> None:
    keys: dict[str, Any] = {"viscous_n_s_per_m": viscous_n_s_per_m, "resolution_m": 0.0, "initial_position_m": 0.004}
    keys["hand"] = {"force": {"profile": "constant", "newton": -3.0}}
    device = SimulatedDevice(SimulationOptions.model_validate(keys), period_us * 1e-6)
    bench.set(-1, period_us=period_us)
    bench.set(position_m=[0.0, 0.0, 0.004], hand_n=[0, 0, -3.0], viscous_n_s_per_m=viscous_n_s_per_m)
    bench.set(resolution_m=0, trip_m_per_s=0)
    driver = bench.driver(period_us * 1e-6)
    driver.open()
    driver.enable()
    for _ in range(1000):
        x_m = driver.read().position_m[2]
        assert x_m == pytest.approx(device.x_m, rel=1e-9, abs=1e-12)
        force_n = min(12.0, max(-12.0, -3000.0 * x_m))
        driver.write([0.0, 0.0, force_n])
        device.advance(force_n)
    driver.close()
