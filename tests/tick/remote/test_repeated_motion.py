"""A message that says something else repeats how things move, and the motion goes on as it was."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest

from hapticd.config.ports import PortLimits
from hapticd.remote.leased_port import LeasedPort, Sender
from tests.tick.remote.rig import COUPLING, Rig, apart

CLIENT = Sender(b"one", 7, 70, True, "user 1000, process 1")
SPEED_M_PER_S = 0.2
EVERY = 80
BALL = """
[[scene.objects]]
name = "ball"
shape = "box"
size_m = [0.02, 0.02, 0.02]
position_m = [0.0, 0.0, -0.2]
stiffness_n_per_m = 1000.0
remote = true
hold_s = 0.1
max_speed_m_per_s = 1.0
"""


class Client:
    """What a client says goes to the loop by the way that it goes in the daemon."""

    def __init__(self, rig: Rig, name: str) -> None:
        self.port = rig[name]
        limits: PortLimits = self.port.limits
        self.leased = LeasedPort(limits, 1.0)
        self.seq = 0
        self.tick = 0
        self.axes = len(rig.at)

    def say(self, **fields: Any) -> int:
        self.seq += 1
        self.tick += 1
        assert self.leased.take({"seq": self.seq, **fields}, CLIENT, self.axes, self.tick)
        self.port.take(self.leased.update)
        return self.seq


def along(x_m: float) -> list[float]:
    return [x_m, 0.0, -0.2]


@pytest.mark.parametrize("alone", [True, False], ids=["of the spring alone", "that repeats everything"])
@pytest.mark.parametrize("name", ["tool", "ball"])
def test_a_change_of_the_spring_throws_no_moving_target_back(name: str, alone: bool) -> None:
    """12.5 messages a second, 0.2 m/s: it went back by 7.8 mm, and the force from 3.1 N to -0.1 N and to 6 N."""
    rig = Rig((COUPLING if name == "tool" else "") + (BALL if name == "ball" else ""), axes="xyz")
    client = Client(rig, name)
    moved = 0
    ways_m, before_m = [], list(client.port.target_m)
    for tick in range(10 * EVERY):
        motion = {"position_m": along(SPEED_M_PER_S * tick * 1e-3), "velocity_m_per_s": [SPEED_M_PER_S, 0.0, 0.0]}
        if tick % EVERY == 0:
            said = motion
            moved = client.say(**motion)
        elif tick % EVERY == 40 and tick > 4 * EVERY:
            client.say(stiffness_n_per_m=400.0 + 0.5 * tick, **({} if alone else {**said, "moved_seq": moved}))
        rig.go(along(SPEED_M_PER_S * tick * 1e-3) if name == "tool" else [0.5, 0.5, 0.5])
        if tick > 3 * EVERY:
            ways_m.append(client.port.target_m[0] - before_m[0])
        before_m = list(client.port.target_m)
    assert client.port.seq == client.seq
    assert ways_m == pytest.approx([SPEED_M_PER_S * 1e-3] * len(ways_m), rel=1e-6)


def test_another_velocity_alone_goes_on_from_where_the_target_has_come_to() -> None:
    rig = Rig(COUPLING, axes="x")
    client = Client(rig, "tool")
    client.say(position_m=[0.01])
    rig.go([0.0], 5)
    assert client.port.target_m[0] < 0.005, "it is still under way"
    client.say(velocity_m_per_s=[-SPEED_M_PER_S])
    rig.go([0.0], 50)
    assert client.port.target_m[0] == pytest.approx(0.01 - 50e-3 * SPEED_M_PER_S, abs=1e-6)


def test_a_motion_said_anew_counts_where_it_is_the_same_too() -> None:
    """As of a client that says with each message that its target is here, now."""
    rig = Rig(COUPLING, axes="x")
    client = Client(rig, "tool")
    for _ in range(20):
        client.say(position_m=[0.0], velocity_m_per_s=[SPEED_M_PER_S])
        rig.go([0.0], 10)
        assert client.port.target_m[0] <= 1.1 * 10e-3 * SPEED_M_PER_S


def test_a_velocity_that_only_repeats_ends_with_its_time() -> None:
    """`hold_s` after it was said, however often a message repeats it."""
    rig = Rig(COUPLING + "hold_s = 0.1\n", axes="x")
    client = Client(rig, "tool")
    moved = client.say(position_m=[0.0], velocity_m_per_s=[SPEED_M_PER_S])
    for _ in range(50):
        rig.go([0.0], 10)
        client.say(position_m=[0.0], velocity_m_per_s=[SPEED_M_PER_S], moved_seq=moved)
    assert client.port.target_m[0] == pytest.approx(0.1 * SPEED_M_PER_S, rel=1e-3)


@pytest.mark.parametrize("alone", [True, False], ids=["of the spring alone", "that repeats everything"])
def test_an_object_turns_on(alone: bool) -> None:
    rig = Rig(BALL, axes="xyz")
    client = Client(rig, "ball")
    rate_rad_per_s, turned = 2.0, []
    for tick in range(400):
        angle = 0.5 * rate_rad_per_s * tick * 1e-3
        if tick % EVERY == 0:
            said = {
                "orientation": [math.cos(angle), 0.0, 0.0, math.sin(angle)],
                "angular_velocity_rad_per_s": [0.0, 0.0, rate_rad_per_s],
            }
            moved = client.say(**said)
        elif tick % EVERY == 40:
            client.say(stiffness_n_per_m=400.0, **({} if alone else {**said, "moved_seq": moved}))
        rig.go([0.5, 0.5, 0.5])
        turned.append(2.0 * math.atan2(client.port.turning.now[3], client.port.turning.now[0]))
    steps = [later - one for one, later in pairwise(turned[200:])]
    assert steps == pytest.approx([rate_rad_per_s * 1e-3] * len(steps), rel=1e-3)


def test_another_rate_alone_turns_on_from_where_it_was_to_come() -> None:
    """What is left of the way to an orientation is not forgotten."""
    rig = Rig(BALL, axes="xyz")
    client = Client(rig, "ball")
    half = math.sin(0.25)
    goal = [math.cos(0.25), half, 0.0, 0.0]
    client.say(orientation=goal)
    rig.go([0.5, 0.5, 0.5], 3)
    assert apart(client.port.turning.now, goal) > 0.1, "it is still under way"
    client.say(angular_velocity_rad_per_s=[0.0, 0.0, 0.0])
    rig.go([0.5, 0.5, 0.5], 300)
    assert apart(client.port.turning.now, goal) < 1e-6


def test_what_a_port_has_forgotten_is_taken_from_the_next_message_that_repeats_it() -> None:
    """As after the device was lost: a client whose target stands says only that it is there."""
    rig = Rig(COUPLING, axes="x")
    client = Client(rig, "tool")
    moved = client.say(position_m=[0.01])
    rig.go([0.0], 100)
    rig.tick.start(rig.sample)
    client.say(position_m=[0.01], moved_seq=moved, stiffness_n_per_m=500.0)
    rig.go([0.0], 100)
    assert client.port.target_m[0] == pytest.approx(0.01, rel=1e-6)


@pytest.mark.parametrize(("after_ticks", "gone_s"), [(50, 0.05), (95, 0.095), (300, 0.1)])
@pytest.mark.parametrize("name", ["tool", "ball"])
def test_a_place_that_is_said_again_is_where_its_velocity_has_taken_it(
    name: str, after_ticks: int, gone_s: float
) -> None:
    """As after the device was lost: the target began again where it was said to be long before."""
    rig = Rig((COUPLING if name == "tool" else "") + (BALL if name == "ball" else ""), axes="xyz")
    client = Client(rig, name)
    motion = {"position_m": along(0.0), "velocity_m_per_s": [SPEED_M_PER_S, 0.0, 0.0]}
    moved = client.say(**motion)
    rig.go([0.5, 0.5, 0.5], after_ticks)
    rig.tick.start(rig.sample)
    client.tick += after_ticks * 1_000_000
    client.say(**motion, moved_seq=moved)
    rig.go([0.5, 0.5, 0.5])
    assert client.port.follower.goal_m[0] == pytest.approx(SPEED_M_PER_S * gone_s, abs=1.1 * SPEED_M_PER_S * 1e-3)
    rig.go([0.5, 0.5, 0.5], 1000 if name == "ball" else 90)
    assert client.port.follower.goal_m[0] == pytest.approx(SPEED_M_PER_S * 0.1, rel=1e-6)


def test_an_orientation_that_is_said_again_has_turned_on() -> None:
    rig = Rig(BALL, axes="xyz")
    client = Client(rig, "ball")
    motion = {"orientation": [1.0, 0.0, 0.0, 0.0], "angular_velocity_rad_per_s": [0.0, 0.0, 2.0]}
    moved = client.say(**motion)
    rig.go([0.5, 0.5, 0.5], 300)
    rig.tick.start(rig.sample)
    client.tick += 300_000_000
    client.say(**motion, moved_seq=moved)
    for _ in range(300):
        rig.go([0.5, 0.5, 0.5])
        assert apart(client.port.turning.now, [math.cos(0.1), 0.0, 0.0, math.sin(0.1)]) < 1e-6
