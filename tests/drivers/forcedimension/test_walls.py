"""The paper's walls through the driver on the fake omega.7.

Tick by tick, where a period passes with each and one run decides; and in the whole daemon, where the device moves in
real time, since the loop takes dt from the clock of a computer that is never quite on time.
"""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from hapticd.config.loading import parse
from hapticd.control.process import make_tick
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from tests.daemon.running import Daemon, Subscriber, wait_until
from tests.drivers.forcedimension.bench import BRAKE, FORCE, LEFT, RIGHT, SOFTWARE, WATCHDOG, Bench

PRESS_N = 3.0
STILL_M = 0.05e-3
WALL_M = -0.01
SLOW = 0.02
"""What a second of the wall clock is to the fake's watchdog in the daemon: a busy computer must not trip it."""


def config(bench: Bench, stiffness_n_per_m: float, law: str = "energy-cycle", rate_hz: float = 1000.0) -> str:
    return f"""
        [loop]
        rate_hz = {rate_hz}
        law_budget = 1.0
        [device]
        driver = "omega7"
        [device.options]
        library = "{bench.directory}"
        [[scene.walls]]
        axis = "z"
        position_m = {WALL_M}
        stiffness_n_per_m = {stiffness_n_per_m}
        [controller]
        law = "{law}"
        [safety]
        auto_arm = true
    """


def press(bench: Bench, drop_m: float, rate_hz: float = 1000.0) -> None:
    bench.set(-1, period_us=1e6 / rate_hz)
    bench.set(hand_n=[0.0, 0.0, -PRESS_N], position_m=[0.0, 0.0, WALL_M + drop_m])


@dataclass(frozen=True)
class Rest:
    peak_to_peak_m: float
    depth_m: float

    def held(self, stiffness_n_per_m: float) -> bool:
        called_for_m = PRESS_N / stiffness_n_per_m
        return self.peak_to_peak_m < STILL_M and abs(self.depth_m - called_for_m) <= max(0.1 * called_for_m, 3e-5)


def rest_of(positions_m: list[float]) -> Rest:
    return Rest(max(positions_m) - min(positions_m), WALL_M - sum(positions_m) / len(positions_m))


def run(bench: Bench, stiffness_n_per_m: float, law: str, rate_hz: float, drop_m: float, seconds: float = 6.0) -> Rest:
    """Every tick takes exactly its period, so one run decides."""
    press(bench, drop_m, rate_hz)
    loaded = parse(config(bench, stiffness_n_per_m, law, rate_hz), "test")
    driver = loaded.driver(loaded.options, 1.0 / rate_hz)
    tick = make_tick(loaded, driver.open())
    tick.start(driver.read())
    driver.enable()
    tick.arm()
    positions_m = []
    for _ in range(round(seconds * rate_hz)):
        driver.write(tick.step(driver.read(), 1.0 / rate_hz))
        positions_m.append(tick.position_m[2])
    assert tick.fault == 0
    driver.close()
    return rest_of(positions_m[-round(0.5 * rate_hz) :])


@pytest.mark.parametrize("stiffness_n_per_m", [12000.0, 18000.0, 20000.0])
@pytest.mark.parametrize(("rate_hz", "device_type"), [(1000.0, RIGHT), (1000.0, LEFT), (4000.0, RIGHT)])
@pytest.mark.parametrize("drop_m", [0.0, 0.003, 0.01])
def test_energy_cycle_holds_the_papers_walls(
    bench: Bench, stiffness_n_per_m: float, rate_hz: float, drop_m: float, device_type: int
) -> None:
    bench.set(type=device_type)
    rest = run(bench, stiffness_n_per_m, "energy-cycle", rate_hz, drop_m, 6000 / rate_hz)
    assert rest.held(stiffness_n_per_m), rest


def test_without_a_law_the_same_wall_oscillates(bench: Bench) -> None:
    """So that holding it means something."""
    assert run(bench, 12000.0, "none", 1000.0, 0.003).peak_to_peak_m > 5e-4


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


class Lab:
    """A daemon whose device this process sees from the outside.

    Args:
        fake_sdk: where the fake was built.
        file: the device's memory.
        stiffness_n_per_m: wall.
        rate_hz: of the loop.
        law: what stabilises the wall.
    """

    def __init__(
        self,
        fake_sdk: Path,
        file: Path,
        stiffness_n_per_m: float,
        rate_hz: float = 1000.0,
        law: str = "energy-cycle",
    ) -> None:
        self.file = file
        self.stiffness_n_per_m = stiffness_n_per_m
        self.rate_hz = rate_hz
        self.bench = Bench(fake_sdk, file)
        press(self.bench, 0.003, rate_hz)
        self.bench.set(-1, wall_scale=SLOW, real_time=1)
        os.environ["FAKE_DHD_FILE"] = str(file)
        try:
            self.daemon = Daemon(config(self.bench, stiffness_n_per_m, law, rate_hz))
        finally:
            del os.environ["FAKE_DHD_FILE"]

    def __enter__(self) -> Lab:
        self.daemon.wait_ready()
        return self

    def __exit__(self, *exception: object) -> None:
        self.daemon.__exit__(*exception)

    def look(self) -> Bench:
        """Its device; there is one view a process, so this takes it away from another lab."""
        self.bench.attach(self.file)
        return self.bench


