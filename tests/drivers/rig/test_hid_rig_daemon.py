"""The whole daemon on a rig on USB that is not there, judged from its telemetry and from what the rig does."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections import deque
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from statistics import median

import pytest

from hapticd.tick.event import EventCode
from tests.daemon.running import HAPTICD, PATIENCE_S, Daemon, Subscriber, wait_until
from tests.drivers.resting import DisturbedError, Rest, calmest
from tests.drivers.rig.device import COUNT_M
from tests.drivers.rig.hid_bench import SERIAL, HidDouble, build

STIFFNESS_N_PER_M = 500.0
PRESS_N = 2.0
DEPTH_M = PRESS_N / STIFFNESS_N_PER_M
START_M = 0.002
"""Above the wall, at rest until the hand pushes."""

STALLED_TICKS = 50
HELD_TICKS = 300
LONGEST_TICKS = 10_000
LOOKS = 25
ATTEMPTS = 5
PRESS_S = 10.0
BUSY = {EventCode.LOOP_LATE, EventCode.DEVICE_FROZEN, EventCode.DEVICE_LOST}
"""What this computer brings about when it has no time for the loop or for the rig's double."""

STIFF_N_PER_M = 12000.0
STILL_M = 4.5 * COUNT_M
STIFF_TICKS = 3000

