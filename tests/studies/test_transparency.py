"""Hands that move: what they are given under a law, and what of it is felt, each figure held against what is known."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from hapticd.cli import main
from hapticd.config.loading import parse
from hapticd.config.walls import WallConfig
from hapticd.offline.felt import felt_index, threshold_m
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.offline.simulate import simulate
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.boundaries import Loop, stable_limit
from hapticd_studies.law_spec import LawSpec, parse_laws
from hapticd_studies.transparency import references, scores
from hapticd_studies.transparency.devices import PARTS, Held, draw, draw_out_of_sample
from hapticd_studies.transparency.hands import HOLD, IN, KINDS, LET_GO_S, OUT, movement
from hapticd_studies.transparency.references import calm, least_damping
from hapticd_studies.transparency.runs import COLUMNS, columns_of, moving_runs, rows, times_of
from hapticd_studies.transparency.sweep import every_law

DEVICES = [draw(1, index) for index in range(500)]
GRIP = {"hand_mass_kg": 0.05, "hand_damping_n_s_per_m": 1.0, "hand_stiffness_n_per_m": 100.0}
CRITERION = Criterion()


def law(text: str) -> LawSpec:
    (found,) = parse_laws(text, {})
    return found


def device(kind: str, stiffness_n_per_m: float, resolution_m: float = 1e-6, **hand: float) -> Held:
    """A device like the omega7 model in a light hand, before a wall of one's own."""
    held = {"mass_kg": 0.05, "damping_n_s_per_m": 0.5, "stiffness_n_per_m": 100.0} | hand
    options = SimulationOptions.model_validate({"model": "omega7", "resolution_m": resolution_m, "hand": held})
    own = stable_limit(Loop(0.25 + held["mass_kg"], 4.4 + held["damping_n_s_per_m"], 1e-3))
    return Held(1, 0, kind, options, WallConfig(stiffness_n_per_m=stiffness_n_per_m), 1000.0, own)


def figures(held: Held, label: str, seconds: float = 6.0) -> dict[str, float]:
    (row,) = rows([held], law(label), seconds, CRITERION)
    return dict(zip(COLUMNS, row, strict=True))


def transparency(*arguments: str) -> int:
    with pytest.raises(SystemExit) as left:
        main(["study", "transparency", *arguments])
    return int(left.value.code or 0)


# --- devices and hands -----------------------------------------------------------------------------------------------


def test_devices_fill_the_ranges_that_are_declared() -> None:
    drawn = [one.figures() for one in DEVICES]
    for name, low, high in [
        ("mass_kg", 0.02, 5.0),
        ("resolution_m", 1e-6, 3e-5),
        ("rate_hz", 500.0, 4000.0),
        ("share_of_own_limit", 0.2, 5.0),
    ]:
        values = [one[name] for one in drawn]
        assert low * 0.999 <= min(values) < low * 1.1
        assert high / 1.1 < max(values) <= high * 1.001
    for delay in range(3):
        assert np.mean([one["force_delay_samples"] == delay for one in drawn]) == pytest.approx(1.0 / 3.0, abs=0.06)
    assert np.mean([one["noise_m"] > 0.0 for one in drawn]) == pytest.approx(0.5, abs=0.06)
    assert np.mean([one["bandwidth_hz"] > 0.0 for one in drawn]) == pytest.approx(1.0 / 3.0, abs=0.06)
    assert {one["hand"] for one in drawn} == set(KINDS)


def test_a_device_and_its_hand_depend_on_seed_and_index_alone() -> None:
    before = DEVICES[58].movement(10.0)
    draw.cache_clear()
    assert draw(1, 58) == DEVICES[58]
    assert draw(1, 58).movement(10.0) == before
    assert draw(2, 58) != DEVICES[58]


def test_out_of_sample_one_in_three_is_late_one_flexible_and_one_both() -> None:
    drawn = [draw_out_of_sample(1, index) for index in range(30)]
    for one in drawn:
        before, options, late = draw(1, one.index), one.options, one.options.force_delay_s / one.period_s
        assert (options.flexible is None) == (one.part == "fraction")
        assert (late > 0.0) == (one.part != "flexible")
        assert late <= 2.0
        assert options.bandwidth_hz == 0.0
        assert (options.mass_kg, options.hand, one.rate_hz) == (
            before.options.mass_kg,
            before.options.hand,
            before.rate_hz,
        )
        assert 0.19 < one.own_share < 5.01
    assert [one.part for one in drawn[:3]] == list(PARTS)
    assert any(one.options.flexible and one.options.flexible.sensor == "handle" for one in drawn)


