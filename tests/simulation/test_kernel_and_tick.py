"""The batch kernel is the daemon's tick: a wide family of loops, and every slip in either that could part them.

What the two have in common is one source: law, wall, ledger, the one-sample difference, the history of positions and
the simulated device. What is written twice is the order of a tick, for one axis, one wall and an armed guard. The loops
start outside the wall, since what begins inside blends in; and the wall of the family stands at zero and looks outward,
since elsewhere the daemon rounds otherwise.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import pytest

from tests.examples import TIMES
from tests.simulation.both_ways import by_machine_code, by_the_daemon, by_the_kernel, difference, names
from tests.simulation.loops import LAWS, any_case
from tests.simulation.mutants import mutants
from tests.simulation.slips import HARMLESS, Slips


@pytest.mark.parametrize("law", LAWS)
def test_the_interpreted_kernel_is_the_tick_to_the_last_bit(law: str) -> None:
    for seed in range(15 * TIMES):
        case = any_case(law, seed)
        assert difference(case, by_the_kernel(case), by_the_daemon(case)) == "", f"any_case({law!r}, {seed})"


def test_the_compiled_kernel_is_the_tick_to_the_last_bit() -> None:
    """On devices with few terms, which are compiled sooner; the kernel around them is the same."""
    cases = [any_case("awkward", seed, few_terms=True) for seed in range(20)]
    for seed, (case, run) in enumerate(zip(cases, by_machine_code(cases), strict=True)):
        assert difference(case, run, by_the_daemon(case)) == "", f"any_case('awkward', {seed}, few_terms=True)"


@pytest.mark.nightly
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("law", LAWS)
def test_the_compiled_kernel_is_the_tick_to_the_last_bit_on_every_device(law: str) -> None:
    cases = [any_case(law, seed) for seed in range(150)]
    for seed, (case, run) in enumerate(zip(cases, by_machine_code(cases), strict=True)):
        assert difference(case, run, by_the_daemon(case)) == "", f"any_case({law!r}, {seed})"


def test_the_family_reaches_what_it_is_for() -> None:
    """A family that never touched a wall or a limit would be equal whatever the kernel did."""
    cases = [any_case(law, seed) for law in LAWS for seed in range(10)]
    runs = [by_the_daemon(case) for case in cases]

    def shares(column: str, says: Callable[[Any], bool] = bool) -> float:
        hits = 0
        for case, run in zip(cases, runs, strict=True):
            at = names(case.law).index(column)
            hits += any(says(row[at]) for row in run.rows)
        return hits / len(cases)

    assert shares("tick.in_contact") > 0.8
    assert shares("tick.in_contact", lambda inside: not inside) > 0.6
    assert shares("guard.limited") > 0.2
    assert shares("ledger.cycle") > 0.3
    assert shares("ledger.generated_j") > 0.6
    assert shares("loop.damping_n_s_per_m") > 0.3


# --- every slip ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def slips() -> Slips:
    return Slips()


def test_without_a_slip_nothing_shows(slips: Slips) -> None:
    for case, ours, theirs in zip(slips.cases, slips.by_the_kernel, slips.by_the_daemon, strict=True):
        assert difference(case, ours, theirs) == "", case


def test_every_slip_in_a_sample_shows(slips: Slips) -> None:
    chosen = random.Random(13).sample(slips.all(), 80)
    assert slips.living(chosen) == [
        str(mutant) for mutant in slips.all() if mutant in chosen and str(mutant) in HARMLESS
    ]


@pytest.mark.nightly
def test_every_slip_shows_but_those_that_change_nothing(slips: Slips) -> None:
    assert len(slips.all()) > 550
    assert sorted(slips.living(slips.all())) == sorted(HARMLESS)


def test_a_function_has_the_slips_that_a_hand_would_make() -> None:
    def larger(a: float, b: float) -> float:
        """The larger of two, and not less than 0."""
        if a < b and b > 0.0:
            a = b
        return max(a, -0.5 * b)

    found = [mutant.slip for mutant in mutants(larger)]
    assert "if a < b and b > 0.0:  [Lt 0 is LtE]" in found
    assert "if a < b and b > 0.0:  [without a = b]" in found
    assert "return max(a, -0.5 * b)  [min]" in found
    assert len(found) == len(set(found)) == 15
    (turned,) = (mutant for mutant in mutants(larger) if mutant.slip == "return max(a, -0.5 * b)  [-0.5 turned round]")
    assert larger(-2.0, -2.0) == 1.0
    assert turned.into({})(-2.0, -2.0) == -1.0
    with pytest.raises(ValueError, match="has no"):
        mutants(larger, apart=("return 5",))
