"""Codec and framing against the protocol's vectors, and against whatever else may come in on a line."""

from __future__ import annotations

from collections.abc import Callable
from struct import pack

import pytest
from cobs import cobs
from hypothesis import given
from hypothesis import strategies as st

from hapticd_drivers.rig import messages
from hapticd_drivers.rig.frames import LONGEST_FRAME, FrameReader, framed
from tests.drivers.rig.vectors import FILE, Vector, lines, raw, vectors

SENT: dict[str, Callable[[Vector], bytes]] = {
    "HELLO": lambda v: messages.hello(v.number("sequence")),
    "DESCRIBE": lambda v: messages.describe(v.number("sequence"), v.number("axis")),
    "SET_HOME": lambda v: messages.set_home(v.number("sequence"), v.number("axis"), v.number("home")),
    "ENABLE": lambda v: messages.enable(v.number("sequence")),
    "DISABLE": lambda v: messages.disable(v.number("sequence")),
    "POLL": lambda v: messages.poll(v.number("sequence"), v.number("answer_after")),
    "FORCE": lambda v: messages.force(v.number("sequence"), v.number("answer_after"), v.numbers("force")),
    "PING": lambda v: messages.ping(v.number("sequence"), v.number("token")),
}


def received(v: Vector) -> messages.Message:
    """What a `device` line says."""
    header = v.number("sequence"), v.number("echo"), v.number("time")
    match v.name:
        case "IDENTITY":
            axes, capabilities, buttons, flags, silence_ms, rate_hz = (
                v.number(name) for name in ("axes", "capabilities", "buttons", "flags", "host_silence", "nominal_rate")
            )
            major, minor, patch = map(int, v.fields["firmware"].split("."))
            return messages.Identity(
                *header,
                axes,
                capabilities,
                buttons,
                flags,
                silence_ms,
                rate_hz,
                (major, minor, patch),
                v.fields["model"],
                v.fields["serial"],
            )
        case "AXIS":
            described = ("axis", "count", "max_force", "lowest", "highest", "home")
            return messages.Axis(*header, *(v.number(name) for name in described))
        case "STATE":
            flags, fault, buttons = v.number("flags"), v.number("fault"), v.number("buttons")
            return messages.State(*header, flags, fault, buttons, v.numbers("position"), v.numbers("force"))
        case "PONG":
            counted = ("token", "received", "lost", "damaged", "stale")
            return messages.Pong(*header, *(v.number(name) for name in counted))
        case "FAULT":
            return messages.Fault(*header, v.number("fault"), v.number("axis"), v.number("detail"))
        case "REFUSED":
            return messages.Refused(*header, v.number("reason"), v.number("type"))
    raise AssertionError(v.name)


def test_the_vectors_have_every_message() -> None:
    assert {v.name for v in vectors("host")} == set(SENT)
    assert {v.name for v in vectors("device")} == {"IDENTITY", "AXIS", "STATE", "PONG", "FAULT", "REFUSED"}


@pytest.mark.parametrize(("data", "crc"), lines("crc"))
def test_the_checksum_is_the_protocols(data: str, crc: str) -> None:
    assert f"{messages.checksum(raw(data)):04x}" == crc


@pytest.mark.parametrize(("plain", "encoded"), lines("cobs"))
def test_the_library_encodes_as_the_protocol_does(plain: str, encoded: str) -> None:
    assert cobs.encode(raw(plain)) == raw(encoded)
    assert cobs.decode(raw(encoded)) == raw(plain)


@pytest.mark.parametrize("words", lines("uncobs"))
def test_what_is_no_cobs_is_refused(words: list[str]) -> None:
    with pytest.raises(cobs.DecodeError):
        cobs.decode(raw(words[0]))


@pytest.mark.parametrize("vector", vectors("host"), ids=lambda v: v.wire.hex())
def test_what_is_sent_is_the_vector(vector: Vector) -> None:
    message = SENT[vector.name](vector)
    assert message == vector.message
    assert framed(message) == vector.wire


@pytest.mark.parametrize("vector", vectors("device"), ids=lambda v: v.wire.hex())
def test_what_is_received_is_what_the_vector_says(vector: Vector) -> None:
    assert FrameReader().feed(vector.wire) == [vector.message]
    assert messages.decode(vector.message) == received(vector)


