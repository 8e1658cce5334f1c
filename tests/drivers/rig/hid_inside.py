"""What the driver `hid-rig` does on a rig that is not there: run by test_hid_rig.py in a process that can see it."""

from __future__ import annotations

import random
import struct
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from hapticd.driver import DriverState
from hapticd.errors import (
    DeviceBusyError,
    DeviceDisconnectedError,
    DeviceFaultError,
    DeviceNotFoundError,
    DeviceTimeoutError,
    DriverError,
    DriverStateError,
)
from hapticd.testing.driver_contract import AnyDriver, DriverContract
from hapticd_drivers.rig import messages
from hapticd_drivers.rig.hid_rig import HidRig
from hapticd_drivers.rig.metrics import DAMAGED, UNSENT
from tests.daemon.running import wait_until
from tests.drivers.rig.hid_bench import HAS_HOME_SWITCH, SERIAL, HidDouble, build

STALLED_TICKS = 50
PAGE = Path(__file__).parents[3] / "docs" / "hid-rig.md"


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("double"))


@pytest.fixture
def double(program: Path) -> Iterator[HidDouble]:
    made = HidDouble(program)
    yield made
    made.close()


@pytest.fixture
def driver(double: HidDouble) -> Iterator[HidRig]:
    made = double.driver()
    yield made
    made.close()


@pytest.fixture
def enabled(driver: HidRig) -> HidRig:
    driver.open()
    driver.enable()
    return driver


def outboxes() -> int:
    """Threads of drivers that are there now."""
    return sum(thread.name == "hid-rig-outbox" for thread in threading.enumerate())


def tick(driver: HidRig, ticks: int, pause_s: float = 0.0) -> None:
    """Do as the loop does."""
    for _ in range(ticks):
        driver.write([0.1])
        driver.read()
        time.sleep(pause_s)


def ticked(driver: HidRig) -> HidRig:
    tick(driver, 1, 1e-3)
    return driver


@pytest.mark.parametrize(("axes", "backend"), [(1, "hidraw"), (3, "hidraw"), (1, "libusb")])
class TestHidRig(DriverContract):
    @pytest.fixture
    def driver(self, program: Path, axes: int, backend: str) -> Iterator[AnyDriver]:
        self.double = HidDouble(program, axes)
        made = self.double.driver(backend=backend)
        yield made
        made.close()
        self.double.close()

    def force_on_device(self, driver: AnyDriver) -> Sequence[float]:
        self.double.catch_up(driver)
        return [1e-6 * self.double.look(axis).force_un for axis in range(len(driver.info.axes))]


def test_it_is_found_by_its_numbers_and_says_what_it_is(double: HidDouble, driver: HidRig) -> None:
    (found,) = driver.find()
    assert (found.model, found.serial, found.where, found.problem) == ("host-rig", SERIAL, "/dev/hidraw0", "")
    assert double.look().sequence == -1, "finding it has said something to it"
    info = driver.open()
    assert info.max_force_n == pytest.approx(5.0)
    assert info.resolution_m == pytest.approx(7.669904e-6)
    assert info.host_silence_ms == 5000.0
    with pytest.raises(DeviceNotFoundError, match=f'"7"; there is {SERIAL} \\(/dev/hidraw0\\)'):
        double.driver(serial="7").open()
    with pytest.raises(DeviceNotFoundError, match="1234:5678"):
        double.driver(vendor_id=0x1234, product_id=0x5678).open()
    with pytest.raises(DeviceNotFoundError, match="0xffac"):
        double.driver(usage_page=0xFFAC).open()


def test_a_second_program_is_kept_away_while_one_has_the_rig(double: HidDouble, enabled: HidRig) -> None:
    before = double.look().sequence
    with pytest.raises(DeviceBusyError):
        double.driver().open()
    (found,) = enabled.find()
    assert "another program" in found.problem
    assert double.look().sequence == before
    enabled.close()
    another = double.driver()
    another.open()
    another.close()


def test_a_read_gives_the_newest_of_many_states(double: HidDouble) -> None:
    behind = 30
    driver = double.driver()
    driver.open()
    driver.enable()
    driver.write([0.0])
    double.catch_up(driver)
    before = driver.read().sequence
    for ahead in range(1, behind + 1):
        double.set("x_m", 1e-3 * ahead)
        driver.write([0.0])
        double.catch_up(driver)
    reads = 1
    while (sample := driver.read()).sequence < before + behind:
        reads += 1
    assert reads < behind / 2
    assert sample.sequence == before + behind
    assert sample.position_m[0] == pytest.approx(1e-3 * behind, abs=1e-5)
    driver.close()


def test_a_write_that_stalls_costs_no_tick(double: HidDouble, enabled: HidRig) -> None:
    """While the kernel holds one write, every read and write of the loop returns; then only the newest force goes.

    Which force is held depends on when the outbox gets the processor; that one is held and one is newest does not.
    """
    enabled.read()
    double.catch_up(enabled)
    double.forces_un()
    double.tell("hold")
    ticks = 0
    while ticks < STALLED_TICKS:
        enabled.read()
        enabled.write([0.01 * ticks])
        ticks += 1
        time.sleep(1e-3)
    assert double.forces_un() == [], "the write was not held"
    double.tell("release")
    double.catch_up(enabled)
    held, newest = double.forces_un()
    assert held < newest == 10_000 * (STALLED_TICKS - 1)
    enabled.read()
    assert enabled.metrics[UNSENT] == STALLED_TICKS - 2
    wait_until(lambda: enabled.read().sequence and not enabled._silent, "an answer")