def test_the_configuration_of_a_device_out_of_sample_has_all_that_it_has() -> None:
    for index in range(3):
        held = draw_out_of_sample(1, index)
        options = parse(held.config("none", 1.0), "device.toml").options
        assert options.model_dump() == held.moved(1.0).model_dump()


@pytest.mark.parametrize("kind", KINDS)
def test_a_hand_presses_more_eases_and_stays_when_it_is_said_to(kind: str) -> None:
    found = movement(kind, Random(kind), 10.0, GRIP)
    time_s = np.arange(0.0, 10.0, 1e-3)
    force = np.interp(time_s, [at for at, _ in found.points], [newton for _, newton in found.points])
    starts = [at for at, _ in found.phases]
    phases = np.array([phase for _, phase in found.phases])[np.searchsorted(starts, time_s, side="right") - 1]
    change = np.diff(force)
    pressed = phases[:-1] == IN
    assert change[pressed & (phases[1:] == IN)].max() <= 1e-3
    assert force[phases == HOLD].max(initial=-1.0) < 0.0
    assert np.all((change >= -1e-3) | (phases[:-1] != OUT) | (phases[1:] != OUT))
    assert force.min() >= -6.5
    assert (kind in ("press", "tap", "let-go")) == bool(found.releases)


def test_a_hand_that_lets_go_is_gone_within_20_ms_and_comes_back() -> None:
    found = movement("let-go", Random(3), 20.0, GRIP)
    gone, back = found.grips[0::2], found.grips[1::2]
    assert len(found.releases) == len(gone) == len(back)
    for released_s, opens, closes in zip(found.releases, gone, back, strict=True):
        assert released_s < opens["at_s"] < released_s + LET_GO_S
        assert [opens[name] for name in GRIP] == [0.0, 0.0, 0.0]
        assert released_s + 0.2 <= closes["at_s"] <= released_s + 2.1
        assert {name: closes[name] for name in GRIP} == GRIP
        forces = [newton for time_s, newton in found.points if released_s + LET_GO_S <= time_s <= closes["at_s"]]
        assert forces == [0.0] * len(forces)
        assert forces


@pytest.mark.parametrize("index", [6, 5, 1])
def test_the_configuration_of_a_device_runs_it_to_the_same_place(index: int) -> None:
    """Let go of, taken otherwise, tapped: the daemon's own tick ends where the batch does."""
    held = min((one for one in DEVICES if one.index % len(KINDS) == index), key=lambda one: one.rate_hz)
    run = simulate(parse(held.config("ring-damping", 3.0), "device.toml"), 3.0)
    true_m, _, _, force, _, damping = columns_of(moving_runs([held], law("ring-damping"), 3.0, CRITERION), 0)
    assert run.damping_n_s_per_m[-1] == damping[-1]
    assert list(run.x_m) == true_m.tolist()
    assert list(run.force_n) == force.tolist()


# --- scores ----------------------------------------------------------------------------------------------------------


def test_a_constant_dampers_work_over_the_leak_is_what_the_closed_form_says() -> None:
    """2 B / (k T) in a slow motion; an arrival adds what a held force does beyond it."""
    true_m = 1e-3 * np.sin(math.tau * 2.0 * 1e-3 * np.arange(5000, dtype=np.float64)) - 3e-3
    for damping in (5.0, 20.0, 50.0):
        force = -3000.0 * true_m - damping * np.diff(true_m, prepend=true_m[:1]) / 1e-3
        assert scores.work_over_leak(true_m, true_m, force, 3000.0) == pytest.approx(
            2.0 * damping / (3000.0 * 1e-3), rel=1e-3
        )
    held = device("stroke", 3000.0, resolution_m=0.0)
    for damping in (5.0, 20.0, 50.0):
        found = figures(held, f"damper:damping_n_s_per_m={damping:g}")
        assert 1.0 <= found["work_over_leak"] / (2.0 * damping / (3000.0 * 1e-3)) <= 1.15
        assert found["weighted_n_s_per_m"] == pytest.approx(damping)
    assert figures(held, "none")["work_over_leak"] == pytest.approx(0.0, abs=1e-9)


