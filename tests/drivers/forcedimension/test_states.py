"""`hapticd devices` and `hapticd doctor` in every state that a lab meets, on a USB bus of umockdev and the fake SDK."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from hapticd_drivers.forcedimension.presence import RULE
from tests.drivers.forcedimension.bench import Bench

HAPTICD = str(Path(sys.executable).with_name("hapticd"))

DESCRIPTORS = (
    "120100020000004051140204000101020001" + "09022000010100C032090400000200000000070581020002000705020200020000"
)
"""A high-speed device 1451:0402 with one interface and two bulk endpoints."""

DEVICE = """\
P: /devices/pci0000:00/0000:00:14.0/usb1/1-{port}
N: bus/usb/001/00{port}={descriptors}
E: DEVNAME=/dev/bus/usb/001/00{port}
E: DEVTYPE=usb_device
E: SUBSYSTEM=usb
E: BUSNUM=001
E: DEVNUM=00{port}
A: busnum=1\\n
A: devnum={port}\\n
A: idVendor=1451\\n
A: idProduct=0402\\n
A: speed=480\\n
A: bConfigurationValue=1\\n
A: product=omega.x haptic device\\n
H: descriptors={descriptors}

"""

CLOSED = "import os, sys; os.chmod('/dev/bus/usb/001/005', 0); os.execv(sys.argv[1], sys.argv[1:])"
HOLD = """
import sys
from hapticd_drivers.forcedimension.driver import ForceDimension
driver = ForceDimension(ForceDimension.Options.model_validate({"library": sys.argv[1]}), 1e-3)
driver.open()
print("held", flush=True)
sys.stdin.read()
"""


class Lab:
    """A computer with so many devices on USB, and the SDK or not.

    Args:
        directory: where its files go.
        library: where the SDK is, or is not.
    """

    def __init__(self, directory: Path, library: Path) -> None:
        if shutil.which("umockdev-run") is None:
            pytest.skip("no umockdev: sudo apt install umockdev")
        self.config = directory / "lab.toml"
        self.config.write_text(f'[device]\ndriver = "omega7"\n[device.options]\nlibrary = "{library}"\n')
        self.memory = directory / "devices"
        self._usb = directory / "usb"
        self._usb.write_text("")
        self._run = [str(HAPTICD)]

    def plug(self, *ports: int) -> None:
        """Put devices on the bus."""
        self._usb.write_text("".join(DEVICE.format(port=port, descriptors=DESCRIPTORS) for port in ports))

    def plug_falcon(self, port: int) -> None:
        """Put a Novint Falcon on the bus, and nothing else."""
        text = DEVICE.format(port=port, descriptors=DESCRIPTORS.replace("51140204", "030448CB"))
        text = text.replace("idVendor=1451", "idVendor=0403").replace("idProduct=0402", "idProduct=cb48")
        self._usb.write_text(text)

    def lock(self) -> None:
        """Take this user's right to the device in port 5 away, and root's right to everything."""
        rootless = ["setpriv", "--bounding-set=-dac_override,-dac_read_search"] if os.geteuid() == 0 else []
        self._run = [*rootless, sys.executable, "-c", CLOSED, HAPTICD]

    def hapticd(self, *arguments: str) -> str:
        environment = {**os.environ, "FAKE_DHD_FILE": str(self.memory), "COLUMNS": "200"}
        command = ["umockdev-run", "-d", str(self._usb), "--", *self._run, *arguments, "--config", str(self.config)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode in (0, 1), done.stderr
        return done.stdout

    def devices(self) -> dict[str, Any]:
        """What `hapticd devices` says of the driver."""
        (row,) = json.loads(self.hapticd("devices", "omega7", "--json"))
        assert row["problem"] == ""
        return dict(row)

    def doctor(self, check: str) -> list[tuple[str, str, str]]:
        """Mark, text and what mends it of the doctor's findings in a check."""
        findings = json.loads(self.hapticd("doctor", "--no-latency", "--json"))["findings"]
        return [(one["mark"], one["text"], "\n".join(one["mend"])) for one in findings if one["check"] == check]


@pytest.fixture
def lab(bench: Bench, tmp_path: Path) -> Lab:
    made = Lab(tmp_path, bench.directory)
    bench.attach(made.memory)
    return made


@contextmanager
def held(lab: Lab, library: Path) -> Iterator[None]:
    """Another program has the first device."""
    environment = {**os.environ, "FAKE_DHD_FILE": str(lab.memory)}
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(library)],
        env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as holder:  # fmt: skip
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        try:
            yield
        finally:
            holder.kill()


def test_no_sdk(tmp_path: Path) -> None:
    nowhere = tmp_path / "nowhere"
    nowhere.mkdir()
    lab = Lab(tmp_path, nowhere)
    row = lab.devices()
    assert row["devices"] == []
    (diagnosis,) = row["diagnoses"]
    assert diagnosis["mark"] == "problem"
    assert f"{nowhere}: no libdrd.so in it" in diagnosis["text"]
    shown = lab.hapticd("devices")
    assert "none found\n    plug it in, and switch its power supply on" in shown
    assert "download the SDK from forcedimension.com" in shown
    ((mark, text, mend),) = lab.doctor("driver.needs")
    assert (mark, "the Force Dimension SDK cannot be loaded" in text) == ("problem", True)
    assert "forcedimension.com" in mend
    lab.plug(5)
    (device,) = lab.devices()["devices"]
    assert (device["where"], device["serial"]) == ("001:005", "")
    assert "the Force Dimension SDK cannot be loaded" in device["problem"]
    assert "forcedimension.com" in device["mend"][0]