@pytest.mark.parametrize("words", lines("damaged"))
def test_a_damaged_frame_is_dropped_and_counted_once(words: list[str]) -> None:
    reader = FrameReader()
    assert reader.feed(raw(words[1])) == []
    assert reader.damaged == 1


@pytest.mark.parametrize("words", lines("stream"))
@pytest.mark.parametrize("chunk", [1, 7, 1000])
def test_messages_are_found_among_garbage_however_the_bytes_come(words: list[str], chunk: int) -> None:
    data, *wanted = map(raw, words)
    reader = FrameReader()
    found = [message for at in range(0, len(data), chunk) for message in reader.feed(data[at : at + chunk])]
    assert found == wanted


@given(chunks=st.lists(st.binary(max_size=200), max_size=20))
def test_no_bytes_upset_the_reader_and_the_next_frame_but_one_is_found(chunks: list[bytes]) -> None:
    reader = FrameReader()
    for chunk in chunks:
        for message in reader.feed(chunk):
            messages.decode(message)
        assert len(reader._begun) <= LONGEST_FRAME + 1
    wanted = messages.ping(1, 2)
    assert reader.feed(framed(wanted) + framed(wanted))[-1:] == [wanted]


@given(
    vector=st.sampled_from(vectors("device")),
    flips=st.lists(st.integers(0, 8 * messages.LONGEST - 1), min_size=1, max_size=3, unique=True),
)
def test_up_to_three_wrong_bits_never_make_another_message(vector: Vector, flips: list[int]) -> None:
    """The polynomial's distance is 4 at these lengths: whatever three bits are wrong, the CRC shows it."""
    wrong = bytearray(vector.message)
    for flip in {flip % (8 * len(wrong)) for flip in flips}:
        wrong[flip // 8] ^= 1 << flip % 8
    assert messages.is_intact(bytes(wrong)) == (bytes(wrong) == vector.message)


@given(body=st.binary(min_size=messages.SHORTEST - 2, max_size=messages.LONGEST - 2))
def test_an_intact_message_of_any_content_is_decoded_or_ignored(body: bytes) -> None:
    message = body + messages.checksum(body).to_bytes(2, "little")
    assert messages.is_intact(message)
    found = messages.decode(message)
    assert found is None or message[0] == messages.VERSION
    if isinstance(found, messages.Identity):
        assert (found.model + found.serial).isprintable()


@given(than=st.integers(0, 0xFFFF), step=st.integers(1, 0x7FFF))
def test_newer_means_up_to_half_a_turn_ahead(than: int, step: int) -> None:
    ahead = (than + step) & 0xFFFF
    assert messages.is_newer(ahead, than)
    assert not messages.is_newer(than, ahead)
    assert not messages.is_newer(than, than)


def test_what_a_rig_calls_itself_can_be_shown_and_moves_no_cursor() -> None:
    """It ends in logs and terminals: line ends, escapes and what is no ASCII become question marks."""
    named = (b"a\nb\x1b[31m \xff~\0gone", b"7\r\0\n")
    numbers = (messages.VERSION, messages.IDENTITY, 1, 0, 0, 1, 0, 0, 0, 20, 4, 1, 2, 3)
    body = pack("<BBHHIBBBBHH3B16s12s", *numbers, *named)
    said = messages.decode(body + messages.checksum(body).to_bytes(2, "little"))
    assert isinstance(said, messages.Identity)
    assert (said.model, said.serial) == ("a?b?[31m ?~", "7?")


def test_host_and_firmware_have_the_same_most_axes_and_the_same_number_for_none() -> None:
    header = FILE.with_name("message.h").read_text()
    assert f"RIG_AXES = {messages.MOST_AXES}," in header
    assert f"RIG_NO_AXIS = {messages.NO_AXIS} " in header


@pytest.mark.parametrize(("axes", "known"), [(3, True), (4, False)])
def test_a_state_of_more_axes_than_a_rig_has_is_of_no_known_length(axes: int, known: bool) -> None:
    body = pack(f"<BBHHIBBH{2 * axes}i", messages.VERSION, messages.STATE, 1, 1, 0, 0, 0, 0, *range(2 * axes))
    said = messages.decode(body + messages.checksum(body).to_bytes(2, "little"))
    assert isinstance(said, messages.State) == known
