"""Which of several devices is taken, and by which of hidapi's two backends; the lists are made up."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from hapticd.errors import DeviceNotFoundError, DevicePermissionError
from hapticd_drivers.rig import hid_rig_discovery as discovery
from hapticd_drivers.rig.hid_rig_link import HidLink
from hapticd_drivers.rig.hid_rig_options import HidRigOptions

RAW = {"usage_page": 0xFFAB, "usage": 0x0200, "interface_number": 0}
UNSAID = {"usage_page": 0, "usage": 0, "interface_number": 0}
SERIAL_EMULATION = {"usage_page": 0xFFC9, "usage": 0x0004, "interface_number": 1}


class Device:
    """Hidapi's handle; whatever is in `refuses` raises."""

    refuses = ""

    def open_path(self, path: bytes) -> None:
        if self.refuses:
            raise OSError(self.refuses)

    def set_nonblocking(self, _: int) -> None: ...
    def close(self) -> None: ...
    def write(self, _: bytes) -> int:
        return -1

    def read(self, *_: int) -> list[int]:
        return []


def entry(path: bytes, serial: str, **kind: int) -> dict[str, Any]:
    return {"path": path, "serial_number": serial, "product_string": "rig", **kind}


@pytest.fixture
def lists(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, list[dict[str, Any]] | None]:
    """What each backend lists; None: hidapi was built without it."""
    made: dict[str, list[dict[str, Any]] | None] = {"hidraw": [], "libusb": []}

    def module(backend: str) -> Any:
        entries = made[backend]
        if entries is None:
            return None
        return SimpleNamespace(enumerate=lambda *_: entries, device=Device, version_str=lambda: "1.2")

    monkeypatch.setattr(discovery, "_module", module)
    monkeypatch.setattr(discovery, "HIDRAW_CLASS", tmp_path)
    return made


def looked(**options: Any) -> list[tuple[str, bytes]]:
    return [(found.backend, found.path) for found in discovery.look(HidRigOptions(**options))]


def test_hidraw_is_taken_where_it_shows_the_rig(lists: dict[str, Any]) -> None:
    lists["hidraw"] = [entry(b"/dev/hidraw3", "1", **SERIAL_EMULATION), entry(b"/dev/hidraw2", "1", **RAW)]
    lists["libusb"] = [entry(b"1-2:1.0", "1", **UNSAID)]
    assert looked() == [("hidraw", b"/dev/hidraw2")]
    assert looked(backend="libusb") == [("libusb", b"1-2:1.0")]


@pytest.mark.parametrize("shown", [[], [entry(b"/dev/hidraw3", "1", **SERIAL_EMULATION)]])
def test_libusb_is_not_asked_where_hidraw_may_yet_show_the_rig(lists: dict[str, Any], shown: list[Any]) -> None:
    lists["hidraw"] = shown
    lists["libusb"] = [entry(b"1-2:1.0", "1", **UNSAID)]
    assert looked() == []


@pytest.mark.parametrize("lacks", ["the kernel", "hidapi"])
def test_libusb_is_taken_where_there_is_no_hidraw(
    lists: dict[str, Any], lacks: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """It tells no usage page, so the interface says which of a Teensy's two this is."""
    if lacks == "hidapi":
        lists["hidraw"] = None
    else:
        monkeypatch.setattr(discovery, "HIDRAW_CLASS", tmp_path / "hidraw")
    other = {**UNSAID, "interface_number": 1}
    lists["libusb"] = [entry(b"1-2:1.1", "1", **other), entry(b"1-2:1.0", "1", **UNSAID)]
    assert looked() == [("libusb", b"1-2:1.0")]
    assert looked(backend="hidraw") == []
    assert [said.mark for said in discovery.diagnose(HidRigOptions())] == ["advice"]
    hid = discovery.open_device(HidRigOptions())
    assert hid.guard is None
    link = HidLink(hid)
    assert "through libusb" in link.notes[0]
    link.close()


def test_libusb_that_may_not_open_the_rig_names_the_rule(
    lists: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    lists["libusb"] = [entry(b"1-2:1.0", "1", **UNSAID)]
    monkeypatch.setattr(Device, "refuses", "open failed")
    with pytest.raises(DevicePermissionError, match="sudo hapticd service install"):
        discovery.open_device(HidRigOptions(backend="libusb"))


def test_hidraw_that_may_not_be_opened_names_the_rule(lists: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    lists["hidraw"] = [entry(b"/dev/hidraw2", "1", **RAW)]

    def refuse(*_: Any) -> int:
        raise PermissionError

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(DevicePermissionError, match="/dev/hidraw2: install the udev rule"):
        discovery.open_device(HidRigOptions())
    (found,) = discovery.find_devices(HidRigOptions())
    assert "sudo hapticd service install, then replug" in found.problem
    assert found.mend == ("sudo hapticd service install  # then replug",)


def test_among_several_one_has_to_be_named(lists: dict[str, Any]) -> None:
    lists["hidraw"] = [entry(b"/dev/hidraw2", "1", **RAW), entry(b"/dev/hidraw4", "2", **RAW)]
    with pytest.raises(DeviceNotFoundError, match=r"several .*serial; there is 1 \(/dev/hidraw2\), 2 \(/dev/hidraw4\)"):
        discovery.open_device(HidRigOptions())
    with pytest.raises(DeviceNotFoundError, match='no 16c0:0486 has serial number "3"'):
        discovery.open_device(HidRigOptions(serial="3"))


def test_the_doctor_hears_when_it_is_not_clear_which_rig_is_meant(lists: dict[str, Any]) -> None:
    lists["hidraw"] = [entry(b"/dev/hidraw2", "1", **RAW), entry(b"/dev/hidraw4", "2", **RAW)]
    for options, told in ((HidRigOptions(), "several 16c0:0486"), (HidRigOptions(serial="3"), 'serial number "3"')):
        ok, problem = discovery.diagnose(options)
        assert (ok.mark, problem.mark) == ("ok", "problem")
        assert told in problem.text
        assert "serial = ..." in problem.mend[0]
    assert [said.mark for said in discovery.diagnose(HidRigOptions(serial="2"))] == ["ok"]


def test_the_doctor_hears_which_backend_there_is(lists: dict[str, Any]) -> None:
    (said,) = discovery.diagnose(HidRigOptions())
    assert (said.mark, said.text) == ("ok", "hidapi 1.2 reaches the rig through hidraw")
    lists["libusb"] = None
    (said,) = discovery.diagnose(HidRigOptions(backend="libusb"))
    assert said.mark == "problem"
    assert "no module hid," in said.text
