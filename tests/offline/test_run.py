"""One run of a configuration: every tick as a column, and one answer to what became of it."""

from __future__ import annotations

import math
import pickle
import subprocess
import sys
from array import array
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hapticd
from hapticd.config.loading import LoadedConfig, parse
from hapticd.errors import ConfigError
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.offline.run import Row, Run

PRESS = """
[device.options]
initial_position_m = 0.002
hand.force = {{ profile = "{profile}", newton = -3.0{rest} }}
{device}
[[scene.walls]]
position_m = 0.01
stiffness_n_per_m = {stiffness}
[controller]
law = "{law}"
[safety]
profile = "simulation"
"""


def press(
    stiffness: float = 5000.0, law: str = "none", device: str = "", profile: str = "constant", rest: str = ""
) -> LoadedConfig:
    return parse(PRESS.format(stiffness=stiffness, law=law, device=device, profile=profile, rest=rest), "lab.toml")


@pytest.fixture(scope="module")
def settled() -> Run:
    return hapticd.simulate(press(), 3.0)


def test_every_column_is_the_rows_value_tick_by_tick() -> None:
    rows: list[Row] = []
    hapticd.simulate(press(), 0.7, take=rows.append)
    run = hapticd.simulate(press(), 0.7)
    for name in Row._fields:
        column = getattr(run, name)
        assert isinstance(column, np.ndarray)
        assert column.tolist() == [getattr(row, name) for row in rows], name
    assert [str(column.dtype) for column in (run.x_m, run.cycle, run.in_contact)] == ["float64", "int64", "bool"]
    with pytest.raises(ValueError, match="read-only"):
        run.x_m[0] = 1.0


def test_an_hour_is_kept_as_its_last_half_second_and_judged_as_if_all_of_it_were(settled: Run) -> None:
    streamed = hapticd.simulate(press(), 3.0, take=lambda _: None)
    assert {name: len(column) for name, column in streamed.columns.items()} == dict.fromkeys(Row._fields, 500)
    assert streamed.summary == settled.summary
    assert streamed.columns["x_m"] == settled.columns["x_m"][-500:]


@pytest.mark.parametrize(
    ("config", "outcome"),
    [
        (press(), Outcome.SETTLED),
        (press(30e3), Outcome.MOVING),
        (
            press(law="tests.studies.pushing_law", device="resolution_m = 0.0").with_values(
                {"device.options.initial_position_m": 0.0}
            ),
            Outcome.ELSEWHERE,
        ),
        (press(device="viscous_n_s_per_m = -60.0\nmax_force_n = 0.0"), Outcome.DIVERGED),
        (press(profile="sine", rest=", frequency_hz = 2.0"), Outcome.RUNS),
    ],
    ids=lambda value: value.name if isinstance(value, Outcome) else "",
)
def test_what_becomes_of_a_press_is_one_word(config: LoadedConfig, outcome: Outcome) -> None:
    run = hapticd.simulate(config, 3.0)
    assert run.outcome is outcome
    assert run.summary["outcome"] == str(outcome) == outcome.words
    assert outcome.words in repr(run)
    assert math.isnan(run.settled_s) is (outcome is not Outcome.SETTLED)


def test_the_settling_time_is_when_the_device_came_to_its_place_to_stay(settled: Run) -> None:
    """The band is the criterion's own: a tenth of the depth here, 0.6 mm below a surface that stands at 0."""
    off_m = np.abs(settled.x_m + 3.0 / 5000.0)
    band_m = Criterion().place_limit_m(settled.options, settled.balance)
    assert band_m == pytest.approx(6e-5)
    tick = settled.settled_tick
    assert tick is not None
    assert 0 < settled.settled_s == tick * 1e-3 < 1.0
    assert off_m[tick - 1] > band_m
    assert (off_m[tick:] <= band_m).all()


def test_the_stiffness_shown_is_force_over_depth(settled: Run) -> None:
    last = slice(-500, None)
    assert settled.displayed_stiffness_n_per_m == pytest.approx(
        -settled.force_n[last].mean() / settled.x_m[last].mean()
    )
    assert settled.displayed_stiffness_n_per_m == pytest.approx(settled.stiffness_n_per_m, rel=0.02)
    assert math.isnan(hapticd.simulate(press(), 0.01).displayed_stiffness_n_per_m)


def test_the_peak_is_of_the_whole_run(settled: Run) -> None:
    assert settled.peak_force_n == np.abs(settled.force_n).max() > np.abs(settled.force_n[-500:]).max()