def test_the_least_damping_holds_and_a_tenth_less_does_not() -> None:
    chosen = [one for one in DEVICES[:60] if one.own_share > 1.5]
    least = least_damping(chosen, CRITERION)
    known = np.flatnonzero(np.isfinite(least))
    assert len(known) > 0.8 * len(chosen)
    devices = [chosen[int(at)] for at in known]
    assert calm(devices, least[known], CRITERION).all()
    assert not calm(devices, 0.9 * least[known], CRITERION).any()


def test_a_wall_that_is_held_without_a_law_needs_no_damping() -> None:
    held = device("press", 4000.0)
    assert least_damping([held], CRITERION)[0] == 0.0
    assert least_damping([device("press", 14000.0)], CRITERION)[0] > 1.0


def test_a_tap_hardens_energy_cycle_and_not_ring_damping() -> None:
    """A wall at half of what the device holds by itself: k T / 2 is all that there is to pay."""
    held = device("tap", 4000.0)
    assert held.own_share < 0.5
    assert figures(held, "energy-cycle")["base_n_s_per_m"] > 10.0 * held.leak_n_s_per_m
    assert figures(held, "ring-damping")["base_n_s_per_m"] < 1.5 * held.leak_n_s_per_m


def test_what_is_not_sent_is_missing_and_what_is_sent_too_much_is_counted() -> None:
    true_m = np.array([1.0, -1.0, -2.0, -2.0, -1.0, 1.0]) * 1e-3
    phases = np.array([IN, IN, IN, HOLD, OUT, OUT])
    ideal = np.maximum(0.0, -1000.0 * true_m)
    assert scores.force_errors(true_m, ideal, 1000.0, 12.0, phases) == [0.0, 0.0, 0.0]
    softer = scores.force_errors(true_m, 0.9 * ideal, 1000.0, 12.0, phases)
    assert softer == pytest.approx([0.1, 0.1, 0.1])
    assert scores.force_errors(true_m, np.minimum(ideal, 1.5), 1000.0, 1.5, phases) == [0.0, 0.0, 0.0]
    assert math.isnan(scores.force_errors(true_m, ideal, 1000.0, 12.0, np.zeros(6, dtype=int))[1])


def test_a_wall_that_pulls_the_leaving_hand_back_is_caught() -> None:
    x_m = np.array([1.0, -1.0, -3.0, -2.0, -1.0, 1.0, 1.0, -2.0, -1.0, 1.0])
    force = np.array([0.0, 2.0, 5.0, 1.0, -0.5, 0.0, 0.0, 2.0, -0.1, 0.0])
    left = scores.exits(x_m, force)
    assert left.pull_n.tolist() == [0.5, 0.1]
    assert left.push_n.tolist() == [5.0, 2.0]
    assert left.felt == 1
    assert scores.pull_share(x_m, force) == pytest.approx(2.0 / 6.0)


@pytest.mark.nightly
def test_a_hand_that_lets_go_leaves_a_damped_wall_late_and_slowly() -> None:
    held = device("let-go", 4000.0)
    free, glued = figures(held, "none"), figures(held, "damper:damping_n_s_per_m=100")
    assert glued["leave_s"] > 1.5 * free["leave_s"]
    assert glued["leave_m_per_s"] < 0.3 * free["leave_m_per_s"]
    assert free["exits_felt"] == 0.0 < glued["exits_felt"]


def test_displayed_impedance_is_that_of_a_spring_and_a_damper() -> None:
    time_s = np.arange(3000, dtype=np.float64) * 1e-3
    waves = [math.tau * hz for hz in (2.0, 7.0)]
    x_m = sum(1e-3 * np.sin(w * time_s) for w in waves) - 4e-3
    v = sum(1e-3 * w * np.cos(w * time_s) for w in waves)
    for hz in (2.0, 7.0):
        shown = scores.impedance(np.asarray(x_m), np.asarray(-3000.0 * x_m - 20.0 * v), time_s, hz)
        assert shown.real == pytest.approx(3000.0, rel=1e-3)
        assert shown.imag / (math.tau * hz) == pytest.approx(20.0, rel=1e-3)


