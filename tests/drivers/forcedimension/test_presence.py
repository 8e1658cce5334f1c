"""What is said when the SDK finds nothing, in each state that USB can be in."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import usb.backend
import usb.core

from hapticd.errors import DeviceBusyError, DeviceNotFoundError, DevicePermissionError
from hapticd_drivers.forcedimension import presence
from hapticd_drivers.forcedimension.driver import ForceDimension
from hapticd_drivers.forcedimension.options import ForceDimensionOptions
from hapticd_drivers.forcedimension.presence import Obstacle, UsbDevice
from tests.drivers.forcedimension.bench import Bench

FALCON = (0x0403, 0xCB48)
OMEGA = (0x1451, 0x0402)
SERIAL_ADAPTER = (0x0403, 0x6001)


class Usb(usb.backend.IBackend):  # type: ignore[misc]  # pyusb publishes no types
    """A USB bus of our own, as pyusb's backends show theirs."""

    def __init__(self, *devices: tuple[int, int], kernel_driver: bool = False) -> None:
        self.devices = devices
        self.kernel_driver = kernel_driver

    def enumerate_devices(self) -> Iterator[int]:
        return iter(range(len(self.devices)))

    def get_device_descriptor(self, device: int) -> Any:
        vendor, product = self.devices[device]
        fields = dict.fromkeys(("bLength", "bDescriptorType", "bcdUSB", "bDeviceClass", "bDeviceSubClass"), 0)
        fields |= dict.fromkeys(("bDeviceProtocol", "bMaxPacketSize0", "bcdDevice", "iManufacturer", "iProduct"), 0)
        return SimpleNamespace(
            **fields,
            idVendor=vendor,
            idProduct=product,
            iSerialNumber=0,
            bNumConfigurations=1,
            address=5 + device,
            bus=1,
            port_number=1,
            port_numbers=(1,),
            speed=3,
        )

    def open_device(self, device: int) -> int:
        return device

    def close_device(self, handle: int) -> None:
        pass

    def is_kernel_driver_active(self, handle: int, interface: int) -> bool:
        return self.kernel_driver


@pytest.fixture
def nodes() -> Iterator[Path]:
    """Device nodes of bus 1; not below pytest's own directory, which only its user may enter."""
    with tempfile.TemporaryDirectory() as name:
        directory = Path(name)
        directory.chmod(0o755)
        (directory / "001").mkdir()
        for address in ("005", "006"):
            (directory / "001" / address).touch(0o600)
        yield directory


@pytest.fixture
def nobody(nodes: Path) -> Iterator[None]:
    """This process as a user without rights, for as long as a test takes."""
    if os.geteuid() != 0:
        for node in nodes.glob("*/*"):
            node.chmod(0)
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


def test_nothing_is_plugged_in() -> None:
    error = presence.explain(Usb((0x1D6B, 2))).error()
    assert isinstance(error, DeviceNotFoundError)
    assert "plug it in" in str(error)


@pytest.mark.usefixtures("nobody")
def test_a_falcon_is_found_as_well_and_has_a_rule_of_its_own(nodes: Path) -> None:
    (device,) = presence.look(Usb(SERIAL_ADAPTER, FALCON), nodes)
    assert (device.name, device.number, device.where) == ("a Novint Falcon", "0403:cb48", "001:006")
    error = presence.explain(Usb(FALCON), nodes).error()
    assert isinstance(error, DevicePermissionError)
    assert "a Novint Falcon is on USB (0403:cb48)" in str(error)
    assert 'ATTR{idVendor}=="0403", ATTR{idProduct}=="cb48"' in str(error)
    assert presence.RULE not in str(error)


def test_another_thing_with_the_falcons_usb_chip_is_no_falcon() -> None:
    assert presence.look(Usb(SERIAL_ADAPTER)) == []
    assert "plug it in" in str(presence.explain(Usb(SERIAL_ADAPTER)).error())


@pytest.mark.usefixtures("nobody")
def test_this_user_may_not_open_it_and_the_rule_is_named(nodes: Path) -> None:
    error = presence.explain(Usb(SERIAL_ADAPTER, OMEGA), nodes).error()
    assert isinstance(error, DevicePermissionError)
    assert "1451:0402" in str(error)
    assert str(nodes / "001" / "006") in str(error)
    assert "sudo hapticd service install" in str(error)
    assert presence.RULE in str(error)


def test_another_process_has_it(nodes: Path, tmp_path: Path) -> None:
    process = tmp_path / "proc" / "4242"
    (process / "fd").mkdir(parents=True)
    (process / "comm").write_text("chai3d-demo\n")
    (process / "fd" / "7").symlink_to(nodes / "001" / "005")
    error = presence.explain(Usb(OMEGA), nodes, tmp_path / "proc").error()
    assert isinstance(error, DeviceBusyError)
    assert "process 4242 (chai3d-demo) has it open" in str(error)


def test_a_real_process_that_has_the_node_open_is_found(nodes: Path) -> None:
    """Against the real /proc: a child holds the node."""
    node = nodes / "001" / "005"
    with node.open() as opened, subprocess.Popen(["sleep", "60"], stdin=opened) as child:
        try:
            assert f"process {child.pid} " in str(presence.explain(Usb(OMEGA), nodes).error())
        finally:
            child.kill()