CONFIG = """
[loop]
rate_hz = 1000.0
law_budget = 1.0
[device]
driver = "hid-rig"
[device.options]
sign_checked = true
[[scene.walls]]
axis = "x"
free_side = "positive"
stiffness_n_per_m = {stiffness_n_per_m}
{law}
[safety]
auto_arm = true
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("double"))


@pytest.fixture
def double(program: Path) -> Iterator[HidDouble]:
    made = HidDouble(program)
    made.set("x_m", START_M)
    yield made
    made.close()


@pytest.fixture
def daemon(double: HidDouble) -> Iterator[Daemon]:
    with started(double, STIFFNESS_N_PER_M) as running:
        yield running.wait_ready()


def started(double: HidDouble, stiffness_n_per_m: float, law: str = "") -> Daemon:
    """A daemon that sees the double; no law is the default one."""
    environment = [f"{name}={value}" for name, value in double.environment.items()]
    text = CONFIG.format(stiffness_n_per_m=stiffness_n_per_m, law=f'[controller]\nlaw = "{law}"' if law else "")
    return Daemon(text, prefix=["env", *environment])


def press(double: HidDouble, daemon: Daemon) -> None:
    """Push the handle into the wall; again when this computer was so busy that the loop has let go of it."""
    for _ in range(ATTEMPTS):
        double.set("hand_n", -PRESS_N)
        end_s = time.monotonic() + PRESS_S
        while time.monotonic() < end_s:
            if double.look().force_un > 0.5e6 * PRESS_N:
                return
            time.sleep(0.005)
        let_go_and_arm(double, daemon)
    raise AssertionError(f"the wall did not push in {ATTEMPTS} attempts: {daemon.output()}")


def let_go_and_arm(double: HidDouble, daemon: Daemon) -> None:
    """As a user would: whoever is told of a fault when he arms clears it and arms again."""
    double.set("hand_n", 0.0)
    double.set("x_m", START_M)
    end_s = time.monotonic() + PATIENCE_S
    while refused := daemon.ask("clear") or daemon.ask("arm"):
        assert time.monotonic() < end_s, f"{refused}: {daemon.output()}"
        time.sleep(0.05)


def ticks_of(subscriber: Subscriber, faults: list[int]) -> Iterator[tuple[int, float]]:
    """Number and position [m] of each tick that is published until the device is lost; faults before it are noted."""
    for topic, fields in subscriber.maps():
        if topic == "hapticd/event" and 200 <= fields["code"] < 300:
            faults.append(fields["code"])
            if fields["code"] == EventCode.DEVICE_LOST:
                return
        if topic == "hapticd/position":
            yield fields["seq"], fields["position_m"][0]
    raise AssertionError("no ticks any more")


def test_a_wall_holds_the_hand_and_the_rig_agrees_where(double: HidDouble, daemon: Daemon) -> None:
    """Without the wall the hand would have the handle at the end of its travel, 49.5 mm below."""
    held: deque[float] = deque(maxlen=HELD_TICKS)
    for _ in range(ATTEMPTS):
        press(double, daemon)
        faults: list[int] = []
        with Subscriber(daemon.endpoint, "hapticd/position", "hapticd/event") as subscriber:
            for _, position_m in islice(ticks_of(subscriber, faults), LONGEST_TICKS):
                held.append(position_m)
                still = len(held) == HELD_TICKS and max(held) - min(held) < 2e-4
                if still and min(held) == pytest.approx(-DEPTH_M, rel=0.1):
                    # The law brakes what is left of the motion: one force alone is not yet the balance.
                    looks = [double.look() for _ in range(LOOKS)]
                    for _ in islice(ticks_of(subscriber, faults), HELD_TICKS):
                        pass  # the event of a fault during the looks has come by then
                    if not faults:
                        assert median(look.x_m for look in looks) == pytest.approx(-DEPTH_M, rel=0.15)
                        assert median(look.force_un for look in looks) == pytest.approx(1e6 * PRESS_N, rel=0.15)
                        return
                if faults:
                    break
        assert set(faults) <= BUSY, f"{min(held)} to {max(held)} m: {daemon.output()}"
        let_go_and_arm(double, daemon)
    raise AssertionError(f"the wall did not hold: {min(held)} to {max(held)} m: {daemon.output()}")


@pytest.mark.parametrize(("law", "still"), [("", True), ("none", False)])
def test_the_default_law_holds_a_stiff_wall_that_shakes_without_one(double: HidDouble, law: str, still: bool) -> None:
    rest = calmest_pressed(double, law, still)
    if still:
        assert rest.swing_m < STILL_M
        assert rest.mean_m == pytest.approx(-PRESS_N / STIFF_N_PER_M, abs=5e-5)
    else:
        assert rest.swing_m > 5.0 * STILL_M


def calmest_pressed(double: HidDouble, law: str, still: bool) -> Rest:
    """The calmest half second of a handle that a hand presses into the wall; anew where the loop was disturbed.

    Args:
        double: of the rig.
        law: its name; empty for the default.
        still: whether it is to rest, so that a handle that does not though the link was disturbed says nothing.
    """
    said = []
    for _ in range(ATTEMPTS):
        double.set("hand_n", 0.0)
        double.set("x_m", START_M)
        double.set("frames", 1)
        with started(double, STIFF_N_PER_M, law) as daemon:
            try:
                press(double, daemon.wait_ready())
                rest = calmest(daemon.endpoint, STIFF_TICKS, STILL_M)
                if not (still and rest.disturbed):
                    return rest
                said.append(str(rest))
            except (DisturbedError, AssertionError) as disturbed:
                said.append(str(disturbed))
    raise AssertionError(said)


def test_a_write_that_stalls_costs_the_loop_no_tick_and_the_rig_its_force(double: HidDouble, daemon: Daemon) -> None:
    """The loop ticks on, sees that nothing new comes from the rig, and lets go; it takes a user to go on."""
    for _ in range(ATTEMPTS):
        press(double, daemon)
        with Subscriber(daemon.endpoint, "hapticd/position", "hapticd/event", "hapticd/status") as subscriber:
            # it is connected, and hears of any fault from now on
            if subscriber.until("hapticd/status")["armed"] and stall(double, subscriber):
                break
        let_go_and_arm(double, daemon)  # this computer was so busy that the loop has let go by itself
    else:
        raise AssertionError(f"not armed after {ATTEMPTS} attempts: {daemon.output()}")
    wait_until(lambda: double.look().force_un == 0, "the rig to be without force")
    let_go_and_arm(double, daemon)
    press(double, daemon)


def stall(double: HidDouble, subscriber: Subscriber) -> bool:
    """Delay a write until the loop notices, and take the hand away while it waits.

    Returns:
        False where it was held for longer than a disable waits for its answer: then the loop gave the rig up.
    """
    double.tell("hold")
    held = double.look().sequence
    faults: list[int] = []
    ticks = ticks_of(subscriber, faults)
    for _ in ticks:
        if faults:
            break
    for _ in islice(ticks, STALLED_TICKS):
        pass
    assert double.look().sequence == held, "the write was not held"
    double.set("hand_n", 0.0)
    double.tell("release")
    assert faults, "nothing was noticed"
    assert set(faults) <= BUSY
    return EventCode.DEVICE_LOST not in faults


def test_an_unplugged_rig_is_lost_and_comes_back_with_its_wall(double: HidDouble, daemon: Daemon) -> None:
    press(double, daemon)
    with Subscriber(daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber:
        subscriber.until("hapticd/status")  # it is connected
        double.tell("unplug")
        lost = subscriber.until("hapticd/event", code=EventCode.DEVICE_LOST)
        assert "/dev/hidraw0 is gone" in lost["text"]
        double.set("hand_n", 0.0)
        double.set("x_m", START_M)
        double.plug()
        subscriber.until("hapticd/event", code=EventCode.DEVICE_FOUND)
    press(double, daemon)


def test_sigterm_leaves_the_rig_without_force(double: HidDouble, daemon: Daemon) -> None:
    press(double, daemon)
    daemon.process.terminate()
    assert daemon.wait_exit() == 0
    assert double.look().force_un == 0


def test_a_loop_that_is_killed_leaves_the_rig_without_force(double: HidDouble, daemon: Daemon) -> None:
    """Its watchdog is far away here: it is the supervisor's helper that says hello to it and so takes the force."""
    press(double, daemon)
    os.kill(daemon.control_pid(), signal.SIGKILL)
    assert daemon.wait_exit() == 1
    assert double.look().force_un == 0
    assert "the device is without force" in daemon.output()


def test_a_user_finds_the_rig_and_the_doctor_does(double: HidDouble, tmp_path: Path) -> None:
    config = tmp_path / "lab.toml"
    config.write_text('[device]\ndriver = "hid-rig"\n')
    for command in (["devices", "hid-rig"], ["doctor", "--config", str(config), "--no-latency"]):
        told = subprocess.run(
            [HAPTICD, *command],
            env={**os.environ, **double.environment, "COLUMNS": "200"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert "host-rig" in told.stdout, told.stderr
        assert SERIAL in told.stdout
        assert "/dev/hidraw0" in told.stdout
