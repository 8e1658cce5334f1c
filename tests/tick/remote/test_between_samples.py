"""A device whose samples are further apart than the ticks: a coupling goes on at every tick all the same."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Sequence
from itertools import chain, cycle, pairwise
from typing import Any

import pytest

from hapticd.tick.contact import RunningLaw
from hapticd.tick.remote.follower import HASTE_PER_S
from hapticd.tick.remote.port import PortState
from tests.tick.remote.rig import COUPLING, PERIOD_S, PROMPT, RAMP_S, WALL, Rig, update
from tests.tick.rig import law

K, B = 2000.0, 5.0
OFF_M = 2e-3
RAMP_TICKS = round(RAMP_S / PERIOD_S)
FOLLOW_N_PER_S = (K + HASTE_PER_S * B) * 1.0
"""What the target's way changes the force by, at most [N/s]."""
COME_IN = "come_in_s = 0.2\n"
UNEVEN = [random.Random(9).randint(1, 30) for _ in range(400)]
GAPS: dict[str, list[int]] = {"2 ms": [2], "5 ms": [5], "20 ms": [20], "uneven": UNEVEN}

every_gap = pytest.mark.parametrize("gaps", GAPS.values(), ids=GAPS)


class Slow:
    """A rig whose device has news only now and then, and a client that says the same at every tick.

    Args:
        scene: of the rig.
        gaps: ticks from one sample to the next, again and again.
        clock: what the device's own clock says of the time that the loop has counted [s].
        options: of the rig.
    """

    def __init__(
        self, scene: str, gaps: Sequence[int], clock: Callable[[float], float] = lambda dt_s: dt_s, **options: Any
    ) -> None:
        self.rig = Rig(scene, nominal_rate_hz=1000.0 / max(gaps), **options)
        self.clock = clock
        self.due: Iterator[bool] = chain.from_iterable([*[False] * (gap - 1), True] for gap in cycle(gaps))
        self.waited = 0
        self.saw = False
        assert self.rig["tool"].asleep

    def first(self, **said: Any) -> Slow:
        """Have the client's first word come just before a sample: with that one it begins."""
        self.rig.say("tool", **said)
        self.rig.go()
        return self

    def run(self, ticks: int, at_m: float = 0.0, **said: Any) -> list[float]:
        """The force, tick by tick, while the client says this; nothing: it is silent."""
        force = []
        for _ in range(ticks):
            if said:
                self.rig.say("tool", **said)
            self.waited += 1
            self.saw = next(self.due)
            if self.saw:
                force += self.rig.go([at_m], dt_s=self.clock(self.waited * PERIOD_S))
                self.waited = 0
            else:
                force += self.rig.repeat()
        return force

    def to_sample(self) -> None:
        """Go on until a sample has just been seen."""
        self.run(1)
        while not self.saw:
            self.run(1)


def everything(slow: Slow) -> list[float]:
    """Coming in, targets that stand and move, other springs and dampers, limits, silence, a client that lets go."""
    rig = slow.first(position_m=[OFF_M]).rig
    force = slow.run(250, position_m=[OFF_M])
    force += slow.run(7, position_m=[OFF_M], stiffness_n_per_m=200.0)  # and changed again on the way
    force += slow.run(113, position_m=[OFF_M], stiffness_n_per_m=800.0)
    force += slow.run(60, position_m=[-OFF_M], velocity_m_per_s=[0.03], damping_n_s_per_m=1.0)
    force += slow.run(73, position_m=[0.02], damping_n_s_per_m=4.0, stiffness_n_per_m=K)
    rig.switch(COUPLING.replace("max_force_n = 6.0", "max_force_n = 4.0") + COME_IN)
    force += slow.run(131, position_m=[0.02])
    force += slow.run(111)  # silent for longer than `hold_s`, and back before it was let go
    force += slow.run(90, position_m=[OFF_M])
    rig["tool"].take(update(rig.seq + 1, released=True))
    return force + slow.run(RAMP_TICKS + 20)


@every_gap
@pytest.mark.parametrize("clock", [lambda dt_s: dt_s, lambda dt_s: 0.93 * dt_s if dt_s > PERIOD_S else dt_s])
def test_on_a_device_at_rest_the_force_is_at_every_tick_what_it_is_with_a_sample_at_each(
    gaps: list[int], clock: Callable[[float], float]
) -> None:
    """Whatever the device's own clock says of the time between."""
    expected = everything(Slow(COUPLING + COME_IN, [1]))
    assert max(map(abs, expected)) > 4.0
    assert everything(Slow(COUPLING + COME_IN, gaps, clock)) == pytest.approx(expected, rel=1e-6, abs=1e-9)


def largest_step(force: Sequence[float]) -> float:
    return max(abs(after - before) for before, after in pairwise(force))


@every_gap
def test_a_softer_spring_comes_by_the_ramp(gaps: list[int]) -> None:
    slow = Slow(COUPLING + PROMPT, gaps).first(position_m=[OFF_M])
    force = slow.run(150, position_m=[OFF_M])[-1:]
    force += slow.run(150, position_m=[OFF_M], stiffness_n_per_m=200.0)
    assert force[0] - force[-1] == pytest.approx(1800.0 * OFF_M)
    assert largest_step(force) == pytest.approx(1800.0 * OFF_M / RAMP_TICKS)


