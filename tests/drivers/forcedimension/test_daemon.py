"""The whole daemon on the fake omega.7, in real time, judged from its telemetry and from what the device says."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from hapticd.tick.event import EventCode
from tests.daemon.running import HAPTICD, Subscriber, wait_until
from tests.drivers.forcedimension.bench import BRAKE, FORCE, RESET, SOFTWARE, WATCHDOG, Bench
from tests.drivers.forcedimension.lab import PRESS_N, Lab, rest_of

LATE = {EventCode.LOOP_LATE, EventCode.LAW_OVER_BUDGET}
"""Faults that say that this computer was too busy: they tell nothing of the driver."""

ATTEMPTS = 3
WINDOW_S = 0.25
WINDOWS = 8
PATIENCE = 10


class BusyError(Exception):
    """The computer was too busy for a run to count."""


def share_held(subscriber: Subscriber, lab: Lab, from_s: float) -> float:
    """Share of eight quarter seconds in which the wall held, of those in which no deadline was missed.

    Raises:
        BusyError: the loop was stopped because it was late, or hardly ever was on time.
    """
    ticks = round(WINDOW_S * lab.rate_hz)
    window = round(from_s / WINDOW_S)
    positions: list[float] = []
    longest_s = 0.0
    held = []
    for topic, fields in subscriber.maps():
        if topic == "hapticd/event":
            if fields["code"] in LATE:
                raise BusyError(fields["text"])
            assert not 200 <= fields["code"] < 300, fields
        elif topic == "hapticd/timing":
            longest_s = max(longest_s, fields["dt_s"])
        elif fields["seq"] >= (window + 1) * ticks:
            if len(positions) >= 0.8 * ticks and longest_s * lab.rate_hz < 2.0:
                held.append(rest_of(positions).held(lab.stiffness_n_per_m))
            positions = []
            longest_s = 0.0
            window = fields["seq"] // ticks
            if len(held) == WINDOWS:
                return sum(held) / WINDOWS
            if window * WINDOW_S > from_s + PATIENCE * WINDOWS * WINDOW_S:
                break
        elif fields["seq"] >= window * ticks:
            positions.append(fields["position_m"][2])
    raise BusyError("the loop was hardly ever on time")


def shares_held(
    fake_sdk: Path, directory: Path, walls: Sequence[tuple[str, float]], rate_hz: float, from_s: float
) -> list[float]:
    """How well each wall holds from some time on, the stiffness in N/m: a daemon a wall, first all side by side.

    Four loops are themselves what makes this computer late, so a wall that got no quiet moment then has one alone.
    """
    together = shares(fake_sdk, directory / "all", walls, rate_hz, from_s)
    return [
        share if share is not None else alone(fake_sdk, directory / f"wall-{number}", wall, rate_hz, from_s)
        for number, (wall, share) in enumerate(zip(walls, together, strict=True))
    ]


def alone(fake_sdk: Path, place: Path, wall: tuple[str, float], rate_hz: float, from_s: float) -> float:
    """How well a wall holds beside no other."""
    for attempt in range(ATTEMPTS):
        (share,) = shares(fake_sdk, place / str(attempt), [wall], rate_hz, from_s)
        if share is not None:
            return share
    raise AssertionError(f"this computer was too busy {ATTEMPTS} times for {wall} alone")


def shares(
    fake_sdk: Path, place: Path, walls: Sequence[tuple[str, float]], rate_hz: float, from_s: float
) -> list[float | None]:
    """How well each wall holds beside the others; None of one for which this computer was too busy."""
    place.mkdir(parents=True)
    topics = ("hapticd/position", "hapticd/timing", "hapticd/event")
    found: list[float | None] = []
    with contextlib.ExitStack() as stack:
        labs = [
            stack.enter_context(Lab(fake_sdk, place / f"device-{number}", stiffness, rate_hz, law))
            for number, (law, stiffness) in enumerate(walls)
        ]
        subscribers = [stack.enter_context(Subscriber(lab.daemon.endpoint, *topics)) for lab in labs]
        for subscriber, lab in zip(subscribers, labs, strict=True):
            try:
                found.append(share_held(subscriber, lab, from_s))
            except BusyError:
                found.append(None)
    return found


@pytest.mark.usefixtures("bench")
def test_it_holds_the_papers_walls(fake_sdk: Path, tmp_path: Path) -> None:
    walls = [("ring-damping", 12000.0), ("energy-cycle", 12000.0), ("energy-cycle", 20000.0), ("none", 12000.0)]
    *held, without_law = shares_held(fake_sdk, tmp_path, walls, 1000.0, 3.0)
    assert min(held) >= 0.75, held
    assert without_law <= 0.25


@pytest.mark.nightly
@pytest.mark.usefixtures("bench")
@pytest.mark.parametrize("rate_hz", [1000.0, 4000.0])
def test_it_holds_the_papers_walls_for_long(fake_sdk: Path, tmp_path: Path, rate_hz: float) -> None:
    walls = [("energy-cycle", 12000.0), ("energy-cycle", 18000.0), ("energy-cycle", 20000.0)]
    held = shares_held(fake_sdk, tmp_path, walls, rate_hz, 30.0)
    assert min(held) >= 0.75, held


@pytest.fixture
def lab(bench: Bench, fake_sdk: Path, tmp_path: Path) -> Iterator[Lab]:
    assert bench.get("mode") != FORCE
    with Lab(fake_sdk, tmp_path / "device", 12000.0) as made:
        wait_until(lambda: made.look().get("force_n", index=2) > 0.5 * PRESS_N, "the wall to push")
        yield made


def test_when_the_computer_goes_silent_the_device_brakes_by_itself(lab: Lab) -> None:
    """Both processes gone at once, and the helper with them, so that nobody is left to release the device."""
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


def test_the_force_button_latches_until_somebody_clears_and_arms(lab: Lab) -> None:
    with Subscriber(lab.daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber:
        subscriber.until("hapticd/status")  # it is connected
        lab.look().set(hand_n=[0.0, 0.0, 0.0])
        lab.look().press_force_button()
        fault = subscriber.until("hapticd/event", code=EventCode.DEVICE_FAULT)
        assert "the force button on the device was pressed" in fault["text"]
        subscriber.until("hapticd/event", code=EventCode.DEVICE_FOUND)
        assert lab.look().get("mode") == BRAKE
        assert "hapticd clear" in lab.ask("arm")
        assert lab.ask("clear") == ""
        assert lab.ask("arm") == ""
        assert lab.look().get("mode") == FORCE


def test_forces_that_the_motors_cannot_give_are_told_once_and_counted_in_the_status(lab: Lab) -> None:
    with Subscriber(lab.daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber:
        assert subscriber.until("hapticd/status")["device_metrics"]["saturated_forces"] == 0.0
        lab.look().set(motor_n=0.97 * PRESS_N, viscous_n_s_per_m=300.0)  # pushed through the wall, but slowly
        warning = subscriber.until("hapticd/event", code=EventCode.DEVICE_WARNING)
        assert warning["metric"] == "saturated_forces"
        told = warning["value"]
        assert told >= 1.0
        while subscriber.until("hapticd/status")["device_metrics"]["saturated_forces"] < told + 20.0:
            pass
        assert lab.look().get("mode") == FORCE


def test_an_unplugged_device_comes_back(lab: Lab) -> None:
    with Subscriber(lab.daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber:
        subscriber.until("hapticd/status")  # it is connected
        lab.look().set(present=0, hand_n=[0.0, 0.0, 0.0])
        lost = subscriber.until("hapticd/event", code=EventCode.DEVICE_LOST)
        assert "communication error" in lost["text"]
        lab.look().set(present=1)
        subscriber.until("hapticd/event", code=EventCode.DEVICE_FOUND)
        wait_until(lambda: lab.look().get("mode") == FORCE, "auto_arm to arm it again")


def test_sigterm_ramps_out_and_leaves_the_brakes_on(lab: Lab) -> None:
    lab.daemon.process.terminate()
    assert lab.daemon.wait_exit() == 0
    assert lab.look().get("mode") == BRAKE
    assert lab.look().get("moves") == 0


@pytest.mark.usefixtures("bench")
def test_a_falcon_holds_a_wall_for_a_user_who_accepts_that_it_has_no_watchdog(fake_sdk: Path, tmp_path: Path) -> None:
    def be_a_falcon(bench: Bench) -> None:
        bench.set(type=60, calibrated=0, motor_n=8.0)

    refused = Lab(fake_sdk, tmp_path / "refused", 2000.0, prepare=be_a_falcon)
    try:
        assert refused.daemon.wait_exit() != 0
        assert "accept_no_watchdog = false: Novint Falcon keeps its last force" in refused.daemon.output()
    finally:
        refused.__exit__()
    with Lab(fake_sdk, tmp_path / "device", 2000.0, prepare=be_a_falcon, accept_no_watchdog=True) as lab:
        wait_until(lambda: abs(lab.look().get("force_n", index=2) - PRESS_N) < 0.1, "the wall to carry the hand")
        os.kill(lab.daemon.control_pid(), signal.SIGKILL)
        assert lab.daemon.wait_exit() == 1
        assert lab.look().vector("force_n") == [0.0, 0.0, 0.0]
        assert lab.look().get("moves") == 0


@pytest.mark.usefixtures("bench")
def test_a_device_that_was_just_switched_on_says_so_and_is_no_fault_until_it_is_calibrated(
    fake_sdk: Path, tmp_path: Path
) -> None:
    """Its positions are nonsense: it does not know where it is."""

    def switch_on(bench: Bench) -> None:
        bench.set(calibrated=0, mode=RESET, position_m=[0.7, -0.5, 0.9], hand_n=[0.0, 0.0, 0.0], auto_init_us=1000)

    with Lab(fake_sdk, tmp_path / "device", 12000.0, prepare=switch_on) as lab:
        with Subscriber(lab.daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber:
            subscriber.until("hapticd/status", calibrated=False, armed=False, latched=False)
            assert "not been calibrated" in lab.ask("arm")
            assert lab.look().get("moves") == 0
            assert lab.ask("calibrate") == ""
            subscriber.until("hapticd/status", calibrated=True, latched=False, fault_code=0)
        assert lab.ask("arm") == ""
        assert lab.look().get("mode") == FORCE
        assert "not possible" not in lab.daemon.output()


def test_calibration_moves_the_arm_once_it_is_disarmed_and_the_loop_goes_on(lab: Lab) -> None:
    with Subscriber(lab.daemon.endpoint, "hapticd/event", "hapticd/position") as subscriber:
        next(subscriber.maps())
        assert "hapticd disarm" in lab.ask("calibrate")
        assert lab.look().get("moves") == 0
        lab.look().set(hand_n=[0.0, 0.0, 0.0], auto_init_us=300_000)
        assert lab.ask("disarm") == ""
        wait_until(lambda: lab.look().get("mode") == BRAKE, "the ramp to end")
        lab.look().set(calibrated=0)
        assert "not been calibrated" in lab.ask("arm")
        before = subscriber.until("hapticd/position")["seq"]
        assert lab.ask("calibrate") == ""
        begun = subscriber.until("hapticd/event", code=EventCode.CALIBRATING)["seq"]
        ended = subscriber.until("hapticd/event", code=EventCode.CALIBRATED)["seq"]
        assert before < begun < ended - 100
        assert (lab.look().get("moves"), lab.look().get("mode")) == (1, BRAKE)
        assert lab.ask("arm") == ""
        assert lab.look().get("mode") == FORCE


@pytest.mark.parametrize("how", ["disarm", "terminate"])
def test_a_calibration_that_moves_the_arm_ends_when_somebody_disarms_or_stops_the_daemon(lab: Lab, how: str) -> None:
    assert lab.ask("disarm") == ""
    wait_until(lambda: lab.look().get("mode") == BRAKE, "the ramp to end")
    lab.look().set(hand_n=[0.0, 0.0, 0.0], calibrated=0, auto_init_us=600_000_000)
    events = Subscriber(lab.daemon.endpoint, "hapticd/event", "hapticd/timing")
    with events as subscriber, ThreadPoolExecutor(1) as pool:
        subscriber.until("hapticd/timing")
        calibration = pool.submit(lab.ask, "calibrate")
        wait_until(lambda: lab.look().get("moves") == 1, "the arm to move")
        assert "hapticd disarm" in lab.ask("arm")
        if how == "disarm":
            assert lab.ask("disarm") == ""
            assert "called off" in calibration.result(30.0)
            assert "called off" in subscriber.until("hapticd/event", code=EventCode.CALIBRATION_ENDED)["text"]
            assert lab.look().get("mode") == RESET
            assert "not been calibrated" in lab.ask("arm")
        lab.daemon.process.terminate()
        assert lab.daemon.wait_exit() == 0
        pool.shutdown(wait=False, cancel_futures=True)
    assert lab.look().get("mode") == RESET


SIGNALS = pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])


@SIGNALS
def test_a_signal_to_the_command_ends_a_calibration_while_the_arm_moves(lab: Lab, number: int) -> None:
    """Two of them, as impatience sends and a terminal that closes: the second one cut off what the first had asked."""
    assert lab.ask("disarm") == ""
    wait_until(lambda: lab.look().get("mode") == BRAKE, "the ramp to end")
    lab.look().set(hand_n=[0.0, 0.0, 0.0], calibrated=0, auto_init_us=600_000_000)
    command = [HAPTICD, "calibrate", "--countdown", "0"]
    environment = {**os.environ, "HAPTICD_RUNTIME_DIR": f"{lab.daemon.directory}/run"}
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as calibrating:
        wait_until(lambda: lab.look().get("moves") == 1, "the arm to move")
        calibrating.send_signal(number)
        calibrating.send_signal(signal.SIGTERM)
        _, said = calibrating.communicate(timeout=60.0)
    assert (calibrating.returncode, said.splitlines()) == (130, ["calibrating", "called off"])
    wait_until(lambda: "calibrating" not in lab.ask("arm"), "the calibration to end")
    assert lab.look().get("mode") == RESET


@SIGNALS
def test_a_signal_to_the_command_while_it_counts_down_leaves_the_arm_where_it_is(lab: Lab, number: int) -> None:
    assert lab.ask("disarm") == ""
    command = [HAPTICD, "calibrate", "--countdown", "60"]
    environment = {**os.environ, "HAPTICD_RUNTIME_DIR": f"{lab.daemon.directory}/run"}
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as calibrating:
        assert calibrating.stderr is not None
        assert "in 60 s" in calibrating.stderr.readline()
        calibrating.send_signal(number)
        said = calibrating.stderr.read()
    assert (calibrating.returncode, said.splitlines()[-1]) == (130, "called off")
    assert lab.look().get("moves") == 0