def test_energy_bounding_shows_no_more_than_it_can_pay_for() -> None:
    """min(k, 2 p / T), p = 0.75 b: 6.6 of 12 kN/m; a damper shows all of them."""
    held = device("hold", 12000.0)
    assert figures(held, "energy-bounding")["shown_share_2hz"] == pytest.approx(6600.0 / 12000.0, rel=0.1)
    damped = figures(held, "damper")
    assert damped["shown_share_2hz"] == pytest.approx(1.0, abs=0.01)
    assert damped["shown_n_s_per_m_7hz"] == pytest.approx(50.0, rel=0.05)


def test_an_ideal_wall_is_as_hard_at_the_rate_as_it_is_stiff() -> None:
    time_s = np.arange(200, dtype=np.float64) * 1e-3
    x_m, v = 1e-3 - 0.1 * time_s, np.full(200, -0.1)
    assert scores.rate_hardness(x_m, v, np.maximum(0.0, -2000.0 * x_m), 1e-3) == pytest.approx(2000.0)
    assert math.isnan(scores.rate_hardness(np.full(200, 1.0), v, v, 1e-3))


# --- what is felt ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("hz", [5.0, 20.0, 40.0, 100.0, 160.0, 315.0])
def test_a_sine_at_the_threshold_has_a_felt_index_of_one(hz: float) -> None:
    time_s = np.arange(2000) / 2000.0
    wave = threshold_m(hz) * np.sin(math.tau * hz * time_s)
    assert felt_index(wave - 5e-3 + 1e-3 * time_s, 5e-4) == pytest.approx(1.0, abs=0.06)
    assert felt_index(3.0 * wave, 5e-4) == pytest.approx(3.0, abs=0.2)


def test_thresholds_are_the_published_ones_and_slow_motion_can_be_left_out() -> None:
    assert [threshold_m(hz) for hz in (3.0, 10.0, 20.0, 320.0)] == pytest.approx([26e-6, 26e-6, 8.5e-6, 0.06e-6])
    wave = 1e-3 * np.sin(math.tau * 5.0 * np.arange(2000) / 2000.0)
    assert felt_index(wave, 5e-4) > 30.0
    assert felt_index(wave, 5e-4, 40.0) < 0.1


def test_two_fast_vibrations_are_felt_together_and_two_slow_ones_are_not() -> None:
    time_s = np.arange(2000) / 2000.0
    fast = sum(threshold_m(hz) * np.sin(math.tau * hz * time_s) for hz in (50.0, 200.0))
    slow = sum(threshold_m(hz) * np.sin(math.tau * hz * time_s) for hz in (8.0, 20.0))
    assert felt_index(np.asarray(fast), 5e-4) == pytest.approx(math.sqrt(2.0), rel=0.06)
    assert felt_index(np.asarray(slow), 5e-4) == pytest.approx(1.0, rel=0.06)


def test_a_wall_far_below_its_limit_is_not_felt_and_one_beyond_it_is() -> None:
    calm_one, ringing = figures(device("hold", 4000.0), "none"), figures(device("hold", 14000.0), "none")
    assert calm_one["gentle_outcome"] == Outcome.SETTLED
    assert calm_one["gentle_felt"] < 1.0
    assert ringing["gentle_outcome"] == Outcome.MOVING
    assert ringing["gentle_felt"] > 10.0


def test_still_is_not_unfelt() -> None:
    """20 kN/m, 200 N s/m, 10 um: a few counts from peak to peak, and many times what a hand feels."""
    found = figures(device("hold", 20000.0, resolution_m=1e-5), "damper:damping_n_s_per_m=200")
    assert found["gentle_outcome"] == Outcome.SETTLED
    assert found["gentle_felt"] > 5.0
    assert found["gentle_chatter_n"] > 0.5


# --- the command -----------------------------------------------------------------------------------------------------


def test_every_installed_law_stands_in_the_table() -> None:
    labels = [one.label for one in every_law()]
    assert labels[0] == "none"
    assert labels[-2:] == ["energy-cycle", "ring-damping"]
    assert {"damper", "tdpa", "energy-bounding", "input-to-state", "set-position", "virtual-coupling"} < set(labels)


