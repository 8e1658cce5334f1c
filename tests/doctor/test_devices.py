"""What the doctor says of devices, their drivers, neighbours on USB and rules."""

from __future__ import annotations

import inspect
from pathlib import Path

import pytest

from hapticd import discovery, plugins
from hapticd.config.loading import load
from hapticd.config.models import LoopConfig
from hapticd.device import FoundDevice
from hapticd.discovery import Discovery, look
from hapticd.doctor import driver, endpoints, rules, usb
from hapticd.doctor.configuration import Wanted
from hapticd.doctor.examination import Examination
from hapticd.doctor.finding import examine
from hapticd.driver import Driver, DriverOptions
from hapticd.paths import directory
from hapticd_drivers.rig.serial_rig import SerialRigOptions
from tests.doctor.machine import Machine, says
from tests.drivers.plugin import install

# -- on the bus


def test_a_camera_on_the_same_controller_disturbs(machine: Machine) -> None:
    machine.usb("1-2", "1451", "0402")
    machine.usb("1-3", "046d", "0825", name="Webcam", interface_class="0e")
    machine.usb("1-4", "046d", "c077", name="Mouse", interface_class="03")
    found = says(usb.controller(["001:002"], machine.root), "advice", "0000:00:14.0", "Webcam (video)")
    assert "Mouse" not in found.text


def test_a_camera_on_another_controller_does_not(machine: Machine) -> None:
    machine.usb("1-2", "1451", "0402")
    machine.usb("3-1", "046d", "0825", controller="0000:03:00.0", interface_class="0e")
    says(usb.controller(["001:002"], machine.root), "ok", "port 1-2: nothing greedy on 0000:00:14.0")


def test_two_buses_of_one_controller_are_one_controller(machine: Machine) -> None:
    """A USB 3 controller shows a bus for each speed."""
    machine.usb("1-2", "1451", "0402")
    machine.usb("2-1", "0bda", "0316", name="Disk", interface_class="08")
    says(usb.controller(["001:002"], machine.root), "advice", "Disk (a disk)")


@pytest.mark.parametrize(
    ("kind", "node"), [("hidraw", "hidraw3"), ("tty", "ttyACM0"), ("tty", "ttyUSB0"), ("libusb", "")]
)
def test_a_device_is_found_where_its_driver_says_whatever_its_numbers(machine: Machine, kind: str, node: str) -> None:
    path = machine.usb("1-5", "1234", "5678", name="a rig of one's own")
    machine.usb("1-3", "046d", "0825", name="Webcam", interface_class="0e")
    place = "1-5:1.0"
    if node:
        below = path.relative_to(machine.root) / "1-5:1.0" / kind / node
        machine.file(f"{below}/dev", "240:3")
        machine.link(f"{below}/device", path / "1-5:1.0")
        machine.link(f"sys/class/{kind}/{node}", machine.root / below)
        machine.link(f"dev/serial/by-id/usb-{node}", machine.file(f"dev/{node}"))
        place = f"/dev/serial/by-id/usb-{node}" if kind == "tty" else f"/dev/{node}"
    says(usb.controller([place], machine.root), "advice", "port 1-5", "Webcam")


@pytest.mark.parametrize("place", ["", "/dev/ttyS0", "001:009", "9-9:1.0"])
def test_of_a_device_that_is_not_on_usb_nothing_is_said(machine: Machine, place: str) -> None:
    machine.usb("1-2", "1451", "0402")
    machine.file("sys/class/tty/ttyS0/device/id", "PNP0501")
    machine.file("dev/ttyS0")
    says(usb.controller([place], machine.root), "ok", "no device on USB")


# -- what the driver says itself


def looked(driver: str, options: DriverOptions | None = None) -> Discovery:
    (answer,) = look({driver: options})
    return answer


def test_a_driver_that_needs_nothing_is_well() -> None:
    answer = looked("loopback")
    says(driver.needs(answer), "ok", "loopback needs nothing")
    says(driver.devices(answer, 0), "ok", "omega7 model, simulated")