def test_a_disable_during_a_stall_is_the_last_thing_that_arrives(double: HidDouble, enabled: HidRig) -> None:
    enabled.write([0.5])
    double.catch_up(enabled)
    assert double.look().force_un == 500_000
    double.tell("hold")
    enabled.write([0.6])
    enabled.write([0.7])
    enabled.disable()
    for _ in range(5):
        enabled.read()
    double.tell("release")
    double.catch_up(enabled)
    assert double.look().force_un == 0
    assert 700_000 not in double.forces_un()


def test_a_write_that_never_returns_keeps_nobody_from_closing(double: HidDouble, enabled: HidRig) -> None:
    double.tell("hold")
    with pytest.raises(DeviceTimeoutError):
        tick(enabled, 1000, 1e-3)
    enabled.close()
    assert outboxes() == 1
    double.tell("release")
    wait_until(lambda: outboxes() == 0, "the thread to end with its write")


def test_an_unplugged_rig_is_lost_and_found_under_another_name(double: HidDouble, enabled: HidRig) -> None:
    enabled.write([0.1])
    double.tell("unplug")
    with pytest.raises(DeviceDisconnectedError, match="/dev/hidraw0 is gone"):
        enabled.read()
    enabled.close()
    assert outboxes() == 0
    with pytest.raises(DeviceNotFoundError):
        enabled.open()
    double.plug()
    enabled.open()
    assert enabled.find()[0].where == "/dev/hidraw1"
    enabled.enable()
    enabled.write([0.1])
    double.catch_up(enabled)
    assert double.look().force_un == 100_000


def test_writing_alone_notices_that_the_rig_is_gone(double: HidDouble, enabled: HidRig) -> None:
    double.tell("unplug")

    def write() -> bool:
        try:
            enabled.write([0.1])
        except DeviceDisconnectedError:
            return True
        return False

    wait_until(write, "a write to fail")


def test_a_rig_that_was_switched_off_and_on_is_a_new_one(double: HidDouble, enabled: HidRig) -> None:
    double.tell("restart")
    with pytest.raises(DeviceDisconnectedError, match="switched off and on"):
        tick(enabled, 1000)
    assert double.look().force_un == 0


def test_silence_trips_the_watchdog_until_somebody_enables_again(double: HidDouble, driver: HidRig) -> None:
    """It is patient except where it is the question, since this computer may be busy for longer than it waits."""
    patient_ms, silence_ms = 5000.0, 20.0
    double.set("silence_ms", silence_ms)
    driver.open()
    double.set("silence_ms", patient_ms)
    driver.enable()
    driver.write([0.5])
    double.catch_up(driver)
    assert double.look().force_un == 500_000
    double.set("silence_ms", silence_ms)
    wait_until(lambda: double.look().force_un == 0, "the watchdog")
    assert double.forces_un() == [500_000]
    with pytest.raises(DeviceFaultError, match="watchdog heard no command for 20 ms"):
        tick(driver, 1000)
    assert double.look().force_un == 0
    double.set("silence_ms", patient_ms)
    driver.disable()
    driver.enable()
    driver.write([0.5])
    double.catch_up(driver)
    assert double.look().force_un == 500_000


def test_a_fault_of_the_rig_says_what_it_is(double: HidDouble, enabled: HidRig) -> None:
    double.tell("break 2 0 77")
    with pytest.raises(DeviceFaultError, match=r"over-current or over-temperature \(axis 0, detail 77\)"):
        tick(enabled, 1000)
    enabled.disable()
    with pytest.raises(DeviceFaultError):
        enabled.enable()
    double.tell("mend")
    enabled.enable()
    assert enabled.state is DriverState.ENABLED


@pytest.mark.parametrize(
    ("name", "line", "kind", "most_ticks", "peak_n"),
    [
        ("encoder fault", "break 1 0 7", DeviceFaultError, 2, 0.0),
        ("motor driver fault", "break 2 0 7", DeviceFaultError, 2, 0.0),
        ("switched off and on", "restart", DeviceDisconnectedError, 2, 0.0),
        ("unplugged", "unplug", DeviceDisconnectedError, 2, 0.0),
        ("the rig says nothing", "set mute 1 0", DeviceTimeoutError, 502, 0.1),
    ],
)
def test_what_goes_wrong_is_named_soon_and_leaves_no_force(
    double: HidDouble, enabled: HidRig, name: str, line: str, kind: type[DriverError], most_ticks: int, peak_n: float
) -> None:
    """The table of docs/hid-rig.md; a millisecond of the rig is a message."""
    double.set("frames", 1)
    enabled._state_wait_s = 0.001 if kind is DeviceTimeoutError else 1.0
    tick(enabled, 25)
    double.catch_up(enabled)
    double.tell(line)
    double.peak_n()
    with pytest.raises(kind):
        tick(enabled, most_ticks)
    assert double.peak_n() == pytest.approx(peak_n)
    assert f"| {name} | {most_ticks} | {peak_n:.2f} |" in PAGE.read_text()