def test_a_run_shorter_than_the_window_is_judged_by_all_of_it() -> None:
    run = hapticd.simulate(press(), 0.1)
    assert run.ticks == len(run) == 100
    assert run.window_s == pytest.approx(0.1)
    assert run.peak_to_peak_m == np.ptp(run.x_m)


def test_a_run_can_be_kept_and_sent_to_another_process(settled: Run) -> None:
    again = pickle.loads(pickle.dumps(settled))
    assert again.summary == settled.summary
    assert np.array_equal(again.x_m, settled.x_m)


def test_progress_counts_ticks() -> None:
    told: list[int] = []
    hapticd.simulate(press(), 5.0, progress=told.append)
    assert told == [2000, 4000]


@pytest.mark.parametrize("duration_s", [0.0, -1.0, math.nan, math.inf])
def test_a_time_that_makes_no_sense_is_refused(duration_s: float) -> None:
    with pytest.raises(ConfigError, match="duration = "):
        hapticd.simulate(press(), duration_s)


def test_a_real_device_does_not_run_offline() -> None:
    with pytest.raises(ConfigError, match="only a simulated device runs offline"):
        hapticd.simulate('[device]\ndriver = "serial-rig"\n')


# -- how it is shown


def test_a_plot_shows_position_force_energy_and_damping_of_every_tick() -> None:
    run = hapticd.simulate(press(20e3, "energy-cycle"), 1.0)
    panels = run.plot().axes
    assert [panel.get_ylabel() for panel in panels] == [
        "position [mm]",
        "force [N]",
        "energy [mJ]",
        "damping [N s/m]",
    ]
    lines = {line.get_label(): line for panel in panels for line in panel.lines}
    assert np.array_equal(lines["true"].get_ydata(), run.x_m * 1e3)
    balance = np.asarray(lines["balance"].get_ydata())
    assert balance == pytest.approx(run.balance.x_m * 1e3)
    assert [axes.get_ylabel() for axes in run.plot("stiffness").axes] == ["displayed stiffness [kN/m]"]


def test_a_notebook_shows_a_small_picture_and_the_outcome(settled: Run) -> None:
    shown = settled._repr_html_()
    assert shown.startswith('<img alt="run" src="data:image/png;base64,')
    assert "settled after" in shown
    assert len(shown) < 200_000


WITHOUT_EXTRAS = """
import sys
sys.modules["numpy"] = sys.modules["matplotlib"] = None
import hapticd
from hapticd.errors import HapticdError
run = hapticd.simulate(TEXT, 0.6)
print(type(run.x_m).__name__, len(run.x_m), run.outcome.words, run._repr_html_().startswith("<pre>"))
grid = hapticd.sweep(TEXT, "scene.walls[0].stiffness_n_per_m", [2000.0, 3000.0], duration_s=0.6)
print(type(grid.peak_force_n).__name__, len(grid.peak_force_n[0]))
try:
    run.plot()
except HapticdError as error:
    print(error)
"""


def test_without_the_study_extra_columns_are_plain_and_a_plot_says_what_to_install(tmp_path: Path) -> None:
    text = press().text
    script = WITHOUT_EXTRAS.replace("TEXT", repr(text))
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    first, second, third = done.stdout.splitlines()
    assert first == "array 600 keeps moving True"
    assert second == "list 2"
    assert third == "a plot needs matplotlib: pip install 'hapticd[study]'"


def test_columns_by_name_are_plain_arrays_that_a_run_without_numpy_has_too(settled: Run) -> None:
    kinds: dict[str, Any] = {name: column.typecode for name, column in settled.columns.items()}
    assert kinds == {name: {"cycle": "q", "in_contact": "b", "armed": "b"}.get(name, "d") for name in Row._fields}
    assert all(isinstance(column, array) for column in settled.columns.values())


def test_a_still_wall_may_be_felt_and_says_so(settled: Run) -> None:
    """20 kN/m with 200 N s/m and steps of 10 um: still by the rule, and many times what a hand feels."""
    law = {"controller.params.damping_n_s_per_m": 200.0}
    hums = hapticd.simulate(press(20e3, law="damper").with_values(law), 3.0)
    assert hums.outcome is settled.outcome is Outcome.SETTLED
    assert hums.felt_index > 5.0 > 1.0 > settled.felt_index
    assert hums.force_chatter_n > 0.5 > settled.force_chatter_n
    assert f"felt {hums.felt_index:.2g} times the threshold, force chatter" in hums.words[1]
    assert hums.summary["felt_index"] == hums.felt_index
    assert math.isnan(hapticd.simulate(press(profile="sine", rest=", frequency_hz = 2.0"), 1.0).felt_index)
