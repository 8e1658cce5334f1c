"""Wire bytes against the maker's own package: what it encodes we decode, and what we encode is what it encodes."""

from __future__ import annotations

import io
import math
import random
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from moteus import multiplex as mp
from moteus.fdcanusb_device import FdcanusbDevice, _strip_and_validate_checksum
from moteus.moteus import Controller, PositionResolution, QueryResolution
from moteus.protocol import Mode, Register, Writer, parse_registers
from moteus.transport_device import Frame, TransportDevice

from hapticd_drivers.moteus import registers
from hapticd_drivers.moteus.faults import FAULTS, stopped_text
from hapticd_drivers.motors import fdcanusb
from tests.examples import examples

F32 = st.floats(width=32, allow_nan=False, allow_infinity=False)
TORQUE = st.floats(-100.0, 100.0, width=32)
WATCHDOG = st.floats(0.0009765625, 1.0, width=32)
INTEGERS = {mp.INT8: 8, mp.INT16: 16, mp.INT32: 32}


class Quiet(TransportDevice):  # type: ignore[misc]  # it publishes no types
    """A transport of the maker's, for its padding alone."""

    def padded(self, data: bytes) -> bytes:
        filling: bytes = bytes.fromhex(self._padding_hex) * (self._round_up_dlc(len(data)) - len(data))
        return data + filling


class Asked(QueryResolution):  # type: ignore[misc]  # it publishes no types
    """What is asked for in every tick."""

    home_state = mp.INT8
    _extra = {Register.MILLISECOND_COUNTER: mp.INT32}  # noqa: RUF012 - the maker's own way


class Commanded(PositionResolution):  # type: ignore[misc]  # nor here
    """How the one value that is always 0 goes out."""

    ilimit_scale = mp.INT8


def maker() -> Controller:
    return Controller(id=5, query_resolution=Asked(), position_resolution=Commanded())


@examples(2000)
@given(torque_n_m=TORQUE, most_n_m=TORQUE, timeout_s=WATCHDOG)
def test_a_torque_is_what_the_makers_package_encodes(torque_n_m: float, most_n_m: float, timeout_s: float) -> None:
    command = maker().make_position(
        position=math.nan,
        velocity=0.0,
        feedforward_torque=torque_n_m,
        kp_scale=0.0,
        kd_scale=0.0,
        maximum_torque=most_n_m,
        watchdog_timeout=timeout_s,
        ilimit_scale=0.0,
        query=True,
    )
    assert registers.torque(torque_n_m, most_n_m, timeout_s) == Quiet().padded(command.data)


@examples(100)
@given(turns=F32)
def test_the_other_commands_are_too(turns: float) -> None:
    padded = Quiet().padded
    assert padded(maker().make_stop(query=True).data) == registers.STOP
    assert padded(maker().make_brake(query=True).data) == registers.SHORTED
    assert padded(maker().make_query().data) == registers.QUERY
    said = parse_registers(registers.here_is(turns))
    assert said.command == parse_registers(maker().make_set_output_exact(position=turns).data).command
    assert said.query == parse_registers(registers.QUERY).query
    identity = dict(parse_registers(registers.IDENTITY).query)
    words = (Register.SERIAL_NUMBER1, Register.SERIAL_NUMBER2, Register.SERIAL_NUMBER3)
    assert identity == dict.fromkeys((Register.FIRMWARE_VERSION, *words), mp.INT32)


@examples(2000)
@given(
    mode=st.sampled_from(list(Mode)),
    reals=st.tuples(F32, F32, F32),
    voltage_v=st.floats(0.0, 63.0),
    temperature_c=st.integers(-127, 127),
    fault=st.integers(0, 127),
)
def test_a_state_that_the_makers_package_encodes_is_read_as_it_was_meant(
    mode: Mode, reals: tuple[float, float, float], voltage_v: float, temperature_c: int, fault: int
) -> None:
    buffer = io.BytesIO()
    writer = Writer(buffer)
    combiner = mp.WriteCombiner(writer, 0x20, 0, [mp.INT8, *[mp.F32] * 3, *[mp.IGNORE] * 8, *[mp.INT8] * 4])
    values = [mode, *reals, *[None] * 8, 2, voltage_v, temperature_c, fault]
    for register, value in enumerate(values):
        if combiner.maybe_write():
            write = writer.write_voltage if register == Register.VOLTAGE else writer.write_int
            write(value, mp.INT8) if register not in (1, 2, 3) else writer.write_f32(value)
    data = Quiet().padded(buffer.getvalue())
    found = registers.answers(data)
    assert found is not None
    theirs = parse_registers(data).response
    assert found[registers.MODE] == theirs[Register.MODE] == mode
    assert (found[registers.POSITION], found[registers.VELOCITY], found[registers.TORQUE]) == reals
    assert found[registers.VOLTAGE] * registers.VOLTS == theirs[Register.VOLTAGE]
    assert (found[registers.TEMPERATURE], found[registers.FAULT]) == (temperature_c, fault)


