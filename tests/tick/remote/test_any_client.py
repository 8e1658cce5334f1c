"""Whatever clients say, and whenever: the force is bounded, makes no step, and the books balance."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticd.tick.remote.follower import HASTE_PER_S
from hapticd.tick.remote.port import PortState
from hapticd.tick.remote.streamed_force import BLEND_S
from tests.tick.remote.rig import COUPLING, FORCE_PORT, MOST_N, PERIOD_S, PROMPT, RAMP_S, Rig, apart, length

K, B, FASTEST = 2000.0, 5.0, 1.0
BALL = """
[[scene.objects]]
name = "ball"
shape = "sphere"
radius_m = 0.03
stiffness_n_per_m = 2000.0
static_friction = 0.5
dynamic_friction = 0.4
remote = true
"""
ANY = st.floats(-1e308, 1e308) | st.sampled_from([0.0, -0.0, 1e-308, 5e-324, 1e308, -1e308])
NEAR = st.floats(-0.05, 0.05)
VECTOR = st.lists(ANY | NEAR, min_size=3, max_size=3)


@st.composite
def said(draw: st.DrawFn) -> dict[str, Any]:
    """One message, of any fields: the wire lets no NaN in, and nothing here has any other bound."""
    fields: dict[str, Any] = {}
    for name in ("position_m", "velocity_m_per_s", "angular_velocity_rad_per_s", "force_n"):
        if draw(st.booleans()):
            fields[name] = draw(VECTOR)
    for name in ("stiffness_n_per_m", "damping_n_s_per_m"):
        if draw(st.booleans()):
            fields[name] = draw(ANY)
    if draw(st.integers(0, 9)) == 0:
        fields["released"] = True
    return fields


MESSAGES = st.lists(
    st.tuples(st.integers(0, 10) | st.integers(90, 170), st.sampled_from(["tool", "field"]), said()),
    min_size=1,
    max_size=12,
)


@settings(max_examples=8, deadline=None)
@given(
    messages=MESSAGES,
    law=st.sampled_from(["none", "tdpa", "late-cycle", "ring-damping"]),
    shake=st.booleans(),
    soft=st.booleans(),
)
def test_each_port_stays_within_its_limit_and_the_books_balance(
    messages: list[tuple[int, str, dict[str, Any]]], law: str, shake: bool, soft: bool
) -> None:
    rig = Rig(COUPLING + ("come_in_s = 0.07\n" if soft else PROMPT) + FORCE_PORT, law=law, axes="xyz")
    n = 0
    for wait, name, fields in messages:
        rig.say(name, **fields)
        for _ in range(wait + 1):
            n += 1
            rig.go([3e-3 * math.sin(0.05 * n), 2e-3 * math.cos(0.11 * n), 0.0] if shake else None)
            for port, most_n in (("tool", MOST_N), ("field", 3.0)):
                assert length(rig[port].force_n) <= most_n
                assert all(map(math.isfinite, (*rig[port].target_m, *rig[port].impulse_n_s, rig[port].work_j)))
    assert rig.tick.fault == 0
    assert rig.unbalanced_j() < 1e-9 * max(1.0, abs(rig.energy_j))


@settings(max_examples=8, deadline=None)
@given(messages=MESSAGES)
def test_on_a_device_at_rest_no_force_steps(messages: list[tuple[int, str, dict[str, Any]]]) -> None:
    """Without a law: what clients do changes a force by its ramps, the target's motion and the blend of a force."""
    rig = Rig(COUPLING + FORCE_PORT, axes="xyz")
    ramp = PERIOD_S / RAMP_S
    most_n = {
        # a ramp of the whole, one of stiffness and damping, and the motion of the target
        "tool": (2.0 * MOST_N + B * FASTEST) * ramp + (K + HASTE_PER_S * B) * FASTEST * PERIOD_S,
        "field": 3.0 * (ramp + PERIOD_S / BLEND_S),
    }
    for wait, name, fields in messages:
        rig.say(name, **fields)
        for _ in range(wait + 1):
            before = {port: list(rig[port].force_n) for port in most_n}
            rig.go()
            for port, step_n in most_n.items():
                assert apart(rig[port].force_n, before[port]) <= step_n * (1.0 + 1e-9)


