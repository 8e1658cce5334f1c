"""A force that stood too long, and what its client has to do to be believed again."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from hapticd.remote.leased_port import LeasedPort, Sender
from hapticd.tick.remote.port import PortState
from tests.tick.remote.rig import FORCE_PORT, Rig, update


def hung() -> Rig:
    """A client that has sent the same force for longer than a second."""
    rig = Rig(FORCE_PORT)
    for _ in range(150):
        rig.say("field", force_n=[1.0])
        rig.go(ticks=10)
    assert rig["field"].state is PortState.STALE
    return rig


def test_the_same_force_is_not_believed_again_and_another_one_is() -> None:
    rig = hung()
    states = []
    for newton in (1.0, 1.1):
        rig.say("field", force_n=[newton])
        states.append(rig["field"].state)
    assert states == [PortState.STALE, PortState.HELD]


def test_after_letting_go_the_same_force_is_a_new_one() -> None:
    """The next client may well want what the one before it wanted."""
    rig = hung()
    rig["field"].take(update(rig.seq + 1, released=True))
    rig.go(ticks=100)
    assert rig.force == [0.0]
    for _ in range(10):
        rig.say("field", force_n=[1.0])
        rig.go(ticks=10)
    assert rig.force == [1.0]


def test_another_client_may_say_the_same_force_as_one_that_hung() -> None:
    """The next program, after one that was killed, pushed with nothing until it said another force."""
    rig = Rig(FORCE_PORT)
    port = rig["field"]
    process = LeasedPort(port.limits, 1.0)
    states = []
    for name, at_s in ((b"one", 0), (b"two", 10)):
        client = Sender(name, 7, 70, True, "user 1000, process 1")
        for number in range(150):
            process.take({"seq": number, "force_n": [1.0]}, client, 1, at_s * 10**9 + number * 10**7)
            port.take(process.update)
            rig.go(ticks=10)
            states.append(port.state)
        rig.go(ticks=100)
        assert rig.force == [0.0]
    assert (states[98], states[149]) == (PortState.HELD, PortState.STALE)
    assert states[150:] == states[:150]


def released(rig: Rig) -> None:
    """By its client."""
    rig["field"].take(update(rig.seq + 1, released=True))


def begun_anew(rig: Rig) -> None:
    """As after a calibration."""
    rig.tick.start(rig.sample)


@pytest.mark.parametrize("end", [released, begun_anew])
def test_how_long_a_force_may_stand_counts_from_its_own_beginning(end: Callable[[Rig], None]) -> None:
    rig = Rig(FORCE_PORT)
    for _ in range(2):
        for _ in range(98):
            rig.say("field", force_n=[1.0])
            rig.go(ticks=10)
            assert rig["field"].state is PortState.HELD
        end(rig)
        assert rig["field"].state is not PortState.HELD
        rig.go(ticks=5)
