"""Which adapters are found, and what is said where it is not clear which is meant."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from hapticd_drivers.moteus import driver as moteus_driver
from hapticd_drivers.moteus.driver import Moteus
from hapticd_drivers.motors import adapters, link
from hapticd_drivers.motors.link import AUTO
from tests.drivers.moteus.lab import options


class Port(SimpleNamespace):
    """A port as pyserial lists it."""

    def __lt__(self, other: Port) -> bool:
        return bool(self.device < other.device)


def ports(monkeypatch: pytest.MonkeyPatch, *found: Port, interfaces: tuple[str, ...] = ()) -> None:
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: list(found))
    monkeypatch.setattr(moteus_driver, "can_interfaces", lambda: list(interfaces))
    monkeypatch.setattr(adapters, "is_up", lambda _: True)
    monkeypatch.setattr(adapters, "carries_fd", lambda _: True)


NEWER = Port(device="/dev/ttyACM1", vid=0x1209, pid=0x2323, serial_number="B2", product="mjcanfd-usb-1x")
OLDER = Port(device="/dev/ttyACM0", vid=0x0483, pid=0x5740, serial_number="A1", product="fdcanusb")
BOARD = Port(device="/dev/ttyACM2", vid=0x0483, pid=0x5740, serial_number="C3", product="STM32 Virtual ComPort")


def test_adapters_of_the_maker_and_interfaces_are_listed_and_other_boards_are_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ports(monkeypatch, NEWER, OLDER, BOARD, interfaces=("can0",))
    found = Moteus.find()
    assert [(each.where, each.serial) for each in found] == [
        ("/dev/ttyACM0", "A1"),
        ("/dev/ttyACM1", "B2"),
        ("can0", ""),
    ]
    assert found[-1].problem == ""
    assert [each.where for each in Moteus.find(options("can0"))] == ["can0"]


@pytest.mark.parametrize(("flags", "mtu", "problem"), [("0x40080", 16, "it is down"), ("0x40081", 16, "CAN-FD")])
def test_an_interface_that_is_down_or_without_can_fd_comes_with_the_lines_that_mend_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, flags: str, mtu: int, problem: str
) -> None:
    place = tmp_path / "can0"
    place.mkdir()
    for name, value in {"type": "280", "flags": flags, "mtu": mtu}.items():
        (place / name).write_text(f"{value}\n")
    monkeypatch.setattr("serial.tools.list_ports.comports", list)
    monkeypatch.setattr(link, "_SYSFS", tmp_path)
    (found,) = Moteus.find()
    assert problem in found.problem
    assert "sudo ip link set can0 up" in found.mend[-1]
    assert found.mend[-1].endswith("fd on")
    (place / "flags").write_text("0x40081\n")
    (place / "mtu").write_text("72\n")
    assert [each.problem for each in Moteus.find()] == [""]


def test_an_adapter_is_found_under_whatever_name_the_configuration_has_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such as the one of /dev/serial/by-id, which the page recommends."""
    ports(monkeypatch)
    port = tmp_path / "usb-mjbots_fdcanusb"
    assert Moteus.find(options(str(port))) == []
    port.touch()
    (found,) = Moteus.find(options(str(port)))
    assert (found.model, found.where, found.problem) == ("fdcanusb", str(port), "")


def test_two_adapters_are_a_problem_only_for_a_configuration_that_does_not_say_which(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ports(monkeypatch, NEWER, OLDER)
    (problem,) = Moteus.diagnose(options(AUTO))
    assert problem.mark == "problem"
    assert "/dev/ttyACM0, /dev/ttyACM1" in problem.text
    assert Moteus.diagnose(options("/dev/ttyACM0")) == []
    ports(monkeypatch)
    assert Moteus.diagnose(options(AUTO)) == []
