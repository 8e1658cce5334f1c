"""The model's arithmetic agrees with exact answers wherever there are some, and the study notices where it does not."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from decimal import Decimal, localcontext
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd import plugins
from hapticd.cli import main
from hapticd.errors import ConfigError
from hapticd.offline.outcome import Criterion
from hapticd.simulation.batch import Batch, Point
from hapticd.simulation.plant import epochs
from hapticd_studies.boundaries import damper_limit, spring_limit
from hapticd_studies.extremes import exact
from hapticd_studies.extremes.case import DELAYS, LAWS, RATES_HZ, LoopCase, draw, place_of
from hapticd_studies.extremes.ceilings import Break, law_breaks
from hapticd_studies.extremes.energy_check import FOUND, balances, run_of
from hapticd_studies.extremes.findings import findings
from hapticd_studies.extremes.refusals import is_due
from hapticd_studies.extremes.step_map import LEAST, growths, log_growth_in_decimals, stepped_map
from hapticd_studies.extremes.sweep import COLUMNS, ExtremesPlan, judge, rows_of
from hapticd_studies.extremes.verdict import MARGIN, Verdict, verdict_of
from tests.examples import examples


def row_of(place: LoopCase) -> dict[str, float]:
    return dict(zip(COLUMNS, rows_of([place])[0].tolist(), strict=True))


def stepped_growth(*places: LoopCase) -> list[float]:
    values: list[float] = growths(places, [place.options(linear=True) for place in places]).tolist()
    return values


def refused(place: LoopCase) -> bool:
    try:
        epochs(place.options(), place.period_s)
    except ValueError:
        return True
    return False


def extremes(*arguments: str) -> int:
    with pytest.raises(SystemExit) as left:
        main(["study", "extremes", *arguments])
    return int(left.value.code or 0)


# --- the places ------------------------------------------------------------------------------------------------------


def test_places_reach_every_decade_that_is_declared() -> None:
    places = [draw(1, index) for index in range(20_000)]
    for name, low, high in (
        ("stiffness_n_per_m", -3, 8),
        ("mass_kg", -6, 3),
        ("viscous_n_s_per_m", -4, 4),
        ("wall_damping_n_s_per_m", -4, 4),
        ("hand_stiffness_n_per_m", -3, 6),
        ("resolution_m", -12, -3),
        ("max_force_n", -3, 6),
        ("initial_position_m", -12, 0),
    ):
        values = np.array([abs(getattr(place, name)) for place in places])
        assert set(np.floor(np.log10(values[values > 0.0])).astype(int)) == set(range(low, high))
    pressed = np.log10([-place.hand_n for place in places if place.hand_n])
    assert set(np.floor(pressed).astype(int)) == set(range(-9, 6))
    speeds = [-place.initial_velocity_m_per_s for place in places]
    assert 0.0 < min(speed for speed in speeds if speed > 0.0) < 1e-320
    assert {place.rate_hz for place in places} == set(RATES_HZ)
    assert {place.force_delay_samples for place in places} == set(DELAYS)
    assert {place.law for place in places} == set(LAWS)


def test_a_place_depends_on_its_seed_and_index_alone_and_comes_back_from_its_words() -> None:
    assert draw(1, 57) == draw(1, 57) != draw(2, 57)
    for index in range(50):
        place = draw(1, index)
        assert place_of(place.words()) == place
        assert place_of(f"1:{index}") == place


def test_the_places_of_a_block_have_one_rate() -> None:
    for count in (1, 5, 11, 700, 40_000):
        sizes = ExtremesPlan(1, count).sizes
        assert sum(sizes) == count
        assert len(sizes) % len(RATES_HZ) == 0 or count < len(RATES_HZ)


@pytest.mark.parametrize("text", ["1", "1:", "mass_kg", "mass_kg=heavy", "wheels=4", "rate_hz=nan", "law=mine"])
def test_a_point_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="--point"):
        place_of(text)


# --- the exact side --------------------------------------------------------------------------------------------------

PLACES = st.builds(
    LoopCase,
    stiffness_n_per_m=st.floats(-12, 9).map(lambda x: 10.0**x),
    wall_damping_n_s_per_m=st.just(0.0) | st.floats(-12, 6).map(lambda x: 10.0**x),
    mass_kg=st.floats(-9, 3).map(lambda x: 10.0**x),
    viscous_n_s_per_m=st.just(0.0)
    | st.floats(-12, 9).map(lambda x: 10.0**x)
    | st.floats(-12, 6).map(lambda x: -(10.0**x)),
    hand_stiffness_n_per_m=st.just(0.0) | st.floats(-12, 9).map(lambda x: 10.0**x),
    rate_hz=st.floats(-1, 6).map(lambda x: 10.0**x),
    force_delay_samples=st.sampled_from([0, 0, 1, 1, 2, 3, 7, 30, 128]),
    resolution_m=st.just(0.0) | st.floats(-12, 0).map(lambda x: 10.0**x),
    max_force_n=st.just(0.0) | st.floats(-9, 6).map(lambda x: 10.0**x),
    hand_n=st.floats(-1e6, 1e6),
    initial_position_m=st.floats(0.0, 1e3),
    initial_velocity_m_per_s=st.floats(-1e3, 1e3),
    law=st.sampled_from(LAWS),
)
"""Farther than the study goes, denormals included."""


def radius_of_companion(place: LoopCase) -> Any:
    """The largest eigenvalue of the analytic map, by exponentials of matrices with a hundred digits."""
    with mpmath.workdps(100):
        period, mass = mpmath.mpf(place.period_s), mpmath.mpf(place.mass_kg)
        decay = mpmath.mpf(place.viscous_n_s_per_m) / mass
        spring = mpmath.mpf(place.hand_stiffness_n_per_m) / mass
        free = mpmath.expm(mpmath.matrix([[0, 1, 0], [-spring, -decay, 1 / mass], [0, 0, 0]]) * period)
        size = LEAST + place.force_delay_samples
        whole = mpmath.zeros(size)
        damping = mpmath.mpf(place.wall_damping_n_s_per_m) / period
        force = {0: -mpmath.mpf(place.stiffness_n_per_m) - damping, 2: damping}
        for into in (0, 1):
            whole[into, 0], whole[into, 1] = free[into, 0], free[into, 1]
            for state, gain in force.items() if size == LEAST else {3: mpmath.mpf(1)}.items():
                whole[into, state] += free[into, 2] * gain
        whole[2, 0] = 1
        for at in range(3, size):
            for state, gain in force.items() if at == size - 1 else {at + 1: mpmath.mpf(1)}.items():
                whole[at, state] += gain
        return max(abs(value) for value in mpmath.eig(whole, left=False, right=False))


@examples(60)
@given(place=PLACES.filter(lambda one: one.force_delay_samples <= 7))
def test_the_exact_radius_is_the_largest_eigenvalue_of_the_matrix_exponential(place: LoopCase) -> None:
    turns = math.sqrt(place.hand_stiffness_n_per_m / place.mass_kg) * place.period_s
    if abs(place.viscous_n_s_per_m / place.mass_kg * place.period_s) > 50.0 or turns > 100.0:
        return  # a general matrix exponential takes for ever there
    true = radius_of_companion(place)
    assert exact.inside(place, Decimal(mpmath.nstr(true * (1 + mpmath.mpf(10) ** -12), 40)))
    if true > 1e-12:
        assert not exact.inside(place, Decimal(mpmath.nstr(true * (1 - mpmath.mpf(10) ** -12), 40)))


@pytest.mark.parametrize("mass", [1e-6, 0.25, 1e3])
@pytest.mark.parametrize("rate", [1.0, 1e3, 1e5])
@pytest.mark.parametrize("delay", [0, 1])
def test_a_spring_alone_turns_unstable_at_its_closed_form(mass: float, rate: float, delay: int) -> None:
    limit = spring_limit(mass, 0.3 * mass * rate, 1.0 / rate, delay)
    place = LoopCase(mass_kg=mass, viscous_n_s_per_m=0.3 * mass * rate, rate_hz=rate, force_delay_samples=delay)
    for off in (1e-4, 1e-10):
        assert exact.inside(replace(place, stiffness_n_per_m=limit * (1.0 - off)), Decimal(1))
        assert not exact.inside(replace(place, stiffness_n_per_m=limit * (1.0 + off)), Decimal(1))


@pytest.mark.parametrize("share", [1e-6, 0.1, 0.8284, 1.9])
def test_a_digital_damper_turns_unstable_at_its_closed_form(share: float) -> None:
    place = LoopCase(mass_kg=0.25, wall_damping_n_s_per_m=share * 250.0)
    limit = damper_limit(0.25, share * 250.0, 1e-3)
    assert exact.inside(replace(place, stiffness_n_per_m=limit * (1.0 - 1e-9)), Decimal(1))
    assert not exact.inside(replace(place, stiffness_n_per_m=limit * (1.0 + 1e-9)), Decimal(1))


def test_a_radius_is_found_by_halving_to_as_many_digits_as_asked_for() -> None:
    """Without friction and delay the determinant of the map, 1 + K T^2 / 2m, is the square of the radius."""
    place = LoopCase(mass_kg=0.5, stiffness_n_per_m=3000.0)
    with localcontext() as context:
        context.prec = 50
        period = Decimal(place.period_s)
        assert abs(exact.growth(place, 30) - (1 + 3000 * period * period).sqrt()) < Decimal("1e-29")


# --- the stepped side ------------------------------------------------------------------------------------------------


def test_the_map_is_what_the_plant_does_to_unit_states() -> None:
    place = LoopCase(mass_kg=0.5, stiffness_n_per_m=3000.0, wall_damping_n_s_per_m=2.0, force_delay_samples=2)
    (_, fields), *_ = epochs(place.options(), place.period_s)
    columns = stepped_map(place)
    per_force = float(fields["x_per_f"])
    assert columns[0].tolist() == [1.0, 1.0, 0.0, 1.0, 0.0]
    assert columns[1, 3] == pytest.approx(2.0)
    assert columns[2].tolist() == [1.0, 0.0, 0.0, 0.0, 0.0]
    assert columns[3].tolist() == [0.0, 0.0, 0.0, 0.0, 1.0]
    assert columns[4].tolist() == pytest.approx([-5000.0 * per_force, 0.0, 2000.0 * per_force, 0.0, 0.0])


@examples(40)
@given(place=PLACES.filter(lambda one: one.force_delay_samples <= 3))
def test_powers_grow_as_the_eigenvalues_say(place: LoopCase) -> None:
    try:
        columns = stepped_map(place)
    except ValueError:
        return
    (log_growth,) = stepped_growth(place)
    largest = np.abs(np.linalg.eigvals(columns)).max()
    # LAPACK's own error counts in roundings of the norm, and of a double root in the root of that.
    assert math.exp(log_growth) == pytest.approx(largest, rel=1e-5, abs=1e-7 * np.abs(columns).max())


def test_a_map_is_judged_by_its_slowest_mode_without_waiting_for_it() -> None:
    """A tenth of a day would show nothing: the amplitude grows by 5e-9 a tick, or by none at all."""
    slow = LoopCase(stiffness_n_per_m=0.01, mass_kg=1.0)
    (log_growth,) = stepped_growth(slow)
    assert log_growth == pytest.approx(0.01 * slow.period_s**2 / 4.0, rel=1e-6)
    assert verdict_of(log_growth) is Verdict.MARGINAL
    assert verdict_of(2.0 * MARGIN) is Verdict.UNSTABLE
    assert verdict_of(-2.0 * MARGIN) is Verdict.STABLE


# --- both ------------------------------------------------------------------------------------------------------------


@examples(120)
@given(places=st.lists(PLACES, min_size=1, max_size=8))
def test_beyond_the_grid_no_linear_loop_is_judged_otherwise_than_by_its_eigenvalues(places: list[LoopCase]) -> None:
    kept = [place for place in places if not refused(place)]
    for place, growth in zip(kept, stepped_growth(*kept) if kept else [], strict=True):
        log_growth, stepped, true, same = judge(place, growth)
        if (stepped, same) != (true, 1.0):  # powers of a map with close eigenvalues cancel
            log_growth, stepped, true, same = judge(place, log_growth_in_decimals(stepped_map(place)))
        assert stepped == true
        assert same or abs(math.exp(log_growth) - float(exact.growth(place, 20))) <= exact.rounding(place)


def test_the_phase_of_a_hand_that_swings_thousands_of_times_a_period_is_known_to_its_last_digit_only() -> None:
    place = LoopCase(stiffness_n_per_m=1000.0, mass_kg=2.562556527007848e-09, hand_stiffness_n_per_m=1.0, rate_hz=1.0)
    off = abs(math.exp(log_growth_in_decimals(stepped_map(place))) - float(exact.growth(place, 20)))
    assert 1e-9 < off <= exact.rounding(place) < 1e-7
    assert exact.rounding(LoopCase(mass_kg=0.25, viscous_n_s_per_m=4.0, hand_stiffness_n_per_m=500.0)) < 1e-12


def test_a_map_with_three_close_eigenvalues_is_squared_with_more_digits() -> None:
    words = "stiffness_n_per_m=1e-05,wall_damping_n_s_per_m=1.0,mass_kg=1.0,viscous_n_s_per_m=-1.0,rate_hz=1.0"
    place = place_of(words)
    (in_doubles,) = stepped_growth(place)
    in_decimals = log_growth_in_decimals(stepped_map(place))
    true = float(exact.growth(place, 17))
    assert abs(math.exp(in_doubles) - true) > 1e-9
    assert abs(math.exp(in_decimals) - true) < exact.rounding(place) < 1e-9
    row = row_of(place)
    assert row["in_decimals"] == 1.0
    assert findings(place, row) == []


@examples(60)
@given(place=PLACES)
def test_beyond_the_grid_every_run_balances_or_is_refused_by_a_limit(place: LoopCase) -> None:
    assert [one for one in findings(place, row_of(place)) if not one.explained] == []


def test_a_sensor_whose_step_is_a_leap_may_end_a_run_within_range() -> None:
    """Half a step on, the reading is a metre on, in a microsecond."""
    place = place_of("rate_hz=1e6,resolution_m=1.0,initial_position_m=0.5,initial_velocity_m_per_s=1.0")
    row = row_of(place)
    assert row["left_range"] == 1.0
    assert findings(place, row) == []


def test_the_edge_of_a_verdict_is_found_to_the_last_digits_and_what_lies_on_it_is_explained() -> None:
    """At the edge itself rounding decides; the exact radius must then be closer to it than rounding moves it."""
    place = LoopCase(mass_kg=0.25, viscous_n_s_per_m=4.0, force_delay_samples=1)
    low, high = 2000.0, 3000.0
    while math.nextafter(low, high) < high:
        middle = 0.5 * (low + high)
        if exact.verdict(replace(place, stiffness_n_per_m=middle)) is Verdict.STABLE:
            low = middle
        else:
            high = middle
    beside = [replace(place, stiffness_n_per_m=low + count * math.ulp(low)) for count in range(-300, 301, 3)]
    for one, log_growth in zip(beside, stepped_growth(*beside), strict=True):
        row = dict.fromkeys(COLUMNS, 0.0)
        row["finite"] = 1.0
        row["log_growth"], row["stepped"], row["exact"], row["same_radius"] = judge(one, log_growth)
        assert row["same_radius"] == 1.0
        assert [found for found in findings(one, row) if not found.explained] == []
    bound = exact.rounding(place)
    assert bound < 1e-11
    (far,) = stepped_growth(replace(place, stiffness_n_per_m=low * (1.0 - 1e-7)))
    assert verdict_of(far) is Verdict.STABLE


@pytest.mark.parametrize("factor", [1.0 - 1e-8, 1.0 + 1e-8])
def test_a_map_that_is_wrong_in_its_eighth_digit_is_noticed(factor: float) -> None:
    place = LoopCase(mass_kg=0.25, viscous_n_s_per_m=4.0, stiffness_n_per_m=7000.0)
    (right,) = stepped_growth(place)
    assert judge(place, right)[3] == 1.0
    assert judge(place, right + math.log(factor))[3] == 0.0


@pytest.mark.parametrize("method", ["semi-implicit-euler", "explicit-euler"])
def test_a_plant_that_leaks_otherwise_does_not_balance(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The integrators that show no leak, or twice the leak, are told from the exact step by the books alone."""
    place = LoopCase(mass_kg=0.5, stiffness_n_per_m=3000.0, hand_n=-5.0, viscous_n_s_per_m=1.0)
    assert findings(place, row_of(place)) == []
    options = place.options().model_copy(update={"integrator": method})
    monkeypatch.setattr(LoopCase, "options", lambda self, linear=False: options)
    (found,) = findings(place, row_of(place))
    assert found.kind == "books"
    assert not found.explained


