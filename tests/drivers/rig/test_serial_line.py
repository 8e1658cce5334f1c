"""The serial line below the protocol: which port, how it is opened, and a line that takes no more."""

from __future__ import annotations

import os
import pty
import re
import termios
import tty
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from pydantic import ValidationError
from serial.tools import list_ports

from hapticd.errors import DeviceDisconnectedError, DeviceNotFoundError, DevicePermissionError
from hapticd_drivers import serial_port
from hapticd_drivers.rig import messages, serial_ports
from hapticd_drivers.rig.frames import FrameReader, framed
from hapticd_drivers.rig.serial_link import SerialLink
from hapticd_drivers.rig.serial_ports import Port
from hapticd_drivers.rig.serial_rig import SAY_WHICH, SerialRig, SerialRigOptions


@dataclass(order=True)
class Listed:
    """As pyserial lists a port."""

    device: str
    product: str | None = None
    vid: int | None = None
    pid: int | None = None
    serial_number: str | None = None
    description: str = "n/a"


UNO = Listed("/dev/ttyACM0", "Arduino Uno", 0x2341, 0x0043, "7573")
FTDI = Listed("/dev/ttyUSB0", "FT232R USB UART", 0x0403, 0x6001, "A50285BI")
OTHER_FTDI = Listed("/dev/ttyUSB1", "FT232R USB UART", 0x0403, 0x6001, None)
BUILT_IN = Listed("/dev/ttyS0")


@pytest.fixture
def plugged_in(monkeypatch: pytest.MonkeyPatch) -> list[Listed]:
    listed: list[Listed] = [BUILT_IN]
    monkeypatch.setattr(list_ports, "comports", lambda: listed)
    return listed


@pytest.mark.parametrize(
    ("wanted", "others", "chosen"),
    [
        ("auto", [UNO], "/dev/ttyACM0"),
        ("usb:0403:6001", [UNO, FTDI], "/dev/ttyUSB0"),
        ("usb:0403:6001:A50285BI", [UNO, FTDI, OTHER_FTDI], "/dev/ttyUSB0"),
        ("/dev/serial/by-id/usb-rig", [UNO, FTDI], "/dev/serial/by-id/usb-rig"),
    ],
)
def test_a_port_is_meant_by_path_by_usb_identity_or_by_being_the_only_one(
    plugged_in: list[Listed], wanted: str, others: list[Listed], chosen: str
) -> None:
    plugged_in += others
    assert serial_ports.choose(wanted).path == chosen
    assert SerialRig.diagnose(SerialRigOptions(port=wanted)) == []


@pytest.mark.parametrize(
    ("wanted", "others", "says"),
    [
        ("auto", [], "no serial port on USB at all"),
        ("auto", [UNO, FTDI], r"fits several ports.*ttyACM0 \(Arduino Uno, usb:2341:0043:7573\), /dev/ttyUSB0"),
        ("usb:0403:6001", [FTDI, OTHER_FTDI], "fits several ports"),
        ("usb:16c0:0483", [UNO], "usb:16c0:0483 is not plugged in; there is /dev/ttyACM0"),
        ("usb:0403:6001:XYZ", [FTDI], "is not plugged in"),
    ],
)
def test_a_port_that_is_none_or_several_is_told_with_what_there_is(
    plugged_in: list[Listed], wanted: str, others: list[Listed], says: str
) -> None:
    plugged_in += others
    with pytest.raises(DeviceNotFoundError, match=says):
        serial_ports.choose(wanted)
    told = SerialRig.diagnose(SerialRigOptions(port=wanted))
    assert [(one.mark, one.mend) for one in told] == ([("problem", (SAY_WHICH,))] if others else [])
    assert all(re.search(says, one.text) for one in told)


@pytest.mark.parametrize("port", ["ttyUSB0", "usb:0403", "usb:xyz0:6001", "", "usb:0403:6001:"])
def test_a_port_that_means_nothing_is_refused_in_the_configuration(port: str) -> None:
    with pytest.raises(ValidationError, match="port"):
        SerialRigOptions(port=port)


def test_ports_are_listed_without_opening_any(plugged_in: list[Listed], tmp_path: Path) -> None:
    there = tmp_path / "ttyACM0"
    there.touch()
    plugged_in += [Listed(str(there), "Arduino Uno", 0x2341, 0x0043, "7573"), FTDI]
    ftdi, uno = SerialRig.find()
    assert (uno.model, uno.serial, uno.where, uno.problem) == ("Arduino Uno", "7573", str(there), "")
    assert "may not open it" in ftdi.problem
    assert [found.where for found in SerialRig.find(SerialRigOptions(port=str(there)))] == [str(there)]
    assert SerialRig.find(SerialRigOptions(port="/dev/none")) == []


