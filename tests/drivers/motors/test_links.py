"""Adapters: what is written and read on the wire, and what becomes of a line that is full, gone or not there."""

from __future__ import annotations

import contextlib
import errno
import os
import pty
import re
import select
import socket
import struct
import subprocess
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest
from can import Message
from can.interfaces.slcan import slcanBus
from can.interfaces.socketcan.socketcan import build_can_frame
from hypothesis import given
from hypothesis import strategies as st

from hapticd.errors import DeviceBusyError, DeviceDisconnectedError, DeviceNotFoundError
from hapticd.trace import DriverTrace
from hapticd_drivers.motors import fdcanusb, link, slcan, socketcan
from hapticd_drivers.motors.ascii_link import AsciiLink, Dialect
from hapticd_drivers.motors.link import Frame, TracedLink, only
from hapticd_drivers.motors.socketcan import SocketCanLink, open_can
from tests.examples import examples

PATIENCE_S = 60.0
DIALECTS = [fdcanusb.DIALECT, slcan.dialect(1_000_000)]


@pytest.fixture
def line() -> Iterator[tuple[int, str]]:
    """A pseudo-terminal: its far end, and the path of its near one."""
    far, near = pty.openpty()
    tty.setraw(near)
    os.set_blocking(far, False)
    yield far, os.ttyname(near)
    for descriptor in (far, near):
        try:  # noqa: SIM105 - a test may have closed it
            os.close(descriptor)
        except OSError:
            pass


def heard(made: AsciiLink) -> list[Frame]:
    """The next frames: what was written comes when the kernel brings it."""
    end_s = time.monotonic() + PATIENCE_S
    while not (frames := made.receive()):
        assert time.monotonic() < end_s
        made.wait(PATIENCE_S)
    return frames


@pytest.mark.parametrize("dialect", DIALECTS, ids=lambda dialect: dialect.name)
def test_a_line_that_takes_no_more_drops_whole_frames_and_never_half_of_one(
    line: tuple[int, str], dialect: Dialect
) -> None:
    far, path = line
    made = AsciiLink("test", path, dialect)
    os.read(far, 65536)
    sent = 4000
    for _ in range(sent):
        made.send(0x101, b"\x01\x02\x03\x04")
    assert 0 < made.unsent < sent
    came = b""
    for _ in range(200):
        try:
            came += os.read(far, 65536)
        except BlockingIOError:
            break
    made.send(0x101, b"\x01\x02\x03\x04")  # brings the rest of the one that was cut
    while select.select([far], [], [], 0.5)[0]:
        came += os.read(far, 65536)
    lines = [text for text in came.split(dialect.end) if text]
    assert set(lines) == {dialect.line(0x101, b"\x01\x02\x03\x04").rstrip(dialect.end)}
    assert len(lines) == sent + 1 - made.unsent
    made.close()


def test_a_refusal_of_slcan_is_counted_and_spoils_no_frame_behind_it(line: tuple[int, str]) -> None:
    """No end of line comes behind the <BEL>, which is why Linux and python-can take it for one."""
    far, path = line
    made = AsciiLink("test", path, slcan.dialect(1_000_000))
    os.write(far, b"\a\at00980000803F00000000\r\r\at0091")
    assert heard(made) == [(0x009, bytes.fromhex("0000803F00000000"))]
    os.write(far, b"FF\r")
    assert heard(made) == [(0x009, b"\xff")]
    assert made.damaged == 3
    made.close()


@pytest.mark.parametrize("dialect", DIALECTS, ids=lambda dialect: dialect.name)
def test_an_adapter_that_is_gone_is_a_lost_device(line: tuple[int, str], dialect: Dialect) -> None:
    far, path = line
    made = AsciiLink("test", path, dialect)
    os.close(far)
    with pytest.raises(DeviceDisconnectedError, match="gone"):
        made.send(1, b"")
    made.close()


def test_noise_without_an_end_of_line_is_thrown_away(line: tuple[int, str]) -> None:
    far, path = line
    made = AsciiLink("test", path, fdcanusb.DIALECT)
    for _ in range(20):
        os.write(far, b"z" * 400)
        made.wait(PATIENCE_S)
        assert made.receive() == []
    assert made.damaged > 0
    os.write(far, b"\nrcv 100 21000A E B F\r\n")
    assert heard(made) == [(0x100, b"\x21\x00\x0a")]
    made.close()


