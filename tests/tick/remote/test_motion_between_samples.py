"""A device whose samples are further apart than the ticks moves all that time, and not with the last tick's force."""

from __future__ import annotations

import math

import pytest

from tests.tick.remote.rig import COUPLING, FORCE_PORT, PERIOD_S, PROMPT, Metered, Rig

SPEED_M_PER_S = 0.1
FIELD = FORCE_PORT + "unchanged_s = 0.0\n"


def stroke(rig: Rig, gap: int, speed_m_per_s: float) -> float:
    """Move evenly, with a sample each `gap` ticks, while clients go on at every tick; the work that went in [J]."""
    went_in_j = 0.0
    for port in rig.ports:
        rig.say(port.name, position_m=[0.0], force_n=[0.0])
    rig.go([0.0])
    for n in range(1, 401):
        went_in_j -= rig.force[0] * SPEED_M_PER_S * PERIOD_S
        for port in rig.ports:
            at_m, force_n = speed_m_per_s * PERIOD_S * n, 2.0 * math.sin(0.06 * n)
            rig.say(port.name, position_m=[at_m], velocity_m_per_s=[speed_m_per_s], force_n=[force_n])
        if n % gap:
            rig.repeat()
        else:
            rig.go([SPEED_M_PER_S * PERIOD_S * n], dt_s=gap * PERIOD_S)
    return went_in_j


@pytest.mark.parametrize("gap", [1, 2, 5, 20])
@pytest.mark.parametrize("along", [-1.0, 1.0])
@pytest.mark.parametrize("scene", [COUPLING + PROMPT, COUPLING + "driven = true\n", FIELD, COUPLING + FIELD])
def test_the_books_have_what_each_force_took_while_it_was_held(gap: int, along: float, scene: str) -> None:
    for each in ("none", "late-cycle"):
        rig = Rig(scene, law=each, nominal_rate_hz=1000.0 / gap)
        went_in_j = stroke(rig, gap, along * SPEED_M_PER_S)
        assert abs(went_in_j) > 1e-3
        assert rig.tick.totals().ledger.energy_j == pytest.approx(went_in_j, rel=1e-9)
        assert rig.unbalanced_j() < 1e-9


@pytest.mark.parametrize("gap", [1, 2, 20])
@pytest.mark.parametrize("scene", [COUPLING + PROMPT, FIELD])
def test_a_law_sees_the_mean_of_what_was_applied_since_the_sample_before(gap: int, scene: str) -> None:
    rig = Rig(scene, nominal_rate_hz=1000.0 / gap)
    metered = Metered(rig.tick.couplings[0].channels[0])
    went_in_j = stroke(rig, gap, SPEED_M_PER_S)
    assert metered.taken_j == pytest.approx(went_in_j, rel=1e-9)


def test_what_fades_out_between_two_samples_is_entered_with_the_second() -> None:
    """By then it is let go, and nothing is applied any more."""
    rig = Rig(COUPLING + PROMPT, nominal_rate_hz=10.0)
    for _ in range(100):
        rig.say("tool", position_m=[2e-3])
        rig.go()
    rig.say("tool", position_m=[2e-3], released=True)
    rig.repeat(70)
    assert rig.force == [0.0]
    before_j = rig.energy_j
    rig.go([5e-3])
    assert rig.energy_j - before_j < -1e-3
    assert rig.unbalanced_j() < 1e-12