def windows_held(subscriber: Subscriber, lab: Lab, from_s: float, seconds: float, window_s: float = 0.25) -> float:
    """Share of the windows of some time in which the wall held; a late tick of a busy computer may spoil one."""
    first = round(from_s * lab.rate_hz)
    count = round(seconds / window_s)
    ticks = round(window_s * lab.rate_hz)
    windows: list[list[float]] = [[] for _ in range(count)]
    for _, fields in subscriber.maps():
        at = (fields["seq"] - first) // ticks
        if at >= count:
            break
        if at >= 0:
            windows[at].append(fields["position_m"][2])
    held = [bool(window) and rest_of(window).held(lab.stiffness_n_per_m) for window in windows]
    return sum(held) / len(held)


def walls_in_the_daemon(fake_sdk: Path, directory: Path, rate_hz: float, seconds: float) -> list[float]:
    """How well the three walls held in their last two seconds, and how well the first one does without a law."""
    walls = [("energy-cycle", 12000.0), ("energy-cycle", 18000.0), ("energy-cycle", 20000.0), ("none", 12000.0)]
    with contextlib.ExitStack() as stack:
        labs = [
            stack.enter_context(Lab(fake_sdk, directory / f"device-{number}", stiffness, rate_hz, law))
            for number, (law, stiffness) in enumerate(walls)
        ]
        subscribers = [stack.enter_context(Subscriber(lab.daemon.endpoint, "hapticd/position")) for lab in labs]
        return [
            windows_held(subscriber, lab, seconds - 2.0, 2.0) for lab, subscriber in zip(labs, subscribers, strict=True)
        ]


@pytest.mark.usefixtures("bench")
def test_the_daemon_holds_the_papers_walls_on_the_device(fake_sdk: Path, tmp_path: Path) -> None:
    *held, without_law = walls_in_the_daemon(fake_sdk, tmp_path, 1000.0, 5.0)
    assert min(held) >= 0.75, held
    assert without_law <= 0.25


@pytest.mark.nightly
@pytest.mark.usefixtures("bench")
@pytest.mark.parametrize("rate_hz", [1000.0, 4000.0])
def test_the_daemon_holds_the_papers_walls_for_long(fake_sdk: Path, tmp_path: Path, rate_hz: float) -> None:
    *held, _ = walls_in_the_daemon(fake_sdk, tmp_path, rate_hz, 30.0)
    assert min(held) >= 0.75, held


@pytest.fixture
def lab(bench: Bench, fake_sdk: Path, tmp_path: Path) -> Iterator[Lab]:
    assert bench.get("mode") != FORCE
    with Lab(fake_sdk, tmp_path / "device", 12000.0) as made:
        wait_until(lambda: made.look().get("force_n", index=2) > 0.5 * PRESS_N, "the wall to push")
        yield made


def test_when_the_computer_goes_silent_the_device_brakes_by_itself(lab: Lab) -> None:
    """Both processes gone at once, so that nobody is left to release the device."""
    os.kill(lab.daemon.process.pid, signal.SIGSTOP)
    os.kill(lab.daemon.control_pid(), signal.SIGKILL)
    os.kill(lab.daemon.process.pid, signal.SIGKILL)
    wait_until(lambda: lab.look().get("mode") == BRAKE, "the device's watchdog")
    assert lab.look().get("cause") == WATCHDOG
    assert lab.look().vector("force_n") == [0.0, 0.0, 0.0]


def test_when_the_loop_is_killed_the_supervisor_takes_the_force_away(lab: Lab) -> None:
    os.kill(lab.daemon.control_pid(), signal.SIGKILL)
    assert lab.daemon.wait_exit() == 1
    assert lab.look().get("mode") == BRAKE
    assert lab.look().get("cause") == SOFTWARE
    assert lab.look().get("holder") == 0


def test_when_the_sdk_hangs_the_supervisor_takes_the_force_away(lab: Lab) -> None:
    lab.look().set(slow_us=60e6, slow_calls=1)
    assert lab.daemon.wait_exit() == 1
    assert lab.look().get("mode") == BRAKE
    assert "the device is without force" in lab.daemon.output()


@pytest.mark.parametrize(
    ("happen", "text"),
    [
        (Bench.press_force_button, "the force button on the device was pressed"),
        (lambda bench: bench.set(present=0), "communication error"),
    ],
)
def test_the_daemon_tells_what_the_device_did(lab: Lab, happen: Callable[[Bench], None], text: str) -> None:
    with Subscriber(lab.daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber:
        subscriber.until("hapticd/status")  # it is connected
        happen(lab.look())
        for topic, fields in subscriber.maps():
            if topic == "hapticd/event" and text in fields["text"]:
                break
        else:
            raise AssertionError(f"no event says {text}")
    wait_until(lambda: lab.look().get("mode") != FORCE or not lab.look().get("present"), "the force to be off")


def test_sigterm_ramps_out_and_leaves_the_brakes_on(lab: Lab) -> None:
    lab.daemon.process.terminate()
    assert lab.daemon.wait_exit() == 0
    assert lab.look().get("mode") == BRAKE
    assert lab.look().get("moves") == 0