def a_state(position: int) -> bytes:
    """A report with a STATE that is intact and far newer than any."""
    flags = messages.ENABLED | messages.HOMED
    body = struct.pack("<BBHHIBBHii", messages.VERSION, messages.STATE, 20_000, 0, 0, flags, 0, 0, position, 0)
    message = body + messages.checksum(body).to_bytes(2, "little")
    return bytes([len(message)]) + message + bytes(63 - len(message))


@pytest.mark.parametrize("length", [1, 2, 7, 30, 63])
def test_a_short_report_is_damage_whatever_is_in_it(double: HidDouble, enabled: HidRig, length: int) -> None:
    """Even when the whole message is in it: the device has another idea of its reports than the protocol."""
    double.send(a_state(6000)[:length])
    wait_until(lambda: enabled.read() and enabled.metrics[DAMAGED] == 1.0, "the short report")
    assert enabled.read().position_m[0] < 0.01
    enabled.write([0.2])
    double.catch_up(enabled)
    assert double.look().force_un == 200_000


def test_a_long_report_is_cut_and_what_is_beyond_never_read(double: HidDouble, enabled: HidRig) -> None:
    """The kernel gives a reader as much as it asks for and throws the rest of that report away."""
    double.send(bytes([80]) + bytes(range(79)))
    wait_until(lambda: enabled.read() and enabled.metrics[DAMAGED] == 1.0, "the long report")
    before = enabled.read().sequence
    enabled.write([0.0])
    wait_until(lambda: enabled.read().sequence > before, "the next state")
    assert enabled.metrics[DAMAGED] == 1.0


def test_reports_of_noise_move_nothing(double: HidDouble, enabled: HidRig) -> None:
    noise = random.Random(1)
    reports = [noise.randbytes(noise.randint(1, 100)) for _ in range(40)]
    reports += [bytes(64), b"\xff" * 64, b"\x00", b"\x3f" + bytes(63)]

    for count, report in enumerate(reports, 1):
        double.send(report)
        wait_until(lambda: ticked(enabled).metrics[DAMAGED] == count, "the noise to have come")  # noqa: B023 - at once
    assert ticked(enabled).metrics[DAMAGED] == len(reports)
    assert abs(enabled.read().position_m[0]) < 0.01


def test_an_intact_state_would_have_moved_it(double: HidDouble, enabled: HidRig) -> None:
    """What the tests of damaged reports rest on."""
    double.send(a_state(6000))
    wait_until(lambda: enabled.read().position_m[0] > 0.04, "the state")


@pytest.fixture
def through_libusb(double: HidDouble) -> Iterator[HidRig]:
    made = double.driver(backend="libusb")
    yield made
    made.close()  # before the double: umockdev ends a process that still asks for something


def test_libusb_reads_writes_and_loses_it_as_hidraw_does(double: HidDouble, through_libusb: HidRig) -> None:
    driver = through_libusb
    assert "libusb" in driver.open().notes[0]
    driver.enable()
    driver.write([0.1])
    for count, report in enumerate((a_state(6000)[:30], bytes(64)), 1):
        double.send(report)
        wait_until(lambda: ticked(driver).metrics[DAMAGED] == count, "the damage")  # noqa: B023 - called at once
    double.set("x_m", 0.01)
    wait_until(lambda: ticked(driver).read().position_m[0] > 0.009, "the new place")
    double.tell("unplug")
    with pytest.raises(DeviceDisconnectedError, match="is gone"):
        tick(driver, 1000, 1e-3)
    driver.close()
    assert outboxes() == 0
    double.plug()
    driver.open()


def test_it_homes_against_its_lower_stop(double: HidDouble) -> None:
    double.tell("unplug")
    double.set("capabilities", HAS_HOME_SWITCH)
    double.set("x_m", -0.04)
    double.plug()
    driver = double.driver(
        sign_checked=False, calibration_speed_m_per_s=0.1, axes=[{"lowest_m": -0.0495, "highest_m": 0.0495}]
    )
    driver.open()
    with pytest.raises(DriverStateError, match="hapticd calibrate"):
        driver.enable()
    driver.calibrate()
    assert driver.read().position_m[0] == pytest.approx(double.look().x_m, abs=5e-4)
    assert double.look().force_un == 0
    driver.enable()
    driver.close()


def test_a_reversed_motor_is_refused_at_a_harmless_force(double: HidDouble) -> None:
    double.set("motor_sign", -1.0)
    driver = double.driver(sign_checked=False)
    driver.open()
    with pytest.raises(DeviceFaultError, match="pushes the wrong way"):
        driver.calibrate()
    assert max(map(abs, double.forces_un())) <= 500_000
    with pytest.raises(DriverStateError):
        driver.enable()
    driver.close()
