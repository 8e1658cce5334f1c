"""The serial rig's own board: its encoder, its home switch, and a force in proportion to the duty."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from hapticd_drivers.rig import messages
from tests.firmware.board import Board, Kind, Pace
from tests.firmware.talk import Talk

COUNT_M = 7.669904e-6


@pytest.fixture
def board(start_board: Callable[[Pace, Kind], Board]) -> Board:
    return start_board("steps", "uno")


def test_it_says_what_it_is(board: Board) -> None:
    with Talk(board) as host:
        identity = host.greet()
        assert (identity.axes, identity.model, identity.host_silence_ms) == (1, "serial-rig", 20)
        (axis,) = host.say(lambda sequence: messages.describe(sequence, 0), 2000)
        assert isinstance(axis, messages.Axis)
        assert axis.count_pm * 1e-12 == pytest.approx(COUNT_M, abs=1e-12)
        assert axis.max_force_un == 5_000_000


@pytest.mark.parametrize("newton", [1.0, -2.5, 5.0, -5.0, 0.0125])
def test_a_force_arrives_at_the_motor_and_moves_the_handle_its_way(board: Board, newton: float) -> None:
    with Talk(board) as host:
        host.greet()
        assert host.state(messages.enable).flags & messages.ENABLED
        for _ in range(10):
            state = host.push(newton)
        truth = board.state()
        assert state.force_un == [round(newton * 1e6)]
        assert truth.motor_n == pytest.approx(newton, abs=0.00625)  # half a step of the PWM
        assert truth.position_m * newton > 0.0
        assert abs(host.poll().position[0]) in range(abs(truth.counts), abs(board.state().counts) + 1)


def test_no_count_is_lost_at_a_metre_a_second(board: Board) -> None:
    """130000 edges a second, faster than a hand moves a handle, while the line is in use."""
    board.plant(mass_kg=0.01, damping_n_s_per_m=10.0)
    with Talk(board) as host:
        host.greet()
        for newton in (10.0, -10.0, 10.0):
            board.hand(newton)
            for _ in range(120):
                assert host.poll().fault == 0
            assert board.state().position_m * newton > 0.049 * 10.0
        assert host.poll().position == [board.state().counts]


@pytest.mark.parametrize(("phase_error_deg", "speed_m_per_s"), [(18.0, 0.8), (-18.0, 0.8), (45.0, 0.5), (-45.0, 0.5)])
def test_with_a_phase_error_no_count_is_lost_at_a_speed_that_is_lower_by_its_share_of_a_quarter(
    board: Board, phase_error_deg: float, speed_m_per_s: float
) -> None:
    """What counts is the time between two edges that come close; 45 degrees are what good encoders are allowed."""
    board.misalign_encoder(phase_error_deg)
    board.plant(mass_kg=0.01, damping_n_s_per_m=10.0)
    with Talk(board) as host:
        host.greet()
        for newton in (10.0 * speed_m_per_s, -10.0 * speed_m_per_s, 10.0 * speed_m_per_s):
            board.hand(newton)
            for _ in range(240):
                assert host.poll().fault == 0
            assert board.state().position_m * newton > 0.049 * abs(newton)
        assert host.poll().position == [board.state().counts]


@pytest.mark.parametrize("phase_error_deg", [18.0, 45.0])
def test_at_a_metre_a_second_such_an_encoder_is_a_fault_and_not_a_wrong_position(
    board: Board, phase_error_deg: float
) -> None:
    board.misalign_encoder(phase_error_deg)
    board.plant(mass_kg=0.01, damping_n_s_per_m=10.0)
    with Talk(board) as host:
        host.greet()
        board.hand(10.0)
        heard = [said for _ in range(50) for said in host.say(lambda sequence: messages.poll(sequence, 0))]
        assert [said.fault for said in heard if isinstance(said, messages.Fault)] == [1]


def test_counts_that_are_lost_are_a_fault_and_not_a_wrong_position(board: Board) -> None:
    board.plant(mass_kg=0.01, damping_n_s_per_m=1.0)
    with Talk(board) as host:
        host.greet()
        host.say(lambda sequence: messages.set_home(sequence, 0, 0))
        assert host.state(messages.enable).flags & messages.HOMED
        board.hand(20.0)  # up to 14 m/s
        heard = [said for _ in range(20) for said in host.say(lambda sequence: messages.force(sequence, 0, [0]))]
        assert [said.fault for said in heard if isinstance(said, messages.Fault)] == [1]
        last = host.poll()
        assert last.fault == 1
        assert not last.flags & (messages.ENABLED | messages.HOMED)


def test_counts_that_are_lost_behind_a_restart_take_the_home_away(board: Board) -> None:
    board.plant(mass_kg=0.01, damping_n_s_per_m=1.0)
    with Talk(board) as host:
        host.greet()
        board.hang()
        board.run(30_000)
        host.say(messages.hello, 2000)
        host.say(lambda sequence: messages.set_home(sequence, 0, 0))
        before = host.poll()
        assert (before.flags & messages.HOMED, before.fault) == (messages.HOMED, 3)
        board.hand(20.0)  # up to 14 m/s
        board.run(20_000)
        board.hand(0.0)
        host.say(messages.disable, 2000)
        assert not host.state(messages.disable).flags & messages.HOMED


def test_the_home_switch_is_closed_at_the_lower_end_stop_only(board: Board) -> None:
    with Talk(board) as host:
        host.greet()
        assert not host.poll().flags & messages.HOME_SWITCH_CLOSED
        board.hand(-0.5)
        board.run(1_000_000)
        assert host.poll().flags & messages.HOME_SWITCH_CLOSED
        board.hand(0.5)
        board.run(50_000)
        assert not host.poll().flags & messages.HOME_SWITCH_CLOSED
        board.press(True)
        assert host.poll().buttons == 1
        board.press(False)
        assert host.poll().buttons == 0


def test_a_broken_wire_of_the_encoder_is_no_motion_and_no_force_beyond_the_limit(board: Board) -> None:
    """With one channel dead the count only toggles: the firmware cannot know, the host must (its sign check does)."""
    board.break_sensor(True)
    with Talk(board) as host:
        host.greet()
        board.hand(2.0)
        board.run(100_000)
        assert abs(board.state().counts) > 100
        assert abs(host.poll().position[0]) <= 1


def test_a_handle_may_stand_anywhere_when_the_rig_is_switched_on(board: Board) -> None:
    board.place(-0.02)
    with Talk(board) as host:
        host.greet()
        assert host.poll().position == [0]
        assert board.state().position_m == pytest.approx(-0.02)
        board.hand(0.5)
        board.run(100_000)
        state = host.poll()
        assert state.fault == 0
        assert state.position[0] * COUNT_M == pytest.approx(board.state().position_m + 0.02, abs=5e-4)
