"""The log in systemd's journal: fields that a program can ask for."""

from __future__ import annotations

import contextlib
import logging
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.supervisor.systemd import JournalHandler, Notifier, datagram, log_handler


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[socket.socket]:
    """What systemd listens with."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as server:
        server.bind(str(tmp_path / "journal"))
        server.settimeout(5.0)
        yield server


def fields(row: bytes) -> dict[str, bytes]:
    """Read a datagram as the journal does."""
    found = {}
    while row:
        line, _, rest = row.partition(b"\n")
        name, equals, value = line.partition(b"=")
        if not equals:
            length = int.from_bytes(rest[:8], "little")
            value, row = rest[8 : 8 + length], rest[8 + length + 1 :]
            assert rest[8 + length : 8 + length + 1] == b"\n"
        else:
            row = rest
        found[name.decode()] = value
    return found


def record(text: str, level: int = logging.ERROR, **extra: object) -> logging.LogRecord:
    return logging.getLogger("hapticd").makeRecord("hapticd", level, __file__, 1, "%s", (text,), None, extra=extra)


def test_an_event_has_its_code_tick_law_and_instance_as_fields(journal: socket.socket) -> None:
    handler = JournalHandler(journal.getsockname(), logging.NullHandler())
    handler.handle(record("device lost", code=201, tick=1234, law="energy-cycle", instance="left"))
    assert fields(journal.recv(4096)) == {
        "MESSAGE": b"device lost",
        "PRIORITY": b"3",
        "SYSLOG_IDENTIFIER": b"hapticd",
        "HAPTICD_INSTANCE": b"left",
        "HAPTICD_CODE": b"201",
        "HAPTICD_TICK": b"1234",
        "HAPTICD_LAW": b"energy-cycle",
    }
    handler.close()


@given(text=st.text(), law=st.text())
def test_no_text_makes_another_field_of_itself(text: str, law: str) -> None:
    """A driver's message may hold anything, line feeds and equals signs too."""
    found = fields(datagram(text, record(text, law=law)))
    assert set(found) == {"MESSAGE", "PRIORITY", "SYSLOG_IDENTIFIER", "HAPTICD_LAW"}
    assert found["MESSAGE"] == text.encode(errors="replace")
    assert found["HAPTICD_LAW"] == law.encode(errors="replace")


@pytest.mark.parametrize(
    ("level", "priority"), [(logging.DEBUG, b"7"), (logging.INFO, b"6"), (logging.WARNING, b"4"), (logging.ERROR, b"3")]
)
def test_a_level_is_a_priority(level: int, priority: bytes) -> None:
    assert fields(datagram("", record("", level)))["PRIORITY"] == priority


class Kept(logging.Handler):
    def __init__(self) -> None:
        super().__init__()
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.messages.append(record.getMessage())


def test_what_the_journal_does_not_take_goes_elsewhere(tmp_path: Path) -> None:
    kept = Kept()
    handler = JournalHandler(str(tmp_path / "nobody"), kept)
    handler.handle(record("unheard"))
    assert kept.messages == ["unheard"]
    handler.close()


def test_a_journal_that_does_not_read_is_not_waited_for(journal: socket.socket) -> None:
    kept = Kept()
    handler = JournalHandler(journal.getsockname(), kept)
    sent = 0
    while not kept.messages:
        handler.handle(record(f"line {sent}"))
        sent += 1
        assert sent < 10_000
    assert kept.messages == [f"line {sent - 1}"]
    handler.close()


def test_only_a_stream_to_the_journal_gets_fields(monkeypatch: pytest.MonkeyPatch) -> None:
    status = os.fstat(2)
    monkeypatch.setenv("JOURNAL_STREAM", f"{status.st_dev}:{status.st_ino}")
    with contextlib.closing(log_handler()) as handler:
        assert isinstance(handler, JournalHandler)
    monkeypatch.setenv("JOURNAL_STREAM", "1:1")
    assert not isinstance(log_handler(), JournalHandler)
    monkeypatch.delenv("JOURNAL_STREAM")
    assert not isinstance(log_handler(), JournalHandler)


def test_what_systemd_is_told_is_one_assignment_a_line_whatever_the_text_is(
    journal: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Why a device does not come back may be several lines, and a path in it no UTF-8, which ended the daemon."""
    monkeypatch.setenv("NOTIFY_SOCKET", str(journal.getsockname()))
    notifier = Notifier()
    notifier.send("READY=1", "STATUS=no device: /lab\udce9/lab.toml: gone\n  MAINPID=1, law tdpa")
    assert notifier._socket is not None
    notifier._socket.close()
    assert journal.recv(4096) == b"READY=1\nSTATUS=no device: /lab?/lab.toml: gone; MAINPID=1, law tdpa"