def test_a_kernel_driver_has_it(nodes: Path) -> None:
    error = presence.explain(Usb(OMEGA, kernel_driver=True), nodes).error()
    assert isinstance(error, DeviceBusyError)
    assert "kernel driver" in str(error)


def test_it_is_there_and_free_yet_the_sdk_does_not_see_it(nodes: Path) -> None:
    error = presence.explain(Usb(OMEGA), nodes).error()
    assert isinstance(error, DeviceNotFoundError)
    assert "switch it off and on again" in str(error)


def test_without_libusb_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(**_: object) -> None:
        raise usb.core.NoBackendError("No backend available")

    monkeypatch.setattr(usb.core, "find", none)
    assert "libusb-1.0 is not installed" in presence.explain().text
    assert presence.look() == []


@pytest.fixture
def on_bus(monkeypatch: pytest.MonkeyPatch) -> list[UsbDevice]:
    seen: list[UsbDevice] = []
    monkeypatch.setattr(presence, "look", lambda: seen)
    monkeypatch.setattr(presence, "explain", lambda: Obstacle(DeviceNotFoundError, "why", ("# do this",)))
    return seen


def options(library: Path) -> ForceDimensionOptions:
    return ForceDimensionOptions.model_validate({"library": str(library)})


def test_find_without_the_sdk_still_shows_what_usb_shows(on_bus: list[UsbDevice], tmp_path: Path) -> None:
    assert ForceDimension.find(options(tmp_path)) == []
    on_bus.append(UsbDevice("a Force Dimension device", "1451:0402", "001:005", None))
    (found,) = ForceDimension.find(options(tmp_path))
    assert found.where == "001:005"
    assert "SDK cannot be loaded" in found.problem


def test_find_without_a_device(on_bus: list[UsbDevice], bench: Bench) -> None:
    bench.set(-1, count=0)
    assert ForceDimension.find(options(bench.directory)) == []
    on_bus.append(
        UsbDevice(
            "a Force Dimension device",
            "1451:0402",
            "001:005",
            Obstacle(DevicePermissionError, "may not", ("sudo may",)),
        )
    )
    on_bus.append(UsbDevice("a Force Dimension device", "1451:0402", "001:006", None))
    assert [(found.problem, found.mend) for found in ForceDimension.find(options(bench.directory))] == [
        ("may not", ("sudo may",)),
        (
            "a Force Dimension device is on USB (1451:0402, 001:006) and may be opened, yet the SDK does not find it",
            ("# switch it off and on again; if that does not help, the SDK may be older than the device",),
        ),
    ]


def test_a_device_that_is_held_is_not_put_down_to_another_one_that_this_user_may_not_open(
    on_bus: list[UsbDevice], bench: Bench
) -> None:
    on_bus.append(
        UsbDevice("a Force Dimension device", "1451:0402", "001:005", Obstacle(DevicePermissionError, "may not", ()))
    )
    on_bus.append(UsbDevice("a Force Dimension device", "1451:0402", "001:006", None))
    bench.set(0, holder=1)
    (held,) = ForceDimension.find(options(bench.directory))
    assert held.problem.startswith("another program has the device (")
    assert held.where == ""
    on_bus.insert(
        1,
        UsbDevice(
            "a Force Dimension device",
            "1451:0402",
            "001:007",
            Obstacle(DeviceBusyError, "process 42 has it", ("kill 42",)),
        ),
    )
    (held,) = ForceDimension.find(options(bench.directory))
    assert held.problem.startswith("process 42 has it (")
    assert held.mend == ("kill 42",)


@pytest.mark.usefixtures("on_bus")
def test_find_shows_two_devices_one_of_them_held_and_neither_is_moved_or_kept(bench: Bench) -> None:
    bench.set(-1, count=3)
    bench.set(0, holder=1)
    bench.set(1, calibrated=0)
    held, fresh, ready = ForceDimension.find(options(bench.directory))
    assert "device already in use" in held.problem
    assert (fresh.model, fresh.serial, fresh.problem) == ("omega.7", "1002", "")
    assert "hapticd calibrate" in fresh.note
    assert (ready.model, ready.serial, ready.problem, ready.note) == ("omega.7", "1003", "", "")
    assert [bench.get("holder", device) for device in range(3)] == [1, 0, 0]
    assert sum(bench.get("moves", device) for device in range(3)) == 0


@pytest.mark.usefixtures("on_bus")
def test_find_leaves_a_device_that_this_process_drives_alone(bench: Bench) -> None:
    driver = bench.driver()
    driver.open()
    driver.enable()
    (found,) = ForceDimension.find(options(bench.directory))
    assert found.problem == "in use"
    driver.read()
    driver.write([1.0, 0.0, 0.0])
    assert bench.get("force_n") == 1.0
    driver.close()


def test_a_driver_that_finds_nothing_explains(on_bus: list[UsbDevice], bench: Bench) -> None:
    bench.set(-1, count=0)
    with pytest.raises(DeviceNotFoundError, match="why"):
        bench.driver().open()
    assert on_bus == []