# --- energy books ----------------------------------------------------------------------------------------------------


def test_the_books_name_the_leak_of_the_hold_and_the_work_of_the_sensor() -> None:
    """One bounce of an undamped mass: what it comes back with beyond what it came with is what was generated."""
    law = plugins.law("none")
    for resolution_m in (0.0, 1e-5):
        place = LoopCase(
            mass_kg=0.5,
            stiffness_n_per_m=3000.0,
            initial_position_m=1e-3,
            initial_velocity_m_per_s=-0.2,
            resolution_m=resolution_m,
        )
        point = Point(place.options(), place.wall(), law.Params(), place.period_s)
        result = Batch(law, [point], 0.1, trace_every=1).run_interpreted()
        book = dict(zip(FOUND, balances(result.trace, [run_of(place, 100, True)])[0].tolist(), strict=True))
        speed = float(result.trace[0, -1, 1])
        assert result.trace[0, -1, 0] > 0.0
        gained_j = 0.25 * (speed * speed - 0.04)
        assert book["generated_j"] == pytest.approx(gained_j, rel=1e-9)
        assert book["wall_generated_j"] == pytest.approx(result.generated_j[0], rel=1e-9)
        assert (book["generated_j"] == pytest.approx(book["wall_generated_j"], rel=1e-12)) is (resolution_m == 0.0)


