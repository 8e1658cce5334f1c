"""Which CAN interfaces are found, and what is said where it is not clear which is meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from hapticd_drivers.motors import link
from hapticd_drivers.motors.link import AUTO
from hapticd_drivers.odrive.driver import Odrive, OdriveOptions
from tests.drivers.odrive.lab import axes

CAN, ETHERNET = 280, 1
"""What the kernel says of an interface in its `type`."""


def options(channel: str) -> OdriveOptions:
    """One motor behind this channel."""
    return OdriveOptions.model_validate({"channel": channel, "axes": axes(1, homing="absolute")})


def interfaces(sysfs: Path, monkeypatch: pytest.MonkeyPatch, **kinds: int) -> None:
    """Let the kernel have these network interfaces, all of them up."""
    monkeypatch.setattr(link, "_SYSFS", sysfs)
    for name, kind in kinds.items():
        (sysfs / name).mkdir()
        (sysfs / name / "type").write_text(f"{kind}\n")
        (sysfs / name / "flags").write_text("0x40081\n")


def test_every_can_interface_is_listed_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    interfaces(tmp_path, monkeypatch, can1=CAN, eth0=ETHERNET, can0=CAN)
    found = Odrive.find()
    assert [(each.where, each.problem) for each in found] == [("can0", ""), ("can1", "")]
    assert [each.where for each in Odrive.find(options("can1"))] == ["can1"]


def test_an_interface_that_is_down_comes_with_the_line_that_brings_it_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    interfaces(tmp_path, monkeypatch, can0=CAN)
    (tmp_path / "can0" / "flags").write_text("0x40080\n")
    (found,) = Odrive.find()
    assert (found.problem, found.mend[0].startswith("sudo ip link set can0 up type can bitrate 1000000")) == (
        "it is down",
        True,
    )


def test_an_adapter_is_found_on_the_port_that_the_configuration_names(tmp_path: Path) -> None:
    port = tmp_path / "usb-CANable"
    assert Odrive.find(options(str(port))) == []
    port.touch()
    (found,) = Odrive.find(options(str(port)))
    assert (found.model, found.where, found.problem) == ("slcan adapter", str(port), "")


def test_two_interfaces_are_a_problem_only_for_a_configuration_that_does_not_say_which(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    interfaces(tmp_path, monkeypatch, can0=CAN, can1=CAN)
    (problem,) = Odrive.diagnose(options(AUTO))
    assert problem.mark == "problem"
    assert "can0, can1" in problem.text
    assert "channel" in problem.mend[0]
    assert Odrive.diagnose(options("can1")) == []
    assert Odrive.diagnose() == []


def test_without_an_interface_there_is_nothing_to_say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    interfaces(tmp_path, monkeypatch, eth0=ETHERNET)
    assert Odrive.find() == []
    assert Odrive.diagnose(options(AUTO)) == []
