"""A day at 1 kHz leaves the energy sums right, and the law as able to learn as on the first second."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.cli import main
from hapticd.offline.outcome import Outcome
from hapticd.simulation.batch import TRACE_COLUMNS
from hapticd.tick.energy import EnergyLedger
from hapticd_studies.extremes.long_run import (
    DISSIPATED,
    GENERATED,
    HANDS,
    SUM_SHARE,
    SUMS,
    TURNOVER,
    WORK,
    add_product,
    enter,
    run_days,
)
from hapticd_studies.extremes.report import ExtremesReport
from hapticd_studies.extremes.sweep import COLUMNS, ExtremesPlan

NUMBERS = st.floats(-1e6, 1e6, allow_subnormal=False).filter(lambda value: value == 0.0 or abs(value) > 1e-100)


@given(pairs=st.lists(st.tuples(NUMBERS, NUMBERS), max_size=60))
def test_a_sum_of_products_keeps_what_a_double_loses(pairs: list[tuple[float, float]]) -> None:
    sums = np.zeros(2)
    for left, right in pairs:
        add_product(sums, 0, left, right)
    exact = sum((Fraction(left) * Fraction(right) for left, right in pairs), Fraction(0))
    gross = sum((abs(Fraction(left) * Fraction(right)) for left, right in pairs), Fraction(0))
    assert abs(Fraction(float(sums[0])) + Fraction(float(sums[1])) - exact) <= gross * Fraction(1, 2**90)


def test_the_reference_of_a_day_is_the_rational_sum() -> None:
    stiffness = 12_000.0
    random = np.random.default_rng(5)
    trace = np.zeros((3000, len(TRACE_COLUMNS)))
    trace[:, TRACE_COLUMNS.index("x_measured_m")] = np.cumsum(random.integers(-4, 5, 3000)) * 1e-5
    trace[:, TRACE_COLUMNS.index("force_n")] = random.normal(size=3000)
    sums = np.zeros(SUMS)
    for part in np.array_split(trace, 7):
        enter(part, stiffness, sums)

    work = generated = dissipated = Fraction(0)
    written = spring = last = Fraction(0)
    for x_m, force_n in zip(trace[:, 2].tolist(), trace[:, 3].tolist(), strict=True):
        moved = Fraction(x_m) - last
        stored = Fraction(stiffness) / 2 * (max(Fraction(0), -Fraction(x_m)) ** 2 - max(Fraction(0), -last) ** 2)
        work -= written * moved
        generated += stored + spring * moved
        dissipated -= (written - spring) * moved
        written, last = Fraction(force_n), Fraction(x_m)
        spring = Fraction(stiffness) * max(Fraction(0), -last)
    for at, true in ((WORK, work), (GENERATED, generated), (DISSIPATED, dissipated)):
        assert float(sums[at] + sums[at + 1]) == pytest.approx(float(true), rel=1e-15, abs=1e-15 * sums[TURNOVER])


def test_minutes_of_both_days_keep_their_sums_and_go_on_learning() -> None:
    told: list[int] = []
    days = run_days(120_000, told.append)
    assert told == [12_000 * chunk for chunk in range(1, 11)]
    assert [day.hand for day in days] == list(HANDS)
    plan = ExtremesPlan(1, 0)
    lines = ExtremesReport(plan, np.zeros((0, len(COLUMNS))), {}, days).lines()
    for day in days:
        assert day.ticks == 120_000
        assert max(day.errors.values()) < SUM_SHARE
        assert day.cycles_at_last >= 12 * 2
        assert day.holds
        assert day.kept_n_s_per_m >= day.damping_n_s_per_m > day.adapted_n_s_per_m
        (text,) = (line.text for line in lines if day.hand in line.text)
        assert f"{day.damping_n_s_per_m:.3g}" in text
        assert f"{day.adapted_n_s_per_m:.3g}" in text
        assert f"felt {day.felt[0]:.2g}, force spans {day.chatter_n[0]:.2g} N" in text
        assert not replace(day, kept_outcome=Outcome.MOVING).holds
        assert day.resolution_j < 1e-10 * abs(day.cycle_j)
    assert days[1].kept_outcome is Outcome.SETTLED
    assert days[1].felt[0] > 3.0  # still, with twice the damping, and felt all the same
    assert days[1].chatter_n[0] > 1.0


def test_a_ledger_that_has_counted_for_years_finds_the_same_cycles() -> None:
    """Cycles are sought in a sum that starts anew with each; in the large one no fall of a microjoule would show."""
    young, old = EnergyLedger(), EnergyLedger()
    old.energy_j = old.dissipated_j = 1e12
    assert old.energy_j + 1e-5 == old.energy_j
    stiffness, x_m, force_n = 12_000.0, 0.0, 0.0
    for tick in range(5000):
        next_m = -1e-4 * np.sin(0.05 * tick) ** 2 - 1e-5
        for ledger in (young, old):
            stored_j = 0.5 * stiffness * next_m * next_m
            ledger.update(next_m - x_m, force_n, force_n, stored_j, True, 1.0, 1e-3)
        x_m, force_n = next_m, -stiffness * next_m
    assert young.cycle == old.cycle > 70
    assert young.cycle_generated_j == old.cycle_generated_j > 0.0


@pytest.mark.nightly
def test_the_whole_study_agrees_and_a_hundred_million_ticks_balance(tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as left:
        main(["study", "extremes", "--ticks", "100000000", "--output", str(tmp_path)])
    assert not left.value.code
