"""Figures from one place: what they show is what was run, no spike and no gap is lost, and they print."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

import hapticd
from hapticd.errors import ConfigError, HapticdError
from hapticd.figures import panels, style
from hapticd.figures.curves import MOST_POINTS, Curves
from hapticd.figures.picture import encoded, save
from hapticd.figures.sheets import COLUMN_IN, NAMES, PAGE_IN, draw
from tests.examples import examples

CONFIG = Path(__file__).parent.parent.parent / "config"


def made(count: int = 1000, **columns: npt.NDArray[Any]) -> Curves:
    time_s = np.arange(count) * 1e-3
    x_m = -1e-3 * np.sin(2.0 * math.pi * 5.0 * time_s + 0.1)
    force_n = -12e3 * np.minimum(x_m, 0.0)
    return Curves("made", {"t_s": time_s, "x_m": x_m, "force_n": force_n, **columns}, 12e3)


@pytest.fixture(scope="module")
def held() -> list[Curves]:
    runs = [hapticd.simulate(CONFIG / f"wall-{k}-energy-cycle.toml", 0.6) for k in (12, 18, 20)]
    late_us = np.random.default_rng(1).exponential(8.0, 600)
    return [replace(run.curves, columns={**run.columns, "late_us": late_us}) for run in runs]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("count", [1, 3])
def test_every_figure_is_drawn_of_one_run_and_of_several(name: str, count: int, held: list[Curves]) -> None:
    figure = draw(name, held[:count])
    assert encoded(figure, ".png")[1:4] == b"PNG"
    for axes in figure.axes:
        assert axes.lines or axes.patches, axes.get_ylabel()
        if axes.get_ylabel() and name != "lateness":
            assert axes.get_ylabel().endswith("]"), "a quantity without its unit"


def test_a_line_is_the_column_tick_by_tick(held: list[Curves]) -> None:
    position, force, energy, _ = draw("run", held[:1]).axes
    lines = {line.get_label(): line for axes in (position, force, energy) for line in axes.lines}
    assert np.array_equal(lines["true"].get_ydata(), held[0]["x_m"] * 1e3)
    assert np.array_equal(lines["measured"].get_ydata(), held[0]["x_measured_m"] * 1e3)


def test_a_cycle_ends_where_the_energy_is_least(held: list[Curves]) -> None:
    run = held[0]
    ends = run.cycle_ends()
    counted = np.flatnonzero(np.diff(run["cycle"])) + 1
    assert len(ends) == len(counted) > 5
    energy_j = run["energy_j"]
    for end, at in zip(ends, counted, strict=True):
        assert energy_j[end] == energy_j[max(0, end - 2) : at + 1].min()
        assert end <= at
    assert (ends < counted).any()


def test_a_spike_of_one_tick_is_drawn_however_long_the_run_is() -> None:
    values = np.zeros(200_000)
    values[123_457], values[7] = 8.0, -3.0
    run = made(len(values), late_us=values)
    time_s, drawn = run.line("late_us")
    assert len(drawn) <= 1.2 * MOST_POINTS
    assert (drawn.max(), drawn.min()) == (8.0, -3.0)
    assert time_s[drawn.argmax()] == pytest.approx(123.457)


@pytest.mark.parametrize("count", [1000, 50_000])
def test_missing_ticks_break_the_line(count: int) -> None:
    whole = made(count)
    kept = np.ones(count, bool)
    kept[500:520] = False
    run = replace(whole, columns={name: np.asarray(column)[kept] for name, column in whole.columns.items()})
    time_s, drawn = run.line("x_m")
    breaks = np.flatnonzero(np.isnan(drawn))
    assert len(breaks) == 1
    assert time_s[breaks[0]] == pytest.approx(0.52)
    assert not np.isnan(whole.line("x_m")[1]).any()


def test_the_stiffness_shown_is_force_over_depth_in_contact_only() -> None:
    run = made()
    shown = panels.displayed_stiffness_n_per_m(run, panels.SMOOTHED_S)
    inside = run["x_m"] < 0.0
    assert np.isnan(shown[~inside]).all()
    assert shown[inside] == pytest.approx(12e3)


def test_the_latest_tick_stands_in_the_histogram() -> None:
    late_us = np.full(10_000, 5.0)
    late_us[17] = 4321.0
    axes = draw("lateness", [made(10_000, late_us=late_us)]).axes[0]
    dot = next(line for line in axes.lines if line.get_marker() == "o")
    assert np.asarray(dot.get_xdata()).tolist() == [4321.0]
    assert axes.get_xlim()[1] > 4321.0


def test_the_figure_after_fig_9_begins_at_the_contact(held: list[Curves]) -> None:
    """A recording begins at any time; the paper's figure begins where the wall is touched."""
    count = 5000
    time_s = np.arange(count) * 1e-3
    x_m = np.where(time_s < 3.0, 0.004, -0.001)
    run = Curves("late", {"t_s": time_s, "x_m": x_m, "force_n": np.zeros(count)})
    figure = draw("fig9", [run, *held])
    line = next(line for line in figure.axes[0].lines if np.size(line.get_xdata()) > 10)
    drawn_s, drawn_mm = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    assert drawn_s[np.argmax(drawn_mm < 0.0)] == pytest.approx(0.0, abs=1e-9)
    assert drawn_s[-1] == pytest.approx(0.499, abs=1e-9)
    assert figure.get_figwidth() == PAGE_IN


