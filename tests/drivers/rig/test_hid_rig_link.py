"""What a link of reports makes of bytes that nobody has promised to be reports; hapticd's own end only."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.errors import DeviceDisconnectedError
from hapticd_drivers.rig import messages
from hapticd_drivers.rig.hid_rig_discovery import HidDevice, OpenHid
from hapticd_drivers.rig.hid_rig_link import MOST_READ, HidLink
from tests.daemon.running import PATIENCE_S

REPORT_SIZE = 64
GRACE_S = 0.2
"""What a link that freed its handle too early would need much less of [s]."""


class Handle:
    """Hidapi's handle on a device that sends these reports."""

    def __init__(self, reports: Iterable[bytes] = (), *, floods: bool = False) -> None:
        self.coming = deque(reports)
        self.written: list[bytes] = []
        self.reads = 0
        self._floods = floods

    def read(self, most: int, timeout_ms: int) -> list[int]:
        self.reads += 1
        if self._floods:
            return list(reported(messages.ping(self.reads, 0)))
        return list(self.coming.popleft()[:most]) if self.coming else []

    def write(self, report: bytes) -> int:
        self.written.append(report)
        return len(report)

    def close(self) -> None: ...


def link_to(handle: Handle) -> HidLink:
    return HidLink(OpenHid(handle, HidDevice("hidraw", b"/dev/hidraw0", "rig", "1"), None))


def reported(message: bytes) -> bytes:
    return (bytes([len(message)]) + message).ljust(REPORT_SIZE, b"\0")


intact = st.binary(min_size=4, max_size=61).map(lambda body: body + messages.checksum(body).to_bytes(2, "little"))
good = intact.map(reported)
hostile = st.one_of(
    st.binary(min_size=1, max_size=100),
    st.binary(min_size=REPORT_SIZE, max_size=REPORT_SIZE),
    st.builds(
        lambda report, at, bit: flipped(report, at % (report[0] + 1), bit), good, st.integers(0), st.integers(0, 7)
    ),
    st.builds(lambda report, length: report[:length], good, st.integers(1, REPORT_SIZE - 1)),
)


def flipped(report: bytes, at: int, bit: int) -> bytes:
    return report[:at] + bytes([report[at] ^ 1 << bit]) + report[at + 1 :]


def expected(report: bytes) -> bytes | None:
    """The protocol's words again: 64 bytes, the length first, then the message with its checksum."""
    report = report[:REPORT_SIZE]
    if len(report) < REPORT_SIZE or not messages.SHORTEST <= report[0] <= messages.LONGEST:
        return None
    message = report[1 : report[0] + 1]
    return message if messages.checksum(message[:-2]) == int.from_bytes(message[-2:], "little") else None


@given(st.lists(st.one_of(good, hostile), max_size=MOST_READ))
def test_only_intact_messages_get_through_in_order_and_the_rest_is_counted(reports: list[bytes]) -> None:
    link = link_to(Handle(reports))
    wanted = [message for message in map(expected, reports) if message is not None]
    assert link.receive() == wanted
    assert link.damaged == len(reports) - len(wanted)
    link.close()


@given(intact)
def test_a_message_fills_one_report_with_its_number_before_it(message: bytes) -> None:
    handle = Handle()
    link = link_to(handle)
    link.send(message)
    link.close()
    assert handle.written == [b"\0" + reported(message)]
    back = link_to(Handle([handle.written[0][1:]]))
    assert back.receive() == [message]
    back.close()


def test_a_rig_that_floods_does_not_hold_the_loop() -> None:
    handle = Handle(floods=True)
    link = link_to(handle)
    assert len(link.receive()) == MOST_READ == handle.reads
    link.close()


def test_what_was_waited_for_comes_first() -> None:
    first, second = messages.hello(1), messages.hello(2)
    link = link_to(Handle([reported(first), reported(second)]))
    link.wait(0.01)
    link.wait(0.01)
    assert link.receive() == [first, second]
    link.close()


def test_a_handle_is_left_alone_after_its_first_error() -> None:
    handle = Handle()
    link = link_to(handle)
    reads: list[int] = []

    def fail(*arguments: int) -> list[int]:
        reads.append(1)
        raise OSError("read error")

    link._read = fail
    for _ in range(3):
        with pytest.raises(DeviceDisconnectedError, match="/dev/hidraw0 is gone"):
            link.receive()
    assert len(reads) == 1
    link.close()


class SlowHandle(Handle):
    """Its reads take until the test lets them end."""

    def __init__(self) -> None:
        super().__init__()
        self.reading = threading.Event()
        self.read_ends = threading.Event()
        self.closed = threading.Event()

    def read(self, most: int, timeout_ms: int) -> list[int]:
        self.reading.set()
        assert self.read_ends.wait(PATIENCE_S)
        return super().read(most, timeout_ms)

    def close(self) -> None:
        self.closed.set()


def test_a_handle_is_not_freed_under_a_read_and_not_read_after_that() -> None:
    """A calibration that was called off may still wait for an answer when the loop closes the rig."""
    handle = SlowHandle()
    link = link_to(handle)
    reader = threading.Thread(target=link.wait, args=(0.01,))
    closer = threading.Thread(target=link.close)
    reader.start()
    assert handle.reading.wait(PATIENCE_S)
    closer.start()
    assert not handle.closed.wait(GRACE_S)
    handle.read_ends.set()
    assert handle.closed.wait(PATIENCE_S)
    reader.join()
    closer.join()
    with pytest.raises(DeviceDisconnectedError):
        link.receive()
    assert handle.reads == 1
