"""When the device is tared, calibrated or found again, every client is let go, and an event says so."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from hapticd.tick.guard import BLIND_RAMP_S
from hapticd.tick.remote.port import QUIET_S, Port, PortState
from tests.tick.remote.rig import COUPLING, FORCE_PORT, PERIOD_S, RAMP_S, Rig, update

FLOOR = '[[scene.objects]]\nname = "floor"\nshape = "plane"\nstiffness_n_per_m = 1000.0\nremote = true\n'
SCENES = {"tool": COUPLING, "field": FORCE_PORT, "floor": FLOOR}
QUIET_TICKS = round(QUIET_S / PERIOD_S)


def tared(rig: Rig) -> None:
    assert rig.tick.tare()
    rig.at = [0.0] * len(rig.at)


def calibrated(rig: Rig) -> None:
    """As after a calibration."""
    rig.tick.forget_origin()


def found(rig: Rig) -> None:
    """After a position that was none."""
    at_m = list(rig.sample.position_m)
    rig.sample.position_m[0] = math.nan
    rig.tick.advance(rig.sample, PERIOD_S)
    rig.sample.position_m[:] = at_m
    rig.go(ticks=round(BLIND_RAMP_S / PERIOD_S) + 1)


anew = pytest.mark.parametrize("act", [tared, calibrated, found])
each_kind = pytest.mark.parametrize("name", SCENES)


def talking(name: str) -> tuple[Rig, Port]:
    """A client that has said something just now, and a device that is disarmed."""
    rig = Rig(SCENES[name], axes="xyz", arm=False)
    say(rig, name)
    rig.go()
    port = rig[name]
    assert port.state is PortState.HELD
    return rig, port


def say(rig: Rig, name: str) -> None:
    rig.say(name, position_m=[0.0, 0.0, -1e-3], force_n=[0.0, 0.0, 1.0])


def news(port: Port) -> PortState | None:
    """What the loop takes and tells."""
    told, port.news = port.news, None
    return told


@anew
@each_kind
def test_what_a_client_drove_is_told_to_be_let_go_and_in_force_again_with_its_next_word(
    name: str, act: Callable[[Rig], None]
) -> None:
    rig, port = talking(name)
    assert news(port) is None
    act(rig)
    assert (port.state, port.seq) == (PortState.IDLE, -1)
    assert news(port) is PortState.STALE
    rig.go(ticks=50)
    assert news(port) is None
    say(rig, name)
    assert port.state is PortState.HELD
    assert news(port) is PortState.HELD


@anew
@each_kind
def test_it_is_told_once_a_second_at_most(name: str, act: Callable[[Rig], None]) -> None:
    rig, port = talking(name)
    act(rig)
    assert news(port) is PortState.STALE
    say(rig, name)
    assert news(port) is PortState.HELD
    rig.go(ticks=10)
    act(rig)
    assert news(port) is None
    rig.go(ticks=QUIET_TICKS)
    assert news(port) is PortState.STALE


@anew
@each_kind
def test_of_what_nobody_drove_nothing_is_told(name: str, act: Callable[[Rig], None]) -> None:
    rig, port = talking(name)
    port.take(update(rig.seq + 1, released=True))
    rig.go(ticks=round(RAMP_S / PERIOD_S))
    act(rig)
    assert news(port) is None
    say(rig, name)
    rig.go(ticks=round(port.limits.hold_s / PERIOD_S) + 1)
    assert news(port) is PortState.STALE
    act(rig)
    rig.go(ticks=2 * QUIET_TICKS)
    assert news(port) is None, "that it was silent was told already"


def test_an_object_that_is_gone_from_the_scene_tells_nothing() -> None:
    """Its client knows: the scene has it no more."""
    rig, port = talking("floor")
    rig.switch("")
    assert rig.ports == []
    assert news(port) is None
