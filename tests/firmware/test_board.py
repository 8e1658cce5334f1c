"""The real firmware, machine code of an ATmega328P, in simulated time: what every board does."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from functools import partial

import pytest
import serial
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from hapticd_drivers.rig import messages
from hapticd_drivers.rig.frames import FrameReader, framed
from tests.examples import examples
from tests.firmware.board import KINDS, Board, Built, Kind, Pace
from tests.firmware.talk import Talk

STEP_N = 0.012
"""Half a step of the PWM, where it is coarsest."""


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> Kind:
    found: Kind = request.param
    return found


@pytest.fixture
def board(start_board: Callable[[Pace, Kind], Board], kind: Kind) -> Board:
    return start_board("steps", kind)


def test_the_firmware_leaves_half_of_flash_and_ram_free(
    built: Callable[[Kind], Built], kind: Kind, record_property: Callable[[str, object], None]
) -> None:
    size = built(kind).size
    used = {name: float(percent) for name, percent in re.findall(r"(\w+):\s+\d+ bytes \((\d+\.\d)% Full\)", size)}
    record_property("flash_percent", used["Program"])
    record_property("ram_percent", used["Data"])
    used_bytes = {name: int(number) for name, number in re.findall(r"(\w+):\s+(\d+) bytes", size)}
    record_property("prints", f"firmware {kind}: {used_bytes['Program']} bytes of flash, {used_bytes['Data']} of RAM")
    assert 1.0 < used["Program"] < 50.0
    assert 1.0 < used["Data"] < 50.0


def test_no_force_before_enable_and_none_after_disable(board: Board) -> None:
    with Talk(board) as host:
        host.greet()
        assert host.push(3.0).force_un == [0]
        assert board.state().motor_n == 0.0
        host.state(messages.enable)
        host.push(3.0)
        assert board.state().motor_n == pytest.approx(3.0, abs=STEP_N)
        host.state(messages.disable)
        assert board.state().motor_n == 0.0


def test_the_watchdog_stops_the_motor_and_only_enable_brings_it_back(board: Board) -> None:
    with Talk(board) as host:
        host.greet()
        host.state(messages.enable)
        host.push(2.0)
        board.run(18_000)
        assert board.state().motor_n == pytest.approx(2.0, abs=STEP_N)
        board.run(3_000)
        assert board.state().motor_n == 0.0

        stopped = host.push(2.0)
        assert stopped.flags & messages.TRIPPED
        assert not stopped.flags & messages.ENABLED
        for _ in range(30):
            host.push(2.0)
            assert board.state().motor_n == 0.0

        again = host.state(messages.enable)
        assert again.flags & messages.ENABLED
        assert not again.flags & messages.TRIPPED
        host.push(2.0)
        assert board.state().motor_n == pytest.approx(2.0, abs=STEP_N)


FLOODS = {
    "silence": b"",
    "zeros": b"\0",
    "ones": b"\1",
    "0xff": b"\xff",
    "short frames": b"\2\1\0",
    "long frames": bytes(range(1, 255)),
    "another's messages": framed(messages.ping(40_000, 1)),
}
"""What a line may be full of: nothing of it is a force."""


@pytest.mark.parametrize("speed_m_per_s", [0.0, 0.4, 0.8])
@pytest.mark.parametrize("flood", FLOODS)
def test_the_watchdog_stops_the_motor_however_full_the_line_is_and_however_the_handle_moves(
    board: Board, flood: str, speed_m_per_s: float
) -> None:
    """A processor that has a byte to take and an edge to count at every moment still looks at its watchdog."""
    line = itertools.cycle(FLOODS[flood])
    board.plant(mass_kg=0.01, damping_n_s_per_m=10.0)
    board.hand(-5.0)
    with Talk(board) as host:
        board.run(200_000)  # to the lower end stop
        host.greet()
        host.state(messages.enable)
        board.hand(10.0 * speed_m_per_s - 2.0 if speed_m_per_s else -5.0)
        host.push(2.0)  # which takes a millisecond, and its bytes 0.2 ms of that
        for _ in range(37):
            host.raw(bytes(itertools.islice(line, 50)), 500.0)
        before = board.state()
        for _ in range(3):
            host.raw(bytes(itertools.islice(line, 50)), 500.0)
        after = board.state()
        assert before.motor_n == pytest.approx(2.0, abs=STEP_N)
        assert after.motor_n == 0.0
        assert before.velocity_m_per_s == pytest.approx(speed_m_per_s, abs=0.01)


def test_a_thousand_ticks_of_a_millisecond_each_bring_a_state_each(board: Board) -> None:
    with Talk(board) as host:
        host.greet()
        host.state(messages.enable)
        begin = host.push(0.0)
        for tick in range(1000):
            last = host.push(0.5 if tick % 2 else -0.5)
            assert last.echo == host.sequence - 1 & 0xFFFF
            assert last.flags & messages.ENABLED
        assert last.sequence - begin.sequence & 0xFFFF == 1000
        assert (last.time_us - begin.time_us) % 2**32 == pytest.approx(1_000_000, rel=0.02)


def test_the_ttl_input_goes_with_every_state(board: Board) -> None:
    with Talk(board) as host:
        host.greet()
        for high in (False, True, True, False):
            board.ttl(high)
            assert host.poll().buttons == 2 * high
        board.press(True)
        board.ttl(True)
        assert host.push(0.0).buttons == 3


def test_the_sync_output_turns_once_a_tick(board: Board) -> None:
    with Talk(board) as host:
        host.greet()
        host.state(messages.disable)
        host.state(messages.enable)
        assert board.syncs() == 0, "no tick yet"
        for tick in range(200):
            host.push(0.1)
            assert board.syncs() == tick + 1
        host.say(lambda sequence: messages.ping(sequence, 0))
        host.raw(b"\x55" * 40 + b"\0")
        host.say(lambda sequence: messages.force(sequence - 1, 0, [0]))  # a repeated one
        assert board.syncs() == 200


def test_the_sync_output_turns_when_the_position_is_taken(board: Board) -> None:
    """Two ticks that ask for the position 300 and 700 us after they came."""
    with Talk(board) as host:
        host.greet()
        host.push(0.0)
        for wait_us in (300, 700):
            turned = board.syncs()
            host.say(partial(messages.poll, answer_after_us=wait_us), wait_us)
            assert board.syncs() == turned, "its bytes take time, and from then on it waits"
            heard = host.raw(b"", 400)
            assert board.syncs() == turned + 1
            (state,) = [*heard, *host.raw(b"", 600)]
            assert isinstance(state, messages.State)
            assert board.syncs() == turned + 1


def test_a_reversed_motor_moves_the_handle_the_wrong_way(board: Board) -> None:
    board.reverse_motor(True)
    with Talk(board) as host:
        host.greet()
        begin = host.state(messages.enable).position[0]
        for _ in range(20):
            host.push(0.5)
        assert host.poll().position[0] < begin


def test_a_program_that_hangs_is_reset_and_says_so(board: Board) -> None:
    with Talk(board) as host:
        host.greet()
        host.state(messages.enable)
        host.push(3.0)
        board.hang()
        board.run(30_000)
        truth = board.state()
        assert (truth.resets, truth.motor_n) == (1, 0.0)

        heard = host.say(lambda sequence: messages.poll(sequence, 0))
        assert [type(message) for message in heard] == [messages.Fault, messages.Refused]
        host.say(messages.hello, 2000)
        assert host.state(messages.enable).fault == 3
        assert host.push(1.0).force_un == [0]
        assert host.state(messages.disable).fault == 0
        assert host.state(messages.enable).flags & messages.ENABLED


def test_an_unplugged_rig_is_without_force_and_comes_back_as_just_switched_on(board: Board) -> None:
    with Talk(board) as host:
        host.greet()
        host.state(messages.enable)
        host.push(3.0)
        board.unplug()
        assert not board.port.exists()
        board.run(10_000)
        assert board.state().motor_n == 0.0
    board.plug()
    with Talk(board) as host:
        host.raw(b"", 5000)
        (refused,) = host.say(messages.enable)
        assert isinstance(refused, messages.Refused)
        assert refused.reason == messages.NO_HELLO


@examples(25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(garbage=st.binary(max_size=300))
def test_after_any_garbage_the_second_frame_is_understood(board: Board, garbage: bytes) -> None:
    board.unplug()
    board.plug()
    with Talk(board) as host:
        host.raw(b"", 5000)
        host.raw(garbage, 10.0 * len(garbage) + 1000.0)
        host.say(messages.hello, 2000)
        *_, identity = [said for said in host.say(messages.hello, 3000) if isinstance(said, messages.Identity)]
        assert identity.echo == host.sequence - 1
        assert board.state().motor_n == 0.0


def heard(port: serial.Serial, count: int) -> list[messages.Message | None]:
    """The next messages of a rig that has been asked for so many."""
    reader = FrameReader()
    found: list[bytes] = []
    while len(found) < count:
        found += reader.feed(port.read(1))
    return [messages.decode(message) for message in found]


def test_at_the_pace_of_frames_a_tick_is_a_millisecond_however_slow_the_host(
    start_board: Callable[[Pace, Kind], Board],
) -> None:
    board = start_board("patient", "uno")
    with serial.Serial(str(board.port), 1_000_000, timeout=60.0) as port:
        board.run(5000)
        last = -1
        greeting = framed(messages.hello(0))
        port.write(greeting)
        board.run(1000, len(greeting))  # what it answers takes more than a millisecond
        for tick in range(1, 50):
            said = heard(port, 1)[0]
            assert isinstance(said, messages.State if tick > 1 else messages.Identity)
            assert last < 0 or tick == 2 or 900 < said.time_us - last < 1100
            last = said.time_us
            port.write(framed(messages.poll(tick, 0)))


def test_at_the_pace_of_frames_those_of_a_host_that_was_late_are_heard_a_millisecond_apart(
    start_board: Callable[[Pace, Kind], Board],
) -> None:
    """At the speed of the line they would be too many for the receiver, and the watchdog would hear none behind."""
    board = start_board("patient", "uno")
    with serial.Serial(str(board.port), 1_000_000, timeout=60.0) as port:
        board.run(5000)
        port.write(framed(messages.hello(0)) + b"".join(framed(messages.poll(number, 0)) for number in range(1, 31)))
        states = [said for said in heard(port, 31) if isinstance(said, messages.State)]
    assert [state.echo for state in states] == list(range(1, 31))
    steps_us = [after.time_us - before.time_us for before, after in itertools.pairwise(states)]
    assert min(steps_us) > 900
    assert max(steps_us) < 1100


def test_in_real_time_the_motor_stops_when_the_host_falls_silent(start_board: Callable[[Pace, Kind], Board]) -> None:
    board = start_board("real", "uno")
    with serial.Serial(str(board.port), 1_000_000, timeout=0.01) as port:
        reader = FrameReader()
        sequence = 0
        states: list[messages.State] = []
        while not (states and states[-1].force_un == [1_000_000]):  # as often as a loaded machine needs
            for make in (messages.hello, messages.enable, lambda number: messages.force(number, 0, [1_000_000])):
                sequence += 1
                port.write(framed(make(sequence)))
            heard = [messages.decode(message) for message in reader.feed(port.read(200))]
            states += [said for said in heard if isinstance(said, messages.State)]
        while board.state().motor_n != 0.0:
            pass
        port.write(framed(messages.poll(sequence + 1, 0)))
        while states[-1].echo != sequence + 1:  # states from before it may still be on the line
            heard = [messages.decode(message) for message in reader.feed(port.read(200))]
            states += [said for said in heard if isinstance(said, messages.State)]
        assert states[-1].flags == messages.TRIPPED