@every_gap
def test_a_softer_damper_comes_by_the_ramp_on_a_device_that_moves(gaps: list[int]) -> None:
    slow = Slow(COUPLING + PROMPT, gaps).first(position_m=[0.0], stiffness_n_per_m=0.0)
    force = []
    for tick in range(1, 381):
        damping = B if tick <= 230 else 0.0
        force += slow.run(1, 5e-5 * tick, position_m=[0.0], stiffness_n_per_m=0.0, damping_n_s_per_m=damping)
    force = force[229:]
    assert force[0] == pytest.approx(-B * 0.05)
    assert force[-1] == pytest.approx(0.0, abs=1e-12)
    assert largest_step(force) == pytest.approx(B * 0.05 / RAMP_TICKS, rel=1e-6)


@every_gap
def test_one_that_is_gone_from_the_scene_fades_out_by_the_ramp(gaps: list[int]) -> None:
    slow = Slow(COUPLING + PROMPT + WALL.replace("position_m = 0.0", "position_m = -0.1"), gaps)
    force = slow.first(position_m=[OFF_M]).run(150, position_m=[OFF_M])[-1:]
    slow.rig.say("tool", position_m=[OFF_M], stiffness_n_per_m=200.0)
    slow.rig.switch(WALL.replace("position_m = 0.0", "position_m = -0.1"))
    force += slow.run(RAMP_TICKS + 40)
    assert force[0] == pytest.approx(K * OFF_M)
    assert force[-1] == 0.0
    assert largest_step(force) <= (1.0 + 1800.0 / K) * K * OFF_M / RAMP_TICKS + 1e-9


@pytest.mark.parametrize("law", ["none", "late-cycle", "ring-damping", "tdpa", "energy-cycle"])
@every_gap
def test_what_a_law_adds_stays_and_the_rest_goes_on_under_it(gaps: list[int], law: str) -> None:
    slow = Slow(COUPLING + PROMPT, gaps, law=law).first(position_m=[OFF_M])
    force = slow.run(200, position_m=[OFF_M])[-1:]
    force += slow.run(200, position_m=[OFF_M], stiffness_n_per_m=200.0)
    assert force[-1] == pytest.approx(200.0 * OFF_M)
    assert largest_step(force) == pytest.approx(1800.0 * OFF_M / RAMP_TICKS)
    assert slow.rig["tool"].stiffness.now == pytest.approx(200.0)


@every_gap
def test_who_speaks_again_just_after_it_was_let_go_comes_in_anew_from_where_the_device_is(gaps: list[int]) -> None:
    """Also before the next sample."""
    slow = Slow(COUPLING + COME_IN, gaps).first(position_m=[OFF_M])
    slow.run(250, position_m=[OFF_M])
    slow.rig["tool"].take(update(slow.rig.seq + 1, released=True))
    while slow.rig.force != [0.0]:
        slow.run(1)
    before = max(gaps)
    force = [0.0, *slow.run(before, position_m=[OFF_M])]
    assert slow.rig["tool"].state is PortState.HELD
    force += slow.run(300, position_m=[OFF_M])
    assert largest_step(force) <= 2.0 * K * OFF_M / RAMP_TICKS
    for tick in range(before, 180):
        assert force[tick] <= K * OFF_M * (tick + 1) / 200
    assert force[-1] == pytest.approx(K * OFF_M)


@every_gap
def test_what_the_client_does_between_samples_is_its_work_as_with_a_sample_at_each_tick(gaps: list[int]) -> None:
    found = []
    for each in ([1], gaps):
        slow = Slow(COUPLING + COME_IN, each)
        everything(slow)
        slow.to_sample()
        ledger = slow.rig["tool"].books.ledger
        books = slow.rig["tool"].books
        found.append([books.moved_j, books.carried_j, ledger.dissipated_j, ledger.generated_j, ledger.stored_j])
        assert slow.rig.unbalanced_j() < 1e-12
    assert found[1] == pytest.approx(found[0], rel=1e-6, abs=1e-12)
    assert found[0][1] > 1e-4


@every_gap
@pytest.mark.parametrize("law", ["none", "tdpa", "late-cycle"])
@pytest.mark.parametrize("driven", [False, True])
def test_the_books_balance_at_every_tick_of_a_device_that_moves(gaps: list[int], law: str, driven: bool) -> None:
    draw = random.Random(3).random
    slow = Slow(COUPLING + COME_IN + f"driven = {str(driven).lower()}\n", gaps, law=law).first(position_m=[0.0])
    tick = 0
    for _ in range(60):
        said: dict[str, Any] = {
            "position_m": [0.004 * draw()],
            "stiffness_n_per_m": K * draw(),
            "damping_n_s_per_m": B * draw(),
        }
        if draw() < 0.8:
            for _ in range(round(20 * draw())):
                tick += 1
                at_m = 2e-3 * math.sin(0.02 * tick)
                slow.run(1, at_m, **said)
                assert slow.rig.unbalanced_j() < 1e-9
        else:
            slow.run(round(170 * draw()))
        if draw() < 0.1:
            slow.rig.tick.release()
            slow.run(30, **said)
            slow.rig.tick.arm()
    assert slow.rig.tick.fault == 0
    assert abs(slow.rig.energy_j) > 1e-5


