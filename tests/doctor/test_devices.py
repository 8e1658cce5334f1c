"""What the doctor says of devices, their nodes, drivers, neighbours, libraries and rules."""

from __future__ import annotations

from pathlib import Path

import pytest

from hapticd.doctor import driver, rules, usb
from hapticd.share import directory
from tests.doctor.machine import Machine, says
from tests.drivers.plugin import install


@pytest.fixture
def stranger(monkeypatch: pytest.MonkeyPatch) -> None:
    """A user who may open nothing."""
    monkeypatch.setattr("os.access", lambda *_: False)


# -- on the bus


def test_a_computer_without_usb_is_well_while_nothing_needs_it(machine: Machine) -> None:
    says(usb.devices("loopback", machine.root), "ok", "no USB")
    says(usb.devices("omega7", machine.root), "problem", "none is on the bus")


@pytest.mark.parametrize("product", ["0402", "0301"])
def test_force_dimension_is_told_by_its_vendor_alone(machine: Machine, product: str) -> None:
    machine.usb("1-2", "1451", product, name="omega.x haptic device")
    says(usb.devices("omega7", machine.root), "ok", "omega.x haptic device", "port 1-2", "/dev/bus/usb/001/002")


@pytest.mark.usefixtures("stranger")
def test_a_device_that_this_user_may_not_open_is_a_matter_of_rules(machine: Machine) -> None:
    machine.usb("1-2", "1451", "0402")
    found = says(usb.devices("omega7", machine.root), "problem", "may not open /dev/bus/usb/001/002")
    assert "service install" in found.mend[0]
    assert "replug" in found.mend[1]


def test_a_device_without_a_node_is_in_a_container(machine: Machine) -> None:
    machine.usb("1-2", "1451", "0402", node=False)
    assert "container" in says(usb.devices("omega7", machine.root), "problem", "without a node").mend[0]


@pytest.mark.usefixtures("stranger")
def test_a_device_that_is_not_configured_is_named_and_no_problem(machine: Machine) -> None:
    machine.usb("1-2", "0403", "cb48", name="Falcon")
    machine.usb("1-3", "0403", "6001", name="some other FTDI chip")
    machine.usb("1-4", "2988", "0302")
    falcon, touch = usb.devices("loopback", machine.root)
    says(falcon, "ok", "Falcon", "not the configured one", "falcon")
    says(touch, "ok", "3D Systems Touch", "no driver")


def rig(machine: Machine, *, node: bool = True, bound: str = "usbhid") -> None:
    path = machine.usb("1-5", "16c0", "0486", name="Teensy", bound=bound)
    hidraw = path.relative_to(machine.root) / "1-5:1.0/0003:16C0:0486.0001/hidraw/hidraw3"
    machine.file(f"{hidraw}/dev", "240:3")
    if node:
        machine.file("dev/hidraw3")


def test_a_rig_is_reached_through_its_hidraw_node(machine: Machine) -> None:
    rig(machine)
    says(usb.devices("hid-rig", machine.root), "ok", "Teensy", "/dev/hidraw3")


def test_a_rig_without_usbhid_is_bound_by_hand(machine: Machine) -> None:
    rig(machine, node=False, bound="")
    for found in (usb.devices("hid-rig", machine.root), usb.kernel_drivers("hid-rig", machine.root)):
        assert "echo 1-5:1.0" in says(found, "problem").mend[0]


@pytest.mark.parametrize(
    ("bound", "mark", "word"), [("", "ok", "none"), ("ftdi_sio", "ok", "detaches"), ("usbfs", "advice", "open already")]
)
def test_whoever_holds_the_device_is_named(machine: Machine, bound: str, mark: str, word: str) -> None:
    machine.usb("1-2", "0403", "cb48", bound=bound)
    found = says(usb.kernel_drivers("falcon", machine.root), mark, word)
    if mark == "advice":
        assert found.mend == ("sudo fuser -v /dev/bus/usb/001/002",)


def test_a_camera_on_the_same_controller_disturbs(machine: Machine) -> None:
    machine.usb("1-2", "1451", "0402")
    machine.usb("1-3", "046d", "0825", name="Webcam", interface_class="0e")
    machine.usb("1-4", "046d", "c077", name="Mouse", interface_class="03")
    found = says(usb.controller("omega7", machine.root), "advice", "0000:00:14.0", "Webcam (video)")
    assert "Mouse" not in found.text