# --- laws ------------------------------------------------------------------------------------------------------------


def test_a_law_may_shake_a_device_beyond_the_ceiling_of_a_sampled_damper_and_not_below() -> None:
    light = LoopCase(mass_kg=0.01, stiffness_n_per_m=100.0, viscous_n_s_per_m=1.0, law="tdpa")
    assert law_breaks(light, 5.0) is Break.NONE
    assert law_breaks(light, 50.0) is Break.CEILING  # 2 m/T is 20 N s/m
    assert law_breaks(replace(light, hand_stiffness_n_per_m=10.0), 50.0) is Break.HELD
    # Viscous friction that makes a bare mass unstable with this wall and damper is nobody's ceiling.
    active = replace(light, viscous_n_s_per_m=-0.5)
    assert law_breaks(active, 0.1) is Break.FAULT


def test_a_law_is_judged_by_the_damping_that_it_brought_and_not_by_its_cap() -> None:
    """2 m/T is 20 N s/m here and the cap 50: only the bounce that the law really brakes so hard counts."""
    light = LoopCase(mass_kg=0.01, stiffness_n_per_m=100.0, viscous_n_s_per_m=0.5, law="tdpa")
    for moved, least, most, what in (
        (light, 0.0, 0.0, Break.NONE),
        (replace(light, initial_velocity_m_per_s=-1.0), 0.1, 1.0, Break.NONE),
        (replace(light, initial_velocity_m_per_s=-1.0, hand_n=-0.1), 50.0, 50.0, Break.CEILING),
    ):
        row = row_of(moved)
        assert row["stepped"] == Verdict.STABLE
        assert least <= row["damping_n_s_per_m"] <= most
        assert row["law_break"] == what


