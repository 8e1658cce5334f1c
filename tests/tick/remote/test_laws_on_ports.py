"""A spring that pulls as well as pushes, and is in contact for as long as it is held, under each law."""

from __future__ import annotations

import pytest

from tests.tick.remote.rig import COUPLING, Hand, Rig

STIFF = COUPLING.replace("2000.0", "20000.0").replace("damping_n_s_per_m = 5.0", "")


def ring_m(rig: Rig, hand: Hand, stiffness_n_per_m: float, ticks: int, hand_n: float = 0.0) -> float:
    """How far the device rings about a target that stands still, a hand beside it [m]."""
    path = []
    for n in range(ticks):
        if n % 5 == 0:
            rig.say("tool", position_m=[0.0], stiffness_n_per_m=stiffness_n_per_m)
        path += [at for (at,) in hand.run(1, [hand_n])]
    return max(path[-200:]) - min(path[-200:])


@pytest.mark.parametrize(
    ("law", "hand_n"),
    [
        *((law, -1.0) for law in ("damper", "tdpa", "energy-cycle", "late-cycle", "ring-damping")),
        ("ring-damping", 1.0),  # it takes the mass from the force that was given, which pulls here
    ],
)
def test_a_law_holds_a_coupling_that_rings_without_one(law: str, hand_n: float) -> None:
    rig = Rig(STIFF, law=law, resolution_m=1e-5)
    hand = Hand(rig)
    ring_m(rig, hand, 20e3, 300)
    assert ring_m(rig, hand, 20e3, 1500, hand_n=hand_n) <= 2e-5
    assert rig.at[0] == pytest.approx(hand_n / 20e3, abs=1e-5)
    assert rig.unbalanced_j() < 1e-9


def test_without_a_law_it_rings() -> None:
    without = Rig(STIFF, resolution_m=1e-5)
    hand = Hand(without)
    ring_m(without, hand, 20e3, 300)
    assert ring_m(without, hand, 20e3, 1500, hand_n=-1.0) > 5e-4
    assert without.tick.totals().ledger.generated_j > 0.01


def test_a_cycle_ends_each_time_the_spring_has_swung_through_the_target() -> None:
    """Energy is least where the spring is slack: a press and a pull are a cycle each, though contact is never lost."""
    rig = Rig(law="energy-cycle")
    for n in range(1000):
        rig.say("tool", position_m=[0.0])
        rig.go([2e-3 * (abs(n % 200 - 100) - 50) / 50.0])
    ledger = rig["tool"].books.ledger
    assert ledger.cycle == pytest.approx(10, abs=1)
    assert ledger.cycle_duration_s == pytest.approx(0.1, abs=0.01)
    assert ledger.cycle_damping_n_s_per_m == pytest.approx(rig["tool"].law_values()[1], rel=0.2)


def test_tdpa_has_a_ring_use_up_first_what_the_port_has_taken_while_it_is_held() -> None:
    """Its credit ends with the contact, and a coupling that is held never ends one; the other laws keep no credit."""
    rings = {}
    for law in ("tdpa", "late-cycle", "ring-damping"):
        rig = Rig(STIFF.replace("name", "damping_n_s_per_m = 5.0\nname"), law=law, resolution_m=1e-5)
        hand = Hand(rig)
        for n in range(10):  # stirred: the coupling's own damper takes energy
            ring_m(rig, hand, 1000.0, 100, hand_n=5.0 if n % 2 else -5.0)
        assert rig.tick.totals().ledger.energy_j > 0.002
        swings = []
        for n in range(1000):
            if n % 5 == 0:
                rig.say("tool", position_m=[0.0], damping_n_s_per_m=0.0)
            swings += [at for (at,) in hand.run(1)]
        rings[law] = max(swings[-500:]) - min(swings[-500:])
        if law == "tdpa":
            assert rig.tick.totals().ledger.energy_j > 0.0
    assert rings["tdpa"] > 5e-4
    assert max(rings["late-cycle"], rings["ring-damping"]) < 5e-5