@examples(500)
@given(data=st.data())
def test_whatever_registers_an_answer_holds_they_are_read_as_the_maker_reads_them(data: st.DataObject) -> None:
    """Every type, count and register; errors and padding in between."""
    buffer = io.BytesIO()
    writer = Writer(buffer)
    expected = {}
    for _ in range(data.draw(st.integers(1, 4))):
        first = data.draw(st.integers(0, 0x200))
        resolution = data.draw(st.sampled_from([mp.INT8, mp.INT16, mp.INT32, mp.F32]))
        count = data.draw(st.integers(1, 5))
        combiner = mp.WriteCombiner(writer, 0x20, first, [resolution] * count)
        for register in range(first, first + count):
            assert combiner.maybe_write()
            if resolution == mp.F32:
                value = data.draw(F32)
                writer.write_f32(value)
            else:
                half = 1 << INTEGERS[resolution] - 1
                whole = data.draw(st.integers(-half, half - 1))
                buffer.write(mp.TYPES[resolution].pack(whole))
                value = math.nan if whole == -half else float(whole)
            expected[register] = value
        if data.draw(st.booleans()):
            buffer.write(data.draw(st.sampled_from([b"\x50", b"\x31\x05\x01", b"\x30\x85\x02\x01"])))
    found = registers.answers(buffer.getvalue())
    assert found is not None
    assert found == pytest.approx(expected, abs=0.0, rel=0.0, nan_ok=True)
    assert set(found) == set(parse_registers(buffer.getvalue()).response)


@examples(500)
@given(data=st.binary(max_size=64))
def test_whatever_bytes_come_nothing_is_raised(data: bytes) -> None:
    found = registers.answers(data)
    assert found is None or all(isinstance(value, int | float) for value in found.values())


def test_what_is_too_long_for_a_frame_is_never_sent() -> None:
    with pytest.raises(ValueError, match="too long"):
        registers.padded(bytes(65))
    assert len(registers.padded(bytes(49))) == 64


@examples(300)
@given(identifier=st.integers(0, 0x1FFFFFFF), size=st.sampled_from(registers._SIZES[1:]), filling=st.randoms())
def test_a_line_is_what_the_makers_package_writes(identifier: int, size: int, filling: random.Random) -> None:
    data = bytes(filling.randrange(256) for _ in range(size))
    written: list[bytes] = []
    device = FdcanusbDevice.__new__(FdcanusbDevice)
    TransportDevice.__init__(device)
    device._disable_brs, device._checksum_active, device._debug_log = False, False, None
    device._serial = type("Serial", (), {"write": written.append})
    sending = device._write_send_frame(
        Frame(arbitration_id=identifier, data=data, dlc=size, is_extended_id=True, is_fd=True, bitrate_switch=True)
    )
    with pytest.raises(StopIteration):
        sending.send(None)
    assert fdcanusb.line(identifier, data) == written[0]


@examples(300)
@given(
    identifier=st.integers(0, 0x1FFFFFFF),
    data=st.binary(min_size=1, max_size=64),
    flags=st.sampled_from(["", " E B F", " s b f"]),
)
def test_a_line_that_came_is_read_as_the_maker_reads_it(identifier: int, data: bytes, flags: str) -> None:
    line = f"rcv {identifier:x} {data.hex()}{flags}\r".encode()
    text, _, _ = _strip_and_validate_checksum(line.rstrip())
    theirs = FdcanusbDevice._parse_frame(FdcanusbDevice.__new__(FdcanusbDevice), text)
    assert fdcanusb.frame(line) == (theirs.arbitration_id, theirs.data) == (identifier, data)


@pytest.mark.parametrize("line", [b"", b"OK\r", b"OK"])
def test_what_an_adapter_says_for_itself_is_no_frame(line: bytes) -> None:
    assert fdcanusb.frame(line) is None


@examples(300)
@given(line=st.one_of(st.binary(max_size=80), st.text("rcv 0123456789abcdefEBF\r", max_size=80).map(str.encode)))
def test_a_line_that_makes_no_sense_is_refused_and_nothing_else(line: bytes) -> None:
    try:
        found = fdcanusb.frame(line)
    except ValueError:
        return
    assert found is None or (0 <= found[0] <= 0x1FFFFFFF and len(found[1]) <= 64)


def test_every_fault_and_mode_that_lets_go_says_what_to_do() -> None:
    assert set(FAULTS) == set(range(32, 49))
    for mode in (Mode.FAULT, Mode.TIMEOUT, Mode.STOPPED, Mode.CURRENT):
        assert stopped_text(mode, 32, 20.0)
    assert "fault 77" in stopped_text(Mode.FAULT, 77, 20.0)
    assert "motor supply" in stopped_text(4, 0, 20.0), "the cause may be its power, not another program"


def test_the_floats_on_the_wire_are_those_of_this_computer() -> None:
    """A torque is a float of 32 bits; what is lost is less than a millionth of it."""
    for newton_metre in (0.05, -1e-4, 3.14159):
        (there,) = struct.unpack_from("<f", registers.torque(newton_metre, 1.0, 0.02), 6 + 8)
        assert there == pytest.approx(newton_metre, rel=1e-7)