def test_damping_that_a_law_learns_when_the_device_leaves_has_not_acted() -> None:
    """One bounce is one energy cycle, and its damping would brake the next one, which never comes."""
    place = LoopCase(
        mass_kg=0.5,
        stiffness_n_per_m=3000.0,
        viscous_n_s_per_m=2.0,
        initial_position_m=1e-3,
        initial_velocity_m_per_s=-0.2,
        law="energy-cycle",
    )
    law = plugins.law("energy-cycle")
    point = Point(place.options(), place.wall(), law.Params(), place.period_s)
    assert Batch(law, [point], 1.0).run_interpreted().damping_n_s_per_m[0] > 1.0
    assert row_of(place)["damping_n_s_per_m"] == 0.0


# --- refusals --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("viscous_n_s_per_m=-1e4,mass_kg=1e-6", "viscous_n_s_per_m = -10000: 1e-06 kg would speed up e^1e+07-fold"),
        ("hand_stiffness_n_per_m=1e6,mass_kg=1e-6,rate_hz=1", "hand.stiffness_n_per_m = 1e+06: 1e-06 kg would swing"),
        ("force_delay_samples=129", "force_delay_samples = 129: Input should be less than or equal to 128"),
        ("viscous_n_s_per_m=-1e7,mass_kg=1e5", "viscous_n_s_per_m = -10000000.0: Input should be greater than"),
    ],
)
def test_what_would_not_be_a_number_is_refused_by_parameter_and_limit(
    words: str, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert extremes("--point", words) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert says in told
    assert "PASS refused" in told


def test_a_refusal_that_is_not_due_is_noticed() -> None:
    place = LoopCase(viscous_n_s_per_m=-1.0)
    assert not is_due(place, "viscous_n_s_per_m = -1: 0.25 kg would speed up e^0.004-fold; must be -0.5 or more")
    assert not is_due(place, "viscous_n_s_per_m = -1: Input should be greater than or equal to -1000000")
    assert not is_due(place, "something went wrong")


# --- the command -----------------------------------------------------------------------------------------------------


def test_the_command_writes_report_picture_and_json_and_replays_a_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert extremes("--places", "440", "--ticks", "0", "--output", str(tmp_path)) == 0
    shown = capsys.readouterr().out
    assert shown.count("PASS") == 6
    assert len(shown.splitlines()) <= 24
    told = json.loads((tmp_path / "extremes.json").read_text())
    assert told["holds"] is True
    assert told["criterion"] == Criterion().declared()
    assert told["disagreements"] == []
    counts = told["counts"]
    assert counts["stable"] + counts["marginal"] + counts["unstable"] + counts["refused"] == 440
    assert (tmp_path / "extremes.png").read_bytes().startswith(b"\x89PNG")
    assert "<h2>Disagreements</h2>\n<p>None.</p>" in (tmp_path / "extremes.html").read_text()
    assert not (tmp_path / "extremes.journal").exists()
    assert extremes("--point", "1:57") == 0
    assert "spectral radius stepped" in " ".join(capsys.readouterr().out.split())
    assert extremes("--point", "mass_kg=1") == 0
    assert "rounding may make of it" in capsys.readouterr().out, "nothing has moved there"


@pytest.mark.parametrize("arguments", [("--places", "0"), ("--seed", "-1"), ("--ticks", "-5"), ("--point", "x")])
def test_a_value_that_makes_no_sense_is_refused(arguments: tuple[str, str], tmp_path: Path) -> None:
    assert extremes(*arguments, "--output", str(tmp_path)) == 2