@pytest.fixture
def line() -> Iterator[tuple[int, Port]]:
    """The far end of a line, and its port."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    yield master, Port(os.ttyname(slave))
    os.close(slave)
    os.close(master)


def test_a_line_that_takes_no_more_loses_whole_messages_and_never_makes_one_wait(line: tuple[int, Port]) -> None:
    master, port = line
    link = SerialLink(port, 1_000_000, low_latency=False)
    sent = 0
    while link.unsent < 5:
        link.send(messages.force(sent & 0xFFFF, 0, [sent]))
        sent += 1
        assert sent < 100_000
    reader = FrameReader()
    found: list[bytes] = []

    def drain() -> None:
        while True:
            try:
                found.extend(reader.feed(os.read(master, 4096)))
            except BlockingIOError:
                return

    drain()
    for _ in range(3):
        link.send(messages.force(sent & 0xFFFF, 0, [sent]))
        sent += 1
        drain()
    assert reader.damaged == 0
    assert len(found) == sent - link.unsent
    assert found[-1] == messages.force(sent - 1 & 0xFFFF, 0, [sent - 1])
    link.close()


def test_a_closed_port_leaves_dtr_up_so_that_the_next_to_open_it_resets_no_board(line: tuple[int, Port]) -> None:
    link = SerialLink(line[1], 1_000_000, low_latency=False)
    assert not termios.tcgetattr(link._port.descriptor)[2] & termios.HUPCL
    link.close()


def test_a_line_whose_far_end_has_gone_is_a_lost_device() -> None:
    """`read` alone shows nothing of it: a line without data and one that is gone both give no bytes."""
    master, slave = pty.openpty()
    link = SerialLink(Port(os.ttyname(slave)), 1_000_000, low_latency=False)
    os.close(master)
    os.close(slave)
    with pytest.raises(DeviceDisconnectedError, match="unplugged"):
        link.receive()
    with pytest.raises(DeviceDisconnectedError, match="unplugged"):
        link.send(messages.hello(0))
    link.close()


def test_a_port_that_this_user_may_not_open_names_the_group() -> None:
    error = serial_port._refusal(
        "serial-rig", "/dev/ttyUSB0", 1_000_000, "the rig", PermissionError(13, "Permission denied")
    )
    assert isinstance(error, DevicePermissionError)
    assert "usermod -aG dialout" in str(error)


def notes_of(port: Port, sysfs: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[str, ...]:
    monkeypatch.setattr(serial_ports, "SYSFS", sysfs)
    link = SerialLink(port, 1_000_000, low_latency=True)
    link.close()
    return link.notes


def test_a_port_without_low_latency_mode_says_where_to_look(
    line: tuple[int, Port], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pty has none, and no FTDI adapter's timer."""
    (note,) = notes_of(line[1], tmp_path, monkeypatch)
    assert "no low-latency mode" in note
    assert "round_trip_us" in note


def test_an_ftdi_adapters_timer_is_set_to_a_millisecond_where_that_is_allowed(
    line: tuple[int, Port], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    timer = tmp_path / Path(line[1].path).name / "latency_timer"
    timer.parent.mkdir()
    timer.write_text("16\n")
    assert notes_of(line[1], tmp_path, monkeypatch) == ()
    assert timer.read_text() == "1"
    assert list(timer.parent.iterdir()) == [timer]  # an adapter without the other setting


def test_an_ftdi_adapter_hands_over_each_frame_when_it_ends(
    line: tuple[int, Port], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its event character, which the kernel takes as 0x100 + the byte: frames end with a zero."""
    event_char = tmp_path / Path(line[1].path).name / "event_char"
    event_char.parent.mkdir()
    event_char.touch()
    (event_char.parent / "latency_timer").write_text("16\n")
    assert notes_of(line[1], tmp_path, monkeypatch) == ()
    assert int(event_char.read_text(), 0) == 0x100 + framed(messages.hello(0))[-1]


def test_an_ftdi_adapters_timer_that_may_not_be_set_is_told_with_the_way_out(
    line: tuple[int, Port], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    timer = tmp_path / Path(line[1].path).name / "latency_timer"
    timer.parent.mkdir()
    timer.write_text("16\n")

    def refuse(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "write_text", refuse)
    (note,) = notes_of(line[1], tmp_path, monkeypatch)
    assert "keeps bytes back for 16 ms" in note
    assert f"sudo tee {timer}" in note