def test_a_lone_libdhd_is_no_sdk(fake_sdk: Path, tmp_path: Path) -> None:
    """The doctor says what the driver would: it calibrates through libdrd."""
    half = tmp_path / "half"
    half.mkdir()
    shutil.copy(fake_sdk / "libdhd.so.3", half)
    ((mark, text, _),) = Lab(tmp_path, half).doctor("driver.needs")
    assert mark == "problem"
    assert "no libdrd.so in it" in text


def test_the_sdk_but_no_device(lab: Lab, bench: Bench) -> None:
    bench.set(-1, count=0)
    row = lab.devices()
    assert row["devices"] == []
    assert [one["text"] for one in row["diagnoses"]][1] == "the SDK finds no device"
    shown = lab.hapticd("devices").splitlines()
    at = next(index for index, line in enumerate(shown) if line.startswith("omega7"))
    assert shown[at].endswith("none found")
    assert shown[at + 1].startswith("    plug it in")
    library, count = lab.doctor("driver.needs")
    # The fake is below /tmp, as an SDK may be that somebody has just unpacked.
    assert library[0] == "advice"
    assert f"Force Dimension SDK 3.17.5.0, {bench.directory}/libdrd.so.3: the system service may not look" in library[1]
    assert count == ("ok", "the SDK finds no device", "")
    ((mark, text, mend),) = lab.doctor("driver.devices")
    assert (mark, text) == ("problem", "omega7 finds no device")
    assert "plug it in" in mend


def test_a_device_on_the_bus_that_the_sdk_does_not_see(lab: Lab, bench: Bench) -> None:
    bench.set(-1, count=0)
    lab.plug(5)
    (device,) = lab.devices()["devices"]
    assert "may be opened, yet the SDK does not find it" in device["problem"]
    assert "switch it off and on again" in device["mend"][0]
    assert [mark for mark, _, _ in lab.doctor("driver.needs")] == ["advice", "problem"]


@pytest.mark.parametrize("counted", [False, True])
def test_a_device_but_no_permission(lab: Lab, bench: Bench, counted: bool) -> None:
    """Whether the SDK counts a device that it may not open nobody says."""
    bench.set(-1, count=int(counted))
    bench.set(refuses=2)
    lab.plug(5)
    lab.lock()
    (device,) = lab.devices()["devices"]
    assert device["where"] == "001:005"
    assert "this user may not open /dev/bus/usb/001/005" in device["problem"]
    assert device["mend"][0] == "sudo hapticd service install"
    assert RULE in device["mend"][2]
    shown = lab.hapticd("devices")
    assert "cannot be used" in shown
    assert RULE in " ".join(shown.replace("\\\n", " ").split())
    ((mark, text, mend),) = lab.doctor("driver.devices")
    assert (mark, "may not open /dev/bus/usb/001/005" in text) == ("problem", True)
    assert "service install" in mend


def test_a_device_that_another_program_has(lab: Lab, bench: Bench) -> None:
    lab.plug(5)
    with held(lab, bench.directory):
        (device,) = lab.devices()["devices"]
        assert device["where"] == "001:005"
        assert device["problem"].startswith("another program has the device (")
        assert device["mend"] == ["# end that program first; while the daemon runs, it is the daemon"]
        _, (mark, text, mend) = lab.doctor("driver.needs")
        assert mark == "advice"
        assert text == "the SDK finds one device, and another program has it: the daemon itself, when it runs"
        assert "hapticd watch" in mend
    (device,) = lab.devices()["devices"]
    assert device["problem"] == ""


def test_a_falcon(lab: Lab, bench: Bench) -> None:
    bench.set(type=60, calibrated=0)
    lab.plug_falcon(5)
    (device,) = lab.devices()["devices"]
    assert (device["model"], device["where"], device["problem"]) == ("Novint Falcon", "001:005", "")
    assert "device.accept_no_watchdog = true" in device["note"]
    assert lab.doctor("driver.needs")[1][:2] == ("ok", "the SDK finds one device")
    ((mark, text, _),) = lab.doctor("driver.devices")
    assert (mark, "Novint Falcon" in text) == ("ok", True)
    bench.set(-1, count=0)
    (device,) = lab.devices()["devices"]
    assert "a Novint Falcon is on USB (0403:cb48, 001:005) and may be opened" in device["problem"]
    lab.lock()
    (device,) = lab.devices()["devices"]
    assert 'ATTR{idVendor}=="0403", ATTR{idProduct}=="cb48"' in device["mend"][2]


def test_two_devices(lab: Lab, bench: Bench) -> None:
    bench.set(-1, count=2)
    bench.set(1, type=105, calibrated=0)
    lab.plug(5, 6)
    first, second = lab.devices()["devices"]
    assert (first["model"], first["serial"], first["problem"], first["note"]) == ("omega.7", "1001", "", "")
    assert (second["model"], second["serial"], second["problem"]) == ("sigma.7, left-handed", "1002", "")
    assert "hapticd calibrate" in second["note"]
    shown = [line.split() for line in lab.hapticd("devices").splitlines()]
    assert ["omega7", "omega.7", "1001", "-", "ready"] in shown
    assert ["omega7", "sigma.7,", "left-handed", "1002", "-", "usable"] in shown
    _, (mark, text, mend) = lab.doctor("driver.needs")
    assert mark == "advice"
    assert text == "the SDK finds 2 devices; without a serial number the first that is free is taken"
    assert "serial = ..." in mend
    lab.config.write_text(f"{lab.config.read_text()}serial = 1002\n")
    assert lab.doctor("driver.needs")[1][:2] == ("ok", "the SDK finds 2 devices")
    assert [mark for mark, _, _ in lab.doctor("driver.devices")] == ["ok", "ok"]
    assert [bench.get("holder", device) for device in range(2)] == [0, 0]
    assert sum(bench.get("moves", device) for device in range(2)) == 0