def test_a_port_has_one_owner_and_has_to_be_there(line: tuple[int, str]) -> None:
    _, path = line
    made = AsciiLink("test", path, fdcanusb.DIALECT)
    with pytest.raises(DeviceBusyError, match="fuser"):
        AsciiLink("test", path, fdcanusb.DIALECT)
    made.close()
    with pytest.raises(DeviceNotFoundError, match="plugged in"):
        AsciiLink("test", "/dev/ttyNothing", fdcanusb.DIALECT)


@examples(300)
@given(identifier=st.integers(0, 0x7FF), data=st.binary(max_size=8))
def test_an_slcan_line_is_what_python_can_writes_and_reads(identifier: int, data: bytes) -> None:
    """Another hand's encoder, on the lines of the same adapters."""
    bus = slcanBus.__new__(slcanBus)
    bus._is_shutdown = True
    written: list[bytes] = []
    bus.serialPortOrig = type("Port", (), {"write": written.append, "flush": lambda: None, "write_timeout": None})
    bus.send(Message(arbitration_id=identifier, data=data, is_extended_id=False))
    assert slcan.line(identifier, data) == written[0]
    assert slcan.frame(written[0].rstrip(b"\r")) == (identifier, data)
    assert slcan.frame(written[0].rstrip(b"\r") + b"12AF") == (identifier, data)  # with a time


@examples(300)
@given(text=st.one_of(st.binary(max_size=40), st.text("tTzZ0123456789ABCDEF\a", max_size=40).map(str.encode)))
def test_an_slcan_line_that_makes_no_sense_is_refused_and_nothing_else(text: bytes) -> None:
    try:
        found = slcan.frame(text)
    except ValueError:
        return
    assert found is None or (0 <= found[0] <= 0x7FF and len(found[1]) <= 8)


def test_an_slcan_adapter_is_told_its_speed_and_opened() -> None:
    assert slcan.dialect(500_000).opening.split(b"\r") == [b"", b"C", b"S6", b"O", b""]
    assert {speed: int(name[1:]) for speed, name in slcanBus._BITRATES.items() if speed in slcan.SPEEDS} == {
        speed: code for speed, code in slcan.SPEEDS.items() if speed != 800_000
    }


@examples(300)
@given(identifier=st.integers(0, 0x1FFFFFFF), size=st.sampled_from((1, 8, 12, 48, 64)))
def test_frames_of_the_kernel_are_those_that_python_can_builds(identifier: int, size: int) -> None:
    """The layout of struct canfd_frame, from another hand."""
    data = bytes(range(size))
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    made = SocketCanLink("test", "can0", True, near)
    made.send(identifier, data)
    theirs = build_can_frame(
        Message(
            arbitration_id=identifier, data=data, is_extended_id=identifier > 0x7FF, is_fd=True, bitrate_switch=True
        )
    )
    ours = far.recv(128)
    assert ours[:5] == theirs[:5]
    assert ours[5] == theirs[5] & 0x01  # python-can also says that it is CAN-FD, which the length does
    assert ours[8:] == theirs[8:]
    far.send(theirs)
    assert made.receive() == [(identifier, data)]
    made.close()
    far.close()


def test_frames_that_are_no_data_are_left_out() -> None:
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    made = SocketCanLink("test", "can0", False, near)
    far.send(struct.pack("=IB3x8s", 0x20000004, 8, bytes(8)))  # an error frame
    far.send(struct.pack("=IB3x8s", 0x40000123, 8, bytes(8)))  # a question for data
    far.send(struct.pack("=IB3x8s", 0x123, 99, bytes(8)))
    far.send(b"short")
    far.send(struct.pack("=IB3x8s", 0x123, 2, b"\x05\x06"))
    assert made.receive() == [(0x123, b"\x05\x06")]
    assert made.damaged == 3
    far.close()
    with pytest.raises(DeviceDisconnectedError, match="`hapticd devices test`"):
        made.receive()
    made.close()


