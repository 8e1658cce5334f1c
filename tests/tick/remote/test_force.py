"""A force from a client is felt as it is sent, within its limit, and for as long as its client is to be believed."""

from __future__ import annotations

import itertools
import math

import pytest

from hapticd.tick.remote.port import PortState
from hapticd.tick.remote.streamed_force import BLEND_S, LET_GO_S
from tests.tick.remote.rig import FORCE_PORT, PERIOD_S, Rig, length


def pushed(rig: Rig, force_n: list[float], ticks: int) -> list[float]:
    """The force after a client has sent the same for some ticks."""
    for _ in range(ticks):
        rig.say("field", force_n=force_n)
        rig.go()
    return rig.force


@pytest.mark.parametrize("axes", ["x", "xy", "xyz"])
def test_what_is_sent_is_what_is_felt(axes: str) -> None:
    rig = Rig(FORCE_PORT, axes=axes)
    force_n = [0.5, -1.0, 0.25][: len(axes)]
    assert pushed(rig, force_n, 60) == pytest.approx(force_n)
    assert rig["field"].force_n == rig.force
    assert rig["field"].seq == rig.seq


def test_a_vector_beyond_the_limit_keeps_its_direction() -> None:
    rig = Rig(FORCE_PORT, axes="xyz")
    force = pushed(rig, [30.0, 0.0, 40.0], 100)
    assert length(force) <= 3.0
    assert force == pytest.approx([1.8, 0.0, 2.4])


def test_another_force_is_gone_over_to_in_some_ticks_and_a_small_change_in_one() -> None:
    rig = Rig(FORCE_PORT)
    pushed(rig, [1.0], 60)
    assert pushed(rig, [1.2], 1) == pytest.approx([1.2])
    (was_n,) = rig.force
    steps = []
    for _ in range(20):
        (now_n,) = pushed(rig, [-3.0], 1)
        steps.append(was_n - now_n)
        was_n = now_n
    assert max(steps) <= 3.0 * PERIOD_S / BLEND_S + 1e-9
    assert was_n == pytest.approx(-3.0)


def test_a_silent_client_pushes_for_no_longer_than_hold_s_and_a_ramp() -> None:
    """Even where the ramps of the configuration are longer: what is held pushes the hand along."""
    rig = Rig(FORCE_PORT, safety="")
    rig.tick.ramp_s = 0.5
    rig.switch(FORCE_PORT)
    pushed(rig, [3.0], 100)
    forces = [rig.go()[0] for _ in range(120)]
    assert forces[47] == pytest.approx(3.0)
    gone = round((0.05 + LET_GO_S) / PERIOD_S)
    assert forces[gone:] == [0.0] * (120 - gone)
    assert rig["field"].news is PortState.STALE


def test_a_client_that_hangs_and_repeats_itself_is_let_go() -> None:
    rig = Rig(FORCE_PORT)
    assert pushed(rig, [2.0], 990) == pytest.approx([2.0])
    assert pushed(rig, [2.0], 100) == [0.0]
    assert rig["field"].state is PortState.STALE
    assert pushed(rig, [2.1], 60) == pytest.approx([2.1])
    assert rig["field"].seq == rig.seq


def test_no_force_may_stay_and_so_may_any_where_the_file_says_so() -> None:
    rig = Rig(FORCE_PORT)
    pushed(rig, [0.0], 1500)
    assert rig["field"].state is PortState.HELD
    rig = Rig(FORCE_PORT + "unchanged_s = 0.0\n")
    assert pushed(rig, [2.0], 1500) == pytest.approx([2.0])


def test_the_clients_force_is_its_work_and_what_a_law_takes_off_is_lost() -> None:
    for law, lost in (("none", False), ("damper", True)):
        rig = Rig(FORCE_PORT, law=law)
        for n in range(1000):
            rig.say("field", force_n=[2.0 * math.sin(0.01 * n)])
            rig.go([5e-3 * math.sin(0.02 * n)])
        totals = rig.tick.totals()
        assert rig["field"].work_j == totals.moved_j != 0.0
        assert rig.unbalanced_j() < 1e-9
        assert totals.ledger.generated_j == pytest.approx(0.0, abs=1e-12)
        assert (totals.ledger.dissipated_j > 1e-3) == lost
        if not lost:
            assert rig.energy_j == pytest.approx(-totals.moved_j)


@pytest.mark.parametrize("law", ["tdpa", "energy-cycle"])
def test_a_spring_of_forces_that_come_late_is_held_by_a_law_that_counts_energy(law: str) -> None:
    """1.5 kN/m, evaluated at 200 Hz by the client and 10 ms late: what holds by itself is a quarter of that."""

    def swing(law: str) -> float:
        rig = Rig(FORCE_PORT, law=law)
        late = [0.0] * 10
        at_m, speed, path = 1e-3, 0.0, []
        for n in range(4000):
            late = [*late[1:], at_m]
            if n % 5 == 0:
                rig.say("field", force_n=[-1500.0 * late[0]])
            (force_n,) = rig.go([at_m])
            speed += (force_n - 4.4 * speed) / 0.25 * PERIOD_S
            at_m += speed * PERIOD_S
            path.append(at_m)
        return max(path[-1000:]) - min(path[-1000:])

    without, held = swing("none"), swing(law)
    assert without > 2e-3
    assert held < 0.25 * without


def test_its_law_is_shown_a_contact_without_depth_that_it_may_divide_by_and_without_a_spring() -> None:
    rig = Rig(FORCE_PORT, axes="xyz")
    for _ in range(50):
        rig.say("field", force_n=[1.0, -1.0, 0.5])
        rig.go()
        shown = [channel.tick for channel in rig["field"].channels]
        assert [each.in_contact for each in shown] == [True] * 3
        assert [each.spring_n for each in shown] == [0.0] * 3
        assert all(-1e-12 < each.x_m < 0.0 for each in shown)
    assert [each.contact_n for each in shown] == [1.0, -1.0, 0.5]


def test_on_a_device_that_is_slower_than_the_loop_a_force_is_gone_over_to_as_slowly() -> None:
    """A sample comes every 20 ms: the whole way lay between two of them, and came with the second one all at once."""
    rig = Rig(FORCE_PORT, nominal_rate_hz=50.0)
    forces_n = [0.0]
    for number in range(300):
        rig.say("field", force_n=[3.0 if number < 205 else -3.0])
        (force_n,) = rig.go() if number % 20 == 10 else rig.repeat()
        forces_n.append(force_n)
    changes_n = [after - before for before, after in itertools.pairwise(forces_n)]
    assert max(map(abs, changes_n)) <= 3.0 * PERIOD_S / BLEND_S + 1e-9
    assert forces_n[205] == pytest.approx(3.0)
    assert forces_n[205 + round(2.0 * BLEND_S / PERIOD_S)] == pytest.approx(-3.0)


def test_what_a_law_takes_off_stays_as_it_was_until_the_next_sample() -> None:
    rig = Rig(FORCE_PORT, law="damper")
    for number in range(100):
        rig.say("field", force_n=[1.0])
        rig.go([1e-5 * number])
    (before_n,) = rig.force
    assert before_n < 0.95
    rig.say("field", force_n=[2.0])
    assert rig.repeat(10) == pytest.approx([before_n + 1.0])