def test_laws_are_given_what_the_maker_of_the_device_knows() -> None:
    held = DEVICES[3]
    told = held.params(law("energy-bounding")).model_dump()
    assert told["device_damping_n_s_per_m"] == held.options.viscous_n_s_per_m
    coupling = held.params(law("virtual-coupling")).model_dump()
    spent = coupling["coupling_stiffness_n_per_m"] * held.period_s / 2.0 + coupling["coupling_damping_n_s_per_m"]
    assert 0.9 * held.options.viscous_n_s_per_m < spent < held.options.viscous_n_s_per_m


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("transparency")
    assert transparency("--quick", "--seed", "1", "--output", str(folder)) == 0
    return folder


def _csv(folder: Path) -> list[dict[str, Any]]:
    with (folder / "transparency.csv").open() as file:
        return list(csv.DictReader(file))


def test_a_quick_run_writes_a_line_a_law_and_device(quick: Path) -> None:
    lines = _csv(quick)
    assert len(lines) == 4 * 14
    assert {line["hand"] for line in lines} == set(KINDS)
    found = json.loads((quick / "transparency.json").read_text())
    of_all = {one["law"]: one for one in found["groups"]["all"]}
    assert list(of_all) == ["none", "damper", "energy-cycle", "ring-damping"]
    assert of_all["none"]["devices"] == found["held_by_some_damper"]
    assert of_all["none"]["held"] < 0.5 < of_all["ring-damping"]["held"]
    assert of_all["none"]["exits_felt"] == 0.0 < of_all["damper"]["exits_felt"]
    assert of_all["none"]["leaving"] == 1.0
    assert all(one["unfelt"] <= one["held"] <= one["still"] for one in of_all.values())
    assert (quick / "transparency.png").read_bytes().startswith(b"\x89PNG")
    assert not (quick / "transparency.journal").exists()


@pytest.mark.parametrize("index", [4, 13])
@pytest.mark.parametrize(
    "laws", [{"none", "ring-damping"}, pytest.param({"damper", "energy-cycle"}, marks=pytest.mark.nightly)]
)
def test_a_row_replayed_gives_the_same_figures_bit_for_bit(quick: Path, index: int, laws: set[str]) -> None:
    lines = [line for line in _csv(quick) if line["law"] in laws and line["device"] == f"1:{index}"]
    assert len(lines) == 2
    for line in lines:
        (row,) = rows([draw(1, index)], law(line["law"]), 6.0, CRITERION)
        _same(row, [line[name] for name in COLUMNS])
        if line["law"] == "none":
            (dampers,) = references.references([draw(1, index)], CRITERION)
            _same(dampers, [line[name] for name in references.COLUMNS])


def _same(row: Sequence[float], cells: Sequence[str]) -> None:
    assert [None if not math.isfinite(value) else value for value in row] == [
        float(cell) if cell else None for cell in cells
    ]


def test_one_device_can_be_looked_at_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("--replay", "1:6", "--seconds", "2", "--laws", "none,ring-damping", "--output", str(tmp_path))
    assert transparency(*arguments) == 0
    said = capsys.readouterr().out
    assert "hand = let-go" in said
    assert "work_over_leak" in said
    config = parse((tmp_path / "device-1-6.toml").read_text(), "device-1-6.toml").config
    assert config.controller.law == "ring-damping"
    with (tmp_path / "device-1-6.csv").open() as file:
        lines = list(csv.DictReader(file))
    held = draw(1, 6)
    assert [float(line["t_s"]) for line in lines] == times_of(held, round(2.0 / held.period_s)).tolist()
    assert (tmp_path / "device-1-6.png").exists()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--replay", "57"], "--replay 57: must be SEED:INDEX"),
        (["--devices", "0"], "--devices 0: must be from 1"),
        (["--seconds", "0.5"], "--seconds 0.5: must be from 1"),
        (["--seed", "-1"], "--seed -1: must be 0 or more"),
        (["--laws", "nolaw"], "no law 'nolaw'"),
        (["--output", __file__], "cannot be written"),
        (["--cluster", "127.0.0.1"], "must be the address of a dask scheduler"),
    ],
)
def test_what_cannot_be_done_is_said_before_it_is_begun(
    arguments: list[str],
    expected: str,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert transparency("--devices", "5", *arguments) == 2
    assert expected in capfd.readouterr().err
    assert list(tmp_path.iterdir()) == []