def test_a_camera_on_another_controller_does_not(machine: Machine) -> None:
    machine.usb("1-2", "1451", "0402")
    machine.usb("3-1", "046d", "0825", controller="0000:03:00.0", interface_class="0e")
    says(usb.controller("omega7", machine.root), "ok", "nothing greedy on 0000:00:14.0")


def test_two_buses_of_one_controller_are_one_controller(machine: Machine) -> None:
    """A USB 3 controller shows a bus for each speed."""
    machine.usb("1-2", "1451", "0402")
    machine.usb("2-1", "0bda", "0316", name="Disk", interface_class="08")
    says(usb.controller("omega7", machine.root), "advice", "Disk (a disk)")


@pytest.mark.parametrize("look", [usb.kernel_drivers, usb.controller])
def test_of_a_device_that_is_not_there_nothing_is_said(machine: Machine, look: object) -> None:
    assert callable(look)
    says(look("omega7", machine.root), "ok", "not there")
    says(look("loopback", machine.root), "ok", "not needed")


# -- serial ports


def port(machine: Machine, name: str, latency_ms: str = "") -> None:
    machine.file(f"sys/class/tty/{name}/dev", "188:0")
    machine.file("sys/class/tty/ttyS0/dev", "4:64")
    machine.file(f"dev/{name}")
    if latency_ms:
        machine.file(f"sys/bus/usb-serial/devices/{name}/latency_timer", latency_ms)


def test_a_serial_rig_needs_a_port_on_usb(machine: Machine) -> None:
    machine.file("sys/class/tty/ttyS0/dev", "4:64")
    says(usb.devices("serial-rig", machine.root), "problem", "no serial port")


@pytest.mark.parametrize(("latency_ms", "mark"), [("", "ok"), ("1", "ok"), ("16", "advice")])
def test_an_adapter_that_keeps_bytes_back_is_told_not_to(machine: Machine, latency_ms: str, mark: str) -> None:
    port(machine, "ttyUSB0", latency_ms)
    says(usb.devices("serial-rig", machine.root), mark, "/dev/ttyUSB0")


@pytest.mark.usefixtures("stranger")
def test_a_port_belongs_to_dialout(machine: Machine) -> None:
    port(machine, "ttyACM1")
    assert "dialout" in says(usb.devices("serial-rig", machine.root), "problem", "/dev/ttyACM1").mend[0]


# -- libraries


def test_libusb_is_looked_for_by_those_who_load_it(machine: Machine) -> None:
    says(usb.library("loopback", machine.root), "ok", "not needed")
    assert "apt install libusb" in says(usb.library("omega7", machine.root), "problem").mend[0]
    machine.file("usr/lib/x86_64-linux-gnu/libusb-1.0.so.0")
    says(usb.library("omega7", machine.root), "ok", "/usr/lib/x86_64-linux-gnu")


# -- what the driver says itself


def test_a_driver_that_needs_nothing_is_well() -> None:
    says(driver.needs("loopback", None), "ok", "loopback needs nothing")


def test_what_the_driver_says_is_what_the_doctor_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, monkeypatch, "diagnose(cls, options=None): return [Diagnosis('problem', 'no lib', ('get',))]")
    says(driver.needs("odd", None), "problem", "no lib")


@pytest.mark.parametrize("body", ["raise ValueError('odd')", "os.abort()", "return 1"])
def test_a_driver_that_cannot_say_is_no_finding_about_the_computer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str
) -> None:
    install(tmp_path, monkeypatch, f"diagnose(cls, options=None): {body}")
    says(driver.needs("odd", None), "unknown", "odd: ")


# -- rules


@pytest.mark.parametrize(("driver", "mark"), [("loopback", "ok"), ("omega7", "advice")])
def test_a_missing_rule_matters_to_real_devices(machine: Machine, driver: str, mark: str) -> None:
    says(rules.installed(driver, machine.root), mark, "not installed")


def test_an_installed_rule_is_compared(machine: Machine) -> None:
    (rule,) = directory("drivers/udev").glob("*.rules")
    place = f"usr/local/lib/udev/rules.d/{rule.name}"
    machine.file(place, rule.read_text().strip())
    says(rules.installed("omega7", machine.root), "ok", place)
    machine.file(place, "# an older one")
    assert "service install" in says(rules.installed("omega7", machine.root), "advice", "not the one").mend[0]
