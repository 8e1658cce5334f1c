"""What clients drive has no past once it was let go, or the device knows its place anew; and no axis is another one."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from hapticd.tick.contact import RunningLaw
from hapticd.tick.remote.one_port import OUTSIDE_S
from hapticd.tick.remote.port import PortState
from tests.tick.remote.rig import COUPLING, FORCE_PORT, PERIOD_S, RAMP_S, Rig, update
from tests.tick.rig import law

BALL = """
[[scene.objects]]
name = "ball"
shape = "sphere"
radius_m = 0.01
position_m = [0.0, 0.0, -0.01]
stiffness_n_per_m = 1500.0
static_friction = 0.5
dynamic_friction = 0.4
remote = true
"""
SCENE = COUPLING + FORCE_PORT + BALL
Signs = tuple[float, float, float]
PLAIN: Signs = (1.0, 1.0, 1.0)


def talk(
    rig: Rig,
    ticks: int,
    seed: int,
    order: Sequence[int] = (0, 1, 2),
    signs: Signs = PLAIN,
    ports: Sequence[str] = ("tool", "field", "ball"),
) -> list[list[Any]]:
    """Clients that say this and that, and a device that moves; what each port gives a tick, without sums."""
    draw = random.Random(seed).random

    def vector(most: float) -> list[float]:
        made = [most * (2.0 * draw() - 1.0) for _ in range(3)]
        return [sign * made[axis] for axis, sign in zip(order, signs, strict=True)]

    before = {name: list(rig[name].impulse_n_s) for name in ports}
    given = []
    for n in range(ticks):
        for name in ports:
            if draw() < 0.1 and n % 200 < 150:
                said: dict[str, Any] = {"force_n": vector(4.0)} if name == "field" else {"position_m": vector(0.004)}
                if name != "field" and draw() < 0.4:
                    said["velocity_m_per_s"] = vector(0.05)
                if name != "field" and draw() < 0.3:
                    said["stiffness_n_per_m"] = 2500.0 * draw()
                rig[name].take(update(n, released=draw() < 0.03, **said))
        place = [0.004 * math.sin(0.05 * n), 0.003 * math.cos(0.04 * n) - 0.003, 0.002 * math.sin(0.07 * n)]
        rig.go([sign * place[axis] for axis, sign in zip(order, signs, strict=True)])
        for name in ports:
            port = rig[name]
            impulse = [now - was for now, was in zip(port.impulse_n_s, before[name], strict=True)]
            numbers, vectors = _shown(port)
            given.append([[port.state is PortState.HELD, port.seq, *numbers], list(port.force_n), impulse, *vectors])
    return given


def _shown(port: Any) -> tuple[list[float], list[list[float]]]:
    """What is in force of it while it is, and what the laws of its axes are shown, one list a quantity."""
    if not hasattr(port, "weight") or not port.channels[0].in_contact:
        return [], []
    names = ("x_m", "moved_m", "velocity_m_per_s", "contact_n", "spring_n", "applied_n", "applied_contact_n")
    shown = [[getattr(channel.tick, name) for channel in port.channels] for name in names]
    numbers = [port.weight, port.scale, port.most_n, port.limit_n, port.law_values()[0]]
    return numbers, [list(port.target_m), *shown]


def let_go(rig: Rig) -> None:
    """By their clients, and time for every ramp."""
    for port in rig.ports:
        port.take(update(0, released=True))
    rig.go([0.0, 0.0, 0.0], ticks=round(2.0 * RAMP_S / PERIOD_S) + 5)


def begun_anew(rig: Rig) -> None:
    """As after a calibration."""
    rig.tick.release()
    rig.go(ticks=round(RAMP_S / PERIOD_S) + 1)
    rig.sample.position_m[:] = [0.0, 0.0, 0.0]
    rig.at = [0.0, 0.0, 0.0]
    rig.tick.start(rig.sample)
    rig.tick.arm()


def close(one: Any, other: Any) -> bool:
    return bool(other == pytest.approx(one, rel=1e-9, abs=1e-11))


@pytest.mark.parametrize(("end", "ports"), [(let_go, ("tool", "field")), (begun_anew, ("tool", "field"))])
def test_what_was_let_go_comes_back_as_it_came_at_first(end: Callable[[Rig], None], ports: Sequence[str]) -> None:
    fresh, used = Rig(SCENE, axes="xyz"), Rig(SCENE, axes="xyz")
    talk(used, 333, seed=1, ports=ports)
    used.tick.guard.clear()
    end(used)
    assert all(port.asleep for port in used.tick.couplings)
    assert all(list(port.force_n) == [0.0] * 3 for port in used.ports)
    for number, (one, other) in enumerate(
        zip(talk(fresh, 300, seed=2, ports=ports), talk(used, 300, seed=2, ports=ports), strict=True)
    ):
        assert len(one) == len(other), number
        for a, b in zip(one, other, strict=True):
            assert close(a, b), number


@pytest.mark.parametrize(
    ("name", "order", "signs"),
    [
        ("tdpa", (2, 0, 1), PLAIN),
        ("tdpa", (1, 0, 2), (1.0, -1.0, 1.0)),
        ("none", (0, 1, 2), (-1.0, -1.0, -1.0)),
    ],
)
def test_every_axis_of_a_port_is_like_the_others_and_either_way_along_it(
    name: str, order: Sequence[int], signs: Signs
) -> None:
    ports = ("tool", "field")
    plain, turned = (Rig(COUPLING + FORCE_PORT, name, axes="xyz") for _ in range(2))
    given = talk(plain, 250, seed=7, ports=ports)
    for number, (one, other) in enumerate(zip(given, talk(turned, 250, 7, order, signs, ports), strict=True)):
        assert close(one[0], other[0]), number
        assert len(one) == len(other)
        for a, b in zip(one[1:], other[1:], strict=True):
            expected = [sign * a[axis] for axis, sign in zip(order, signs, strict=True)]
            assert close(expected, b), number


@pytest.mark.parametrize("port", ["tool", "field"])
def test_a_law_that_keeps_time_is_asked_for_half_a_second_after_its_port_was_let_go_and_no_longer(port: str) -> None:
    """Each time."""
    asked = 0

    def step(_state: Any, _params: Any, tick: Any) -> float:
        nonlocal asked
        if not tick.in_contact:
            asked += 1
            assert tick.x_m > 0.0
            assert (tick.moved_m, tick.velocity_m_per_s, tick.spring_n, tick.contact_n) == (0.0, 0.0, 0.0, 0.0)
        return float(tick.contact_n)

    rig = Rig(COUPLING + FORCE_PORT)
    module = law(step)
    for channel in rig[port].channels:
        channel.law = RunningLaw(module, module.Params())
    for _ in range(2):
        said = {"position_m": [1e-3]} if port == "tool" else {"force_n": [1.0]}
        rig.say(port, **said)
        rig.go(ticks=40)
        rig[port].take(update(9, released=True))
        asked = 0
        rig.go(ticks=1000)
        assert asked == pytest.approx(OUTSIDE_S / PERIOD_S, abs=3)
        assert rig[port].asleep


@pytest.mark.parametrize("most", [1e100, 1e200, 1e307])
def test_a_force_of_any_size_keeps_its_direction(most: float) -> None:
    rig = Rig(FORCE_PORT, axes="xyz")
    for _ in range(100):
        rig.say("field", force_n=[0.6 * most, 0.0, -0.8 * most])
        rig.go()
    assert rig.force == pytest.approx([1.8, 0.0, -2.4])
