"""An adapter that is plugged in and has no port: said by the driver, so that doctor and `hapticd devices` show it."""

from __future__ import annotations

from pathlib import Path

import pytest
from serial.tools import list_ports

from hapticd.device import Diagnosis
from hapticd_drivers.rig import serial_adapters
from hapticd_drivers.rig.serial_rig import SerialRig


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A computer without a serial port; `usb` and `rules` are its USB devices and udev rules."""
    for name in ("usb", "rules"):
        (tmp_path / name).mkdir()
    monkeypatch.setattr(serial_adapters, "USB", tmp_path / "usb")
    monkeypatch.setattr(serial_adapters, "RULES", (tmp_path / "rules", tmp_path / "no-such-place"))
    monkeypatch.setattr(list_ports, "comports", lambda: [])
    return tmp_path


def plug(machine: Path, vendor: str, product: str) -> None:
    device = machine / "usb" / f"1-{product}"
    device.mkdir()
    (device / "idVendor").write_text(f"{vendor}\n")
    (device / "idProduct").write_text(f"{product}\n")
    (machine / "usb" / f"1-{product}:1.0").mkdir()  # its interface


def told() -> list[Diagnosis]:
    return SerialRig.diagnose()


@pytest.mark.parametrize(
    ("vendor", "product", "name"), [("1a86", "7523", "CH340"), ("10c4", "ea60", "CP2102"), ("0403", "6001", "FT232R")]
)
def test_an_adapter_that_brltty_has_taken_is_named_with_the_way_out(
    machine: Path, vendor: str, product: str, name: str
) -> None:
    """Ubuntu 22.04 ships it: the port of the rig is there for a moment after plugging in, and vanishes."""
    plug(machine, vendor, product)
    (machine / "rules" / "85-brltty.rules").touch()
    (said,) = told()
    assert (said.mark, said.mend) == ("problem", ("sudo apt remove brltty  # then replug the rig",))
    assert said.text.startswith(f"a {name} is on USB ({vendor}:{product}) and has no port: brltty takes it")


def test_without_brltty_it_is_the_kernels_driver_that_is_missing(machine: Path) -> None:
    plug(machine, "1a86", "7523")
    (said,) = told()
    assert said.mark == "problem"
    assert said.mend[0].startswith("sudo modprobe ch341")


def test_nothing_is_said_of_other_devices_nor_of_an_adapter_that_has_its_port(machine: Path) -> None:
    plug(machine, "046d", "c077")
    (machine / "rules" / "85-brltty.rules").touch()
    assert told() == []
    plug(machine, "1a86", "7523")
    assert serial_adapters.without_port(["1a86:7523"]) == []


def test_a_computer_that_shows_no_usb_says_nothing(machine: Path) -> None:
    (machine / "usb").rmdir()
    assert told() == []
