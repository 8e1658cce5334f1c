"""The Hapkit's board: an analog angle sensor whose half turns are counted, and a force with the square of the duty."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from hapticd_drivers.rig import messages
from tests.firmware.board import Board, Kind, Pace
from tests.firmware.talk import Talk

PULLEY_M, SECTOR_M, HANDLE_M = 0.005, 0.074, 0.070
COUNT_M = math.pi * PULLEY_M * HANDLE_M / SECTOR_M / 1024
FULL_N = 0.0146 * SECTOR_M / (HANDLE_M * PULLEY_M)


@pytest.fixture
def board(start_board: Callable[[Pace, Kind], Board]) -> Board:
    return start_board("steps", "hapkit")


def test_it_says_what_it_is(board: Board) -> None:
    with Talk(board) as host:
        identity = host.greet()
        assert (identity.axes, identity.model, identity.host_silence_ms) == (1, "hapkit", 20)
        assert not identity.capabilities & messages.HAS_HOME_SWITCH
        (axis,) = host.say(lambda sequence: messages.describe(sequence, 0), 2000)
        assert isinstance(axis, messages.Axis)
        assert axis.count_pm * 1e-12 == pytest.approx(COUNT_M, rel=1e-6)
        assert axis.max_force_un * 1e-6 == pytest.approx(FULL_N, rel=1e-5)


@pytest.mark.parametrize("newton", [0.0, 1e-5, 1e-3, 0.1, -0.5, 1.0, -2.5, FULL_N, -FULL_N])
def test_a_force_arrives_through_the_root_of_the_duty(board: Board, newton: float) -> None:
    """What arrives is a duty in steps of 1/256, the nearest to the one that was asked for, squared."""
    with Talk(board) as host:
        host.greet()
        host.state(messages.enable)
        for _ in range(10):
            host.push(newton)
        truth = board.state()
        asked, given = (math.sqrt(abs(force_n) / FULL_N) for force_n in (newton, truth.motor_n))
        assert given == pytest.approx(asked, abs=0.51 / 256)
        assert given * 256 == pytest.approx(round(given * 256))
        assert truth.motor_n * newton >= 0.0
        assert truth.position_m * truth.motor_n >= 0.0


def counts_from(host: Talk) -> Callable[[], int]:
    """What the firmware has counted from here on."""
    begin = host.poll().position[0]
    return lambda: host.poll().position[0] - begin


@pytest.mark.parametrize("newton", [0.25, 2.5])
def test_half_turns_are_counted_both_ways_through_the_jump_of_the_voltage(board: Board, newton: float) -> None:
    """At half a metre a second conversions fall into the jump; at 5 m/s a half turn takes 3 ms."""
    board.plant(mass_kg=0.002, damping_n_s_per_m=0.5)
    with Talk(board) as host:
        host.greet()
        count = counts_from(host)
        for way in (1.0, -1.0, 1.0):
            board.hand(way * newton)
            for _ in range(160):
                assert host.poll().fault == 0
            assert board.state().position_m == pytest.approx(way * 0.035)
            assert count() == pytest.approx(board.state().counts, abs=2)
        board.hand(0.0)
        board.grip(200.0, 1.0, 0.0)
        board.run(100_000)
        assert count() == pytest.approx(board.state().counts, abs=2)


def test_positions_are_even_to_two_counts_over_a_half_turn(board: Board) -> None:
    board.plant(mass_kg=0.002, damping_n_s_per_m=0.5)
    with Talk(board) as host:
        host.greet()
        count = counts_from(host)
        for step in range(0, 60):
            board.grip(2000.0, 4.0, step * 17 * COUNT_M)
            board.run(7_000)
            assert count() == pytest.approx(board.state().counts, abs=2)


def test_a_sensor_that_jumps_further_than_a_hand_is_a_fault_and_not_a_position(board: Board) -> None:
    """A magnet that comes loose: what is passed over for 0.7 ms is no blip."""
    with Talk(board) as host:
        host.greet()
        host.say(lambda sequence: messages.set_home(sequence, 0, 0))
        assert host.state(messages.enable).flags & messages.HOMED
        host.push(1.0)
        board.turn_magnet(400)
        heard = [said for _ in range(3) for said in host.say(lambda sequence: messages.force(sequence, 0, [1_000_000]))]
        assert [said.fault for said in heard if isinstance(said, messages.Fault)] == [1]
        assert board.state().motor_n == 0.0
        assert not host.poll().flags & (messages.ENABLED | messages.HOMED)
        assert host.state(messages.disable).fault == 0


def test_no_home_is_known_while_the_sensor_has_slipped(board: Board) -> None:
    with Talk(board) as host:
        host.greet()
        board.turn_magnet(400)
        board.run(2000)
        host.say(lambda sequence: messages.set_home(sequence, 0, 0))
        slipped = host.poll()
        assert (slipped.flags & messages.HOMED, slipped.fault) == (0, 1)
        assert not host.state(messages.disable).flags & messages.HOMED
        host.say(lambda sequence: messages.set_home(sequence, 0, 0))
        assert host.poll().flags & messages.HOMED


def test_a_broken_wire_of_the_sensor_is_a_fault_until_it_is_mended(board: Board) -> None:
    """The pull-up at the input makes it a voltage that the sensor never shows."""
    with Talk(board) as host:
        host.greet()
        host.say(lambda sequence: messages.set_home(sequence, 0, 0))
        host.state(messages.enable)
        host.push(2.0)
        board.break_sensor(True)
        heard = host.say(lambda sequence: messages.force(sequence, 0, [2_000_000]), 2000)
        assert [said.fault for said in heard if isinstance(said, messages.Fault)] == [1]
        assert board.state().motor_n == 0.0
        assert host.state(messages.disable).fault == 1
        assert not host.state(messages.enable).flags & messages.ENABLED
        board.break_sensor(False)
        board.run(2000)
        assert host.state(messages.disable).fault == 0
        state = host.state(messages.enable)
        assert state.flags & messages.ENABLED
        assert not state.flags & messages.HOMED


def test_there_is_a_button_and_no_home_switch(board: Board) -> None:
    with Talk(board) as host:
        host.greet()
        board.press(True)
        state = host.poll()
        assert (state.buttons, state.flags & messages.HOME_SWITCH_CLOSED) == (1, 0)
        board.press(False)
        assert host.poll().buttons == 0