def test_several_runs_are_told_apart_and_named(held: list[Curves]) -> None:
    many = [replace(held[at % 3], name=f"run {at}") for at in range(14)]
    axes = draw("position", many).axes[0]
    named = [line for line in axes.lines if str(line.get_label()).startswith("run ")]
    assert len({str(line.get_label()) for line in named}) == 14
    assert len({(str(line.get_color()), str(panels.hand(at)["linestyle"])) for at, line in enumerate(named)}) == 14


MATHEMATICS = ["$", "a$b$c", "run$^$1.mcap", "$\\frac$", "$x_1$", "\\", "\\$", "_", "_$a_b$", "a_b^c", "%", "{}", "#&~"]
"""Names of files; matplotlib takes what stands between two $ for mathematics, and much of it for a mistake."""


@pytest.mark.parametrize("name", ["run", "loop", "lateness", "fig9"])
def test_the_name_of_a_run_is_drawn_as_it_is_whatever_is_in_it(name: str, held: list[Curves]) -> None:
    runs = [replace(held[0], name=called) for called in MATHEMATICS]
    shown = drawn_texts(draw(name, runs, "of $\\frac$"))
    assert "of $\\frac$" in shown
    for run in runs:
        assert any(text == run.name or text.startswith(f"{run.name}: ") for text in shown), run.name


@examples(30)
@given(called=st.sampled_from(MATHEMATICS) | st.text(st.sampled_from("$\\_^{}ab% "), min_size=1))
def test_a_title_of_any_marks_is_drawn_as_it_is(called: str) -> None:
    assert called.strip() in ["", *drawn_texts(draw("loop", [made()], called))]


def test_the_numbers_of_a_histogram_are_written_as_they_are_spoken(held: list[Curves]) -> None:
    """Powers of ten are mathematics to matplotlib, which is not drawn where names are."""
    figure = draw("lateness", held)
    assert {"0.1", "0.01", "10"} <= set(drawn_texts(figure))
    assert not any("$" in text for text in drawn_texts(figure))


def drawn_texts(figure: Figure) -> list[str]:
    """All texts of a figure as a reader of its SVG sees them."""
    with mpl.rc_context({"svg.fonttype": "none"}):
        root = ElementTree.fromstring(encoded(figure, ".svg"))
    found = root.iter("{http://www.w3.org/2000/svg}text")
    return ["".join(text.itertext()).strip() for text in found]


@pytest.mark.parametrize("name", ["run", "loop", "lateness", "fig9"])
def test_a_title_and_the_names_of_runs_lie_apart(name: str, held: list[Curves]) -> None:
    figure = draw(name, held, "a title")
    encoded(figure, ".png")  # lays it out
    legend = figure.legends[0]
    if legend.get_title().get_text():
        assert figure._suptitle is None  # type: ignore[attr-defined]  # matplotlib has no other way to ask
    else:
        title = next(text for text in figure.texts if text.get_text() == "a title")
        assert not title.get_window_extent().overlaps(legend.get_window_extent())


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_a_figure_is_a_file_and_the_same_one_again(suffix: str, held: list[Curves], tmp_path: Path) -> None:
    path = tmp_path / f"run{suffix}"
    save(draw("run", held[:1]), path)
    first = path.read_bytes()
    save(draw("run", held[:1]), path)
    assert path.read_bytes() == first
    if suffix == ".svg":
        root = ElementTree.fromstring(first)
        assert root.get("width") == f"{COLUMN_IN * 72.0:g}pt"


def test_what_cannot_be_drawn_is_said(held: list[Curves], tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="figure 'pie': there are run, position"):
        draw("pie", held)
    with pytest.raises(HapticdError, match="no column late_us, which figure lateness shows"):
        draw("lateness", [made()])
    with pytest.raises(ConfigError, match=r"must end in \.png, \.svg or \.pdf"):
        save(draw("loop", held), tmp_path / "run.gif")
    with pytest.raises(HapticdError, match="cannot be written: No such file"):
        save(draw("loop", held), tmp_path / "no" / "run.png")
    with pytest.raises(HapticdError, match="has no column x_m, force_n"):
        Curves("odd.csv", {"t_s": [0.0], "y": [1.0]})
    with pytest.raises(HapticdError, match="holds no tick"):
        Curves("empty.csv", {"t_s": [], "x_m": [], "force_n": []})
    with pytest.raises(HapticdError, match="never touches its wall"):
        draw("fig9", [Curves("free", {"t_s": [0.0], "x_m": [1.0], "force_n": [0.0]})])
    with pytest.raises(HapticdError, match=r"no tick from 5 to 6 s; it has them from 0 to 0\.999 s"):
        made().between(5.0, 6.0)


def test_the_colours_of_curves_are_told_apart_with_any_vision() -> None:
    """CIELAB distance under full dichromacy (Machado, Oliveira & Fernandes 2009); 2 is just seen side by side."""
    for matrix in _DICHROMACY.values():
        seen = [_lab(np.array(matrix) @ _linear(colour)) for colour in style.SERIES]
        nearest = min(math.dist(a, b) for a, b in itertools.combinations(seen, 2))
        assert nearest > 15.0


_DICHROMACY = {
    "none": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def _linear(colour: str) -> npt.NDArray[np.float64]:
    values = [int(colour[at : at + 2], 16) / 255.0 for at in (1, 3, 5)]
    return np.array([one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in values])


def _lab(linear: npt.NDArray[np.float64]) -> tuple[float, float, float]:
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ linear.clip(
        0.0, 1.0
    )
    x, y, z = (one ** (1 / 3) if one > 0.008856 else 7.787 * one + 16 / 116 for one in xyz / [0.95047, 1.0, 1.08883])
    return 116 * y - 16, 500 * (x - y), 200 * (y - z)
