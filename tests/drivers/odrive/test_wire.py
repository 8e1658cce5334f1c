"""Wire bytes against the DBC file of firmware 0.6.10, read by cantools: both encode and decode the same."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd_drivers.odrive import cansimple
from hapticd_drivers.odrive.faults import FAULTS, errors_text
from tests.drivers.odrive.controller import dbc
from tests.examples import examples

F32 = st.floats(width=32, allow_nan=False, allow_infinity=False)
ADDRESS = st.integers(0, 7)
WORD = st.integers(0, 0xFFFFFFFF)


def message(address: int, name: str) -> Any:
    return dbc().get_message_by_name(f"Axis{address}_{name}")


@examples(2000)
@given(address=ADDRESS, torque_n_m=F32, axis_state=st.integers(0, 16))
def test_what_is_told_is_what_the_file_encodes(address: int, torque_n_m: float, axis_state: int) -> None:
    for name, number, ours, values in (
        ("Set_Input_Torque", cansimple.SET_TORQUE, cansimple.torque(torque_n_m), {"Input_Torque": torque_n_m}),
        ("Set_Axis_State", cansimple.SET_STATE, cansimple.state(axis_state), {"Axis_Requested_State": axis_state}),
        ("Set_Controller_Mode", cansimple.SET_MODE, cansimple.TORQUE_MODE, {"Control_Mode": 1, "Input_Mode": 1}),
        ("Clear_Errors", cansimple.CLEAR_ERRORS, cansimple.CLEAR, {"Identify": 0}),
    ):
        theirs = message(address, name)
        assert cansimple.identifier(address, number) == theirs.frame_id
        # The file pads the commands to 8 bytes, an ODrive takes them as long as they are.
        assert ours.ljust(theirs.length, b"\0") == theirs.encode(values)


@examples(2000)
@given(address=ADDRESS, first=F32, second=F32, words=st.tuples(WORD, WORD), bytes_=st.binary(min_size=8, max_size=8))
def test_what_the_file_encodes_is_read_as_it_was_meant(
    address: int, first: float, second: float, words: tuple[int, int], bytes_: bytes
) -> None:
    for name, number, signals in (
        ("Get_Encoder_Estimates", cansimple.ESTIMATES, ("Pos_Estimate", "Vel_Estimate")),
        ("Get_Temperature", cansimple.TEMPERATURES, ("FET_Temperature", "Motor_Temperature")),
        ("Get_Bus_Voltage_Current", cansimple.BUS, ("Bus_Voltage", "Bus_Current")),
        ("Get_Torques", cansimple.TORQUES, ("Torque_Target", "Torque_Estimate")),
    ):
        theirs = message(address, name)
        assert cansimple.identifier(address, number) == theirs.frame_id
        assert cansimple.pair(theirs.encode(dict(zip(signals, (first, second), strict=True)))) == (first, second)
    values = {"Axis_Error": words[0], "Axis_State": bytes_[0], "Procedure_Result": bytes_[1], "Trajectory_Done_Flag": 1}
    theirs = message(address, "Heartbeat")
    assert cansimple.identifier(address, cansimple.HEARTBEAT) == theirs.frame_id
    assert cansimple.heartbeat(theirs.encode(values)) == (words[0], bytes_[0])
    theirs = message(address, "Get_Error")
    assert cansimple.identifier(address, cansimple.ERRORS) == theirs.frame_id
    assert cansimple.errors(theirs.encode({"Active_Errors": words[0], "Disarm_Reason": words[1]})) == words
    theirs = message(address, "Get_Version")
    said = theirs.decode(bytes_)
    assert cansimple.identifier(address, cansimple.VERSION) == theirs.frame_id
    assert cansimple.version(bytes_) == tuple(
        ".".join(str(said[f"{kind}_Version_{part}"]) for part in parts)
        for kind, parts in (("Hw", ("Major", "Minor", "Variant")), ("Fw", ("Major", "Minor", "Revision")))
    )


@pytest.mark.parametrize("size", [0, 4, 7])
def test_what_is_too_short_is_refused(size: int) -> None:
    for read in (cansimple.pair, cansimple.heartbeat, cansimple.errors, cansimple.version):
        with pytest.raises(struct.error):
            read(bytes(size))


def test_every_error_that_the_file_names_says_what_to_do() -> None:
    (signal,) = [each for each in message(0, "Heartbeat").signals if each.name == "Axis_Error"]
    named = set(signal.choices) - {0}
    assert named <= set(FAULTS)
    for error in named:
        assert errors_text(error) == FAULTS[error]
    assert errors_text(0x201) == f"{FAULTS[1]}; {FAULTS[0x200]}"
    assert "0x80" in errors_text(0x80)