@every_gap
@pytest.mark.parametrize("driven", [False, True])
def test_a_law_is_shown_each_sample_once_and_all_of_the_way_since_the_one_before(gaps: list[int], driven: bool) -> None:
    shown = []

    def step(_state: Any, _params: Any, tick: Any) -> float:
        shown.append((tick.moved_m, tick.dt_s, tick.x_m, tick.spring_n))
        return float(tick.contact_n)

    slow = Slow(COUPLING + COME_IN + f"driven = {str(driven).lower()}\n", gaps)
    module = law(step)
    (channel,) = slow.rig["tool"].channels
    channel.law = RunningLaw(module, module.Params())
    slow.first(position_m=[0.0])
    seen = 1
    for tick in range(300):
        slow.run(1, 1e-5 * tick, position_m=[OFF_M], velocity_m_per_s=[0.02])
        seen += slow.saw
        assert len(shown) == seen
    slow.to_sample()
    target_m = slow.rig["tool"].target_m[0]
    way_m = slow.rig.at[0] - (target_m if driven else 0.0)
    assert target_m > OFF_M
    assert sum(moved_m for moved_m, *_ in shown) == pytest.approx(way_m)
    assert shown[-1][2] == pytest.approx(slow.rig.at[0] - target_m)
    assert sum(dt_s for _, dt_s, *_ in shown[1:]) == pytest.approx(slow.rig.sample.time_ns * 1e-9 - PERIOD_S)


def test_in_ticks_in_which_no_time_passes_nothing_goes_on() -> None:
    """A real device, on a computer whose clock stood still: such a tick counts for a nanosecond."""
    rig = Rig(COUPLING + PROMPT, simulated=False)
    for _ in range(200):
        rig.say("tool", position_m=[OFF_M])
        rig.go()
    rig.say("tool", position_m=[-OFF_M], stiffness_n_per_m=200.0)
    for _ in range(5):
        rig.tick.advance(rig.sample, 0.0)
    rig.sample.time_ns += 1_000_000
    assert list(rig.tick.advance(rig.sample, 0.0)) == pytest.approx([K * OFF_M], abs=FOLLOW_N_PER_S * 6e-9)
    assert rig["tool"].target_m == pytest.approx([OFF_M])
    assert rig.tick.fault == 0


@pytest.mark.parametrize("driven", [False, True])
def test_a_law_that_takes_over_between_samples_starts_from_where_the_target_is_by_then(driven: bool) -> None:
    slow = Slow(COUPLING + COME_IN + f"driven = {str(driven).lower()}\n", [20]).first(position_m=[0.0])
    slow.to_sample()
    slow.run(11, position_m=[OFF_M])
    (channel,) = slow.rig["tool"].channels
    assert not slow.saw
    assert slow.rig["tool"].target_m[0] > 0.5 * OFF_M
    speed_m_per_s = slow.rig["tool"].follower.speed_m_per_s[0] if driven else 0.0
    start = channel.snapshot()
    assert (start.x_m, start.velocity_m_per_s) == (-slow.rig["tool"].target_m[0], -speed_m_per_s)


def test_one_that_comes_into_force_anew_shows_its_law_no_way_of_before() -> None:
    shown = []

    def step(_state: Any, _params: Any, tick: Any) -> float:
        if tick.in_contact:
            shown.append(tick.moved_m)
        return float(tick.contact_n)

    slow = Slow(COUPLING + PROMPT + "driven = true\n", [20])
    module = law(step)
    (channel,) = slow.rig["tool"].channels
    channel.law = RunningLaw(module, module.Params())
    slow.first(position_m=[OFF_M], velocity_m_per_s=[0.1])
    slow.run(97, position_m=[OFF_M], velocity_m_per_s=[0.1])
    slow.rig["tool"].take(update(slow.rig.seq + 1, released=True))
    slow.run(200)
    before = len(shown)
    slow.run(40, position_m=[OFF_M], velocity_m_per_s=[0.1])
    assert (len(shown) - before, shown[before]) == (2, 0.0)


def test_what_waited_for_a_sample_that_never_came_is_entered_with_no_other() -> None:
    """The device was calibrated in between."""
    slow = Slow(COUPLING + COME_IN, [20]).first(position_m=[OFF_M])
    slow.run(239, position_m=[OFF_M])
    slow.to_sample()
    slow.run(15, position_m=[-OFF_M])
    books = slow.rig["tool"].books
    slow.rig.tick.start(slow.rig.sample)
    before = (books.moved_j, books.carried_j, books.ledger.dissipated_j, books.ledger.generated_j)
    slow.run(60, position_m=[0.0])
    assert (books.moved_j, books.carried_j, books.ledger.dissipated_j, books.ledger.generated_j) == before
    assert before[0] > 1e-3