def test_what_a_loop_that_stood_still_missed_is_taken_at_once() -> None:
    """Of three ODrives 25 ms are 80 frames: what was left of them came a tick later, and a place of before was new."""
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    far.setblocking(False)
    made = SocketCanLink("test", "can0", False, near)
    sent = 0
    with contextlib.suppress(BlockingIOError):
        while True:
            far.send(socketcan.CLASSIC.pack(0x009, 4, sent.to_bytes(4, "little")))
            sent += 1
    assert sent > 200
    assert made.receive()[-1] == (0x009, (sent - 1).to_bytes(4, "little"))
    made.close()
    far.close()


def test_an_interface_that_is_up_without_can_fd_is_said_to_be() -> None:
    """The kernel takes no such frame there (EINVAL); the adapter was said to be gone."""

    class ClassicSocket(socket.socket):
        def send(self, *_: object) -> int:
            raise OSError(errno.EINVAL, "Invalid argument")

    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    made = SocketCanLink("test", "can0", True, ClassicSocket(fileno=near.detach()))
    with pytest.raises(DeviceNotFoundError, match="without CAN-FD: `hapticd devices test`"):
        made.send(0x8001, bytes(48))
    made.close()
    far.close()


def test_an_interface_that_takes_no_more_drops_the_frame() -> None:
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    made = SocketCanLink("test", "can0", False, near)
    for _ in range(5000):
        made.send(1, bytes(8))
    assert made.unsent > 0
    made.close()
    far.close()


def test_an_interface_that_is_not_there_says_what_to_do() -> None:
    """Without CAN in the kernel that is said, with it the name."""
    with pytest.raises(DeviceNotFoundError, match=r"modprobe can-raw|ip -br link show type can"):
        open_can("test", "can77", True, "sudo ip link set can77 up")


def test_a_virtual_interface_carries_frames_where_this_kernel_has_one() -> None:
    """And where it has none, that is what the kernel says: nothing is left out silently."""
    made = subprocess.run(
        ["ip", "link", "add", "dev", "vhlinks", "type", "vcan"], capture_output=True, text=True, check=False
    )
    if made.returncode:
        assert re.search("Unknown device type|Operation not (permitted|supported)", made.stderr), made.stderr
        return
    try:
        subprocess.run(["ip", "link", "set", "vhlinks", "mtu", "72", "up"], check=True)
        ours = open_can("test", "vhlinks", True, "")
        theirs = open_can("test", "vhlinks", True, "")
        ours.send(0x8001, bytes(48))
        theirs.wait(5.0)
        assert theirs.receive() == [(0x8001, bytes(48))]
        ours.close()
        theirs.close()
    finally:
        subprocess.run(["ip", "link", "del", "vhlinks"], check=False)


def test_which_of_several_is_asked_and_none_is_said() -> None:
    assert only("test", ["can0"], "interface") == "can0"
    with pytest.raises(DeviceNotFoundError, match="can0, can1"):
        only("test", ["can0", "can1"], "interface")
    with pytest.raises(DeviceNotFoundError, match="no interface"):
        only("test", [], "interface")


def test_interfaces_are_those_whose_type_is_can(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, kind in (("can0", "280"), ("lo", "772")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "type").write_text(f"{kind}\n")
    monkeypatch.setattr(link, "_SYSFS", tmp_path)
    assert link.can_interfaces() == ["can0"]


def test_a_trace_has_frames_both_ways_and_what_went_wrong() -> None:
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    trace = DriverTrace(100)
    made = TracedLink(SocketCanLink("test", "can0", False, near), trace)
    made.send(0x8001, b"\x01")
    far.recv(128)
    far.send(socketcan.CLASSIC.pack(0x100, 2, b"\x21\x00"))
    far.send(b"odd")
    made.wait(1.0)
    assert made.receive() == [(0x100, b"\x21\x00")]
    far.close()
    with pytest.raises(DeviceDisconnectedError):
        made.receive()
    made.close()
    told = "\n".join(trace.lines())
    for part in ("> 8001 01", "< 100 21 00", "damaged: 1", "gone"):
        assert part in told