@settings(max_examples=8, deadline=None)
@given(messages=MESSAGES, turns=st.lists(st.lists(ANY, min_size=4, max_size=4), min_size=12, max_size=12))
def test_an_object_goes_no_faster_than_its_limit_and_the_books_balance(
    messages: list[tuple[int, str, dict[str, Any]]], turns: list[list[float]]
) -> None:
    rig = Rig(BALL, law="energy-cycle", axes="xyz")
    n = 0
    for (wait, _, fields), orientation in zip(messages, turns, strict=False):
        rig.say("ball", orientation=orientation, **fields)
        for _ in range(min(wait, 40) + 1):
            n += 1
            before = list(rig["ball"].target_m)
            rig.go([2e-3 * math.sin(0.05 * n), 0.0, 0.03 + 1e-3 * math.cos(0.11 * n)])
            assert apart(rig["ball"].target_m, before) <= FASTEST * PERIOD_S * (1.0 + 1e-9)
            assert length(rig.force) <= 12.0 * (1.0 + 1e-12)
    assert rig.tick.fault == 0
    assert rig.unbalanced_j() < 1e-9


PAUSES = st.lists(
    st.tuples(st.sampled_from([1, 40, 130, 170, 400, 900, 1300]), st.booleans(), st.integers(0, 9)),
    min_size=1,
    max_size=12,
)


@settings(max_examples=8, deadline=None)
@given(pauses=PAUSES, ends=st.booleans(), apart_ticks=st.sampled_from([1, 5]))
def test_what_was_told_last_is_true_in_the_end_and_nothing_is_told_more_than_once_a_second(
    pauses: list[tuple[int, bool, int]], ends: bool, apart_ticks: int
) -> None:
    """Of a client that talks and pauses, and in the end talks on or is silent for good."""
    rig = Rig(COUPLING + FORCE_PORT + BALL, axes="xyz", nominal_rate_hz=1000.0 / apart_ticks)
    told: dict[str, list[tuple[int, PortState]]] = {port.name: [] for port in rig.ports}
    n = 0

    def go(ticks: int, talks: bool, released: bool = False) -> None:
        nonlocal n
        for _ in range(ticks):
            n += 1
            for port in rig.ports:
                if talks and n % 20 == 0:
                    rig.say(port.name, position_m=[0.0, 0.0, 1.0], force_n=[0.001 * (n % 400), 0.0, 0.0])
                elif released:
                    rig.say(port.name, released=True)
            rig.repeat() if n % apart_ticks else rig.go(dt_s=apart_ticks * PERIOD_S)
            for port in rig.ports:
                if port.news is not None:
                    told[port.name].append((n, port.news))
                    port.news = None
            released = False

    go(100, talks=True)
    for ticks, talks, number in pauses:
        go(ticks, talks, released=number == 0)
    go(100, talks=True)
    go(1500, talks=not ends)
    for port in rig.ports:
        events = told[port.name]
        assert port.state is (PortState.STALE if ends else PortState.HELD)
        assert (events[-1][1] if events else PortState.HELD) is port.state
        for each in (PortState.STALE, PortState.HELD):
            times = [at for at, state in events if state is each]
            assert all(later - at >= 1000 - apart_ticks for at, later in pairwise(times))
        assert [state for _, state in events] == [PortState.STALE, PortState.HELD] * (len(events) // 2) + (
            [PortState.STALE] if len(events) % 2 else []
        )


@pytest.mark.parametrize(
    "law", ["none", "damper", "tdpa", "energy-cycle", "late-cycle", "ring-damping", "energy-bounding"]
)
def test_every_law_bears_a_target_on_the_device(law: str) -> None:
    """Length 0, in contact: a law that divides by its depth does not find 0 there."""
    rig = Rig(COUPLING, law=law, axes="xyz")
    for n in range(300):
        rig.say("tool", position_m=[0.0, 0.0, 0.0])
        rig.go([0.0, 0.0, 1e-3 if n % 60 > 30 else 0.0])
    assert rig.tick.fault == 0