def test_what_the_driver_says_is_what_the_doctor_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, monkeypatch, "diagnose(cls, options=None): return [Diagnosis('problem', 'no lib', ('get',))]")
    says(driver.needs(looked("odd")), "problem", "no lib")


@pytest.mark.parametrize("body", ["raise ValueError('odd')", "os.abort()", "return 1"])
def test_a_driver_that_cannot_say_is_no_finding_about_the_computer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str
) -> None:
    install(tmp_path, monkeypatch, f"diagnose(cls, options=None): {body}", f"find(cls, options=None): {body}")
    answer = looked("odd")
    says(driver.needs(answer), "unknown", "odd: ")
    says(driver.devices(answer, 0), "unknown", "odd did not look")


def test_a_rig_is_looked_for_where_its_options_say(tmp_path: Path) -> None:
    """A port that is not on USB is as good as any, when the configuration names it."""
    node = tmp_path / "ttyS0"
    node.touch()
    says(driver.devices(looked("serial-rig", SerialRigOptions(port=str(node))), 0), "ok", f"({node})", "whether it is")
    node.unlink()
    found = says(driver.devices(looked("serial-rig", SerialRigOptions(port=str(node))), 0), "problem", "no device")
    assert found.mend[0].startswith("# plug the rig in")


CONFIGURED = ("omega7", "falcon", "serial-rig", "hapkit", "hid-rig", "moteus", "odrive", "inverse3")
"""Shipped configurations, one a device."""


@pytest.mark.parametrize("name", CONFIGURED)
def test_the_doctor_knows_every_device_that_a_configuration_is_shipped_for(name: str) -> None:
    """Whatever is plugged in here: each looks, and each problem comes with what to do."""
    loaded = load(directory("config") / f"{name}.toml")
    answer = looked(loaded.config.device.driver, loaded.options)
    assert answer.problem == ""
    found = [*driver.needs(answer), *driver.devices(answer, 0)]
    assert not [one for one in found if one.mark == "unknown"]
    assert [one.text for one in found if one.mark == "problem" and not one.mend] == []


def test_every_driver_of_ours_looks_and_diagnoses_by_itself() -> None:
    for name in {load(directory("config") / f"{each}.toml").config.device.driver for each in CONFIGURED}:
        own = plugins.driver(name)
        for method in ("find", "diagnose"):
            assert inspect.getattr_static(own, method) is not vars(Driver)[method], f"{name}.{method}"


def test_a_device_that_cannot_be_used_is_a_problem_unless_there_is_another() -> None:
    locked = FoundDevice("rig", "7", "/dev/hidraw0", "this user may not open it", mend=("sudo chmod",))
    busy = FoundDevice("rig", "8", problem="another program has it open")
    free = FoundDevice("rig", "9", note="not calibrated")
    alone = says(
        driver.devices(Discovery("hid-rig", (locked,)), 0), "problem", "rig 7 (/dev/hidraw0): this user may not"
    )
    assert alone.mend == ("sudo chmod",)
    first, second, third = driver.devices(Discovery("hid-rig", (locked, busy, free)), 0)
    says(first, "advice", "rig 7")
    assert "devices hid-rig" in says(second, "advice", "rig 8: another program").mend[0]
    says(third, "ok", "rig 9: not calibrated")


def test_a_driver_that_cannot_look_is_no_problem() -> None:
    """Looking is optional; that it found nothing would then be a claim about nothing."""
    says(driver.devices(Discovery("odd", looks=False), 0), "unknown", "odd cannot look")


def test_beside_the_daemon_nothing_is_looked_for(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def note(drivers: dict[str, DriverOptions | None], *, find: bool) -> list[Discovery]:
        asked.append(find)
        return [Discovery(name) for name in drivers]

    monkeypatch.setattr(endpoints, "running", lambda *_: 4711)
    monkeypatch.setattr(discovery, "look", note)
    wanted = Wanted(Path("lab.toml"), LoopConfig(), "hid-rig", {})
    checks = {check.name: check for check in Examination(wanted, "default", machine.root).checks()}
    says(examine(checks["driver.devices"]), "ok", "running daemon")
    says(examine(checks["usb.controller"]), "ok")
    assert asked == [False]


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
