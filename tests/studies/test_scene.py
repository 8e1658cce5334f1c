"""The scene study says what each term changes, and what it leaves over answers as the full model does."""

from __future__ import annotations

import json
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import tomlkit

from hapticd.cli import main
from hapticd.config.loading import LoadedConfig, load, parse
from hapticd.offline.outcome import Criterion
from hapticd.offline.rehearsal import rehearse
from hapticd.paths import directory
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.scene.answers import answers
from hapticd_studies.scene.study import Scene, study
from hapticd_studies.scene.terms import reduced, terms_of
from hapticd_studies.scene.ticks import SCENES, bare, scene_ticks, tick_operations

SECONDS = 1.0
SHIPPED = sorted(
    path.stem
    for path in directory("config").glob("*.toml")
    if tomllib.loads(path.read_text()).get("device", {}).get("driver", "loopback") == "loopback"
    and "linkage" not in path.read_text()  # an axis of one goes only with the linkage
)

FRICTION = """
# A rig on my bench.
[device.options]
model = "paper-simulation"
coulomb_n = 0.8            # the bearing is old
noise_m = 1e-9
viscous_n_s_per_m = 8.0
hand.force = { profile = "constant", newton = -3.0 }    # a weight
hand.mass_kg = 1e-6

[[scene.walls]]
stiffness_n_per_m = 2000.0  # soft
"""


def every_term() -> LoadedConfig:
    return load(directory("config") / "every-term.toml")


def found(text: str, tolerance: float = 0.05) -> Scene:
    return study(parse(text, "lab.toml"), SECONDS, tolerance, lambda _: None)


def run(*arguments: str) -> int:
    with pytest.raises(SystemExit) as left:
        main(["study", "scene", *arguments])
    return int(left.value.code or 0)


# --- what can be taken out -------------------------------------------------------------------------------------------


def test_every_term_of_the_full_configuration_is_one_that_can_be_taken_out() -> None:
    loaded = every_term()
    assert {term.name for term in terms_of(loaded)} == {
        "viscous friction", "Coulomb friction", "sensor steps", "sensor noise", "force limit", "actuator lag",
        "force delay", "hand mass", "hand damping", "hand spring", "changes of the device", "velocity filter",
        "damping of wall 0", "wall 1",
    }  # fmt: skip


def test_a_configuration_without_any_of_its_terms_has_none_left_and_all_of_its_comments() -> None:
    loaded = every_term()
    left = reduced(loaded, terms_of(loaded))
    assert not terms_of(left)
    assert isinstance(left.options, SimulationOptions)
    assert isinstance(loaded.options, SimulationOptions)
    assert left.options.hand.force == loaded.options.hand.force
    assert left.options.mass_kg == loaded.options.mass_kg
    assert left.config.scene.walls[0].stiffness_n_per_m == 3000.0
    comments = [line for line in loaded.text.splitlines() if line.startswith("#")]
    assert [line for line in left.text.splitlines() if line.startswith("#")] == comments


@pytest.mark.parametrize("name", SHIPPED)
def test_each_term_of_a_shipped_configuration_goes_alone(name: str) -> None:
    loaded = load(directory("config") / f"{name}.toml")
    names = [term.name for term in terms_of(loaded)]
    for term in terms_of(loaded):
        left = {one.name.replace("of the wall", "of wall 0") for one in terms_of(reduced(loaded, [term]))}
        gone = {one for one in names if one.replace("of the wall", "of wall 0") not in left}
        assert term.name in gone
        # Where a term is there through its changes alone, it goes with them and they with it.
        assert len(gone) == 1 or any("changes" in one for one in gone)


@pytest.mark.parametrize(
    "text",
    [
        '[device]\noptions = { model = "omega7", changes = [{ at_s = 1.0, coulomb_n = 0.1, mass_kg = 0.3 }] }',
        '[device.options]\nmodel = "falcon"\n[[device.options.changes]]\nat_s = 1.0\ncoulomb_n = 0.1\n',
        "",
        "\ufeff[device.options]\r\ncoulomb_n = 0.1\r\n",
        "[device.options.hand]\ndamping_n_s_per_m = 2.0\n"
        "[[device.options.changes]]\nat_s = 0.5\nhand_damping_n_s_per_m = 3.0",
        '[velocity]\nestimator = "lowpass"\n'
        "[[scene.walls]]\nstiffness_n_per_m = 1e3\nchanges = [{ at_s = 1.0, damping_n_s_per_m = 2.0 }]",
    ],
)
def test_terms_go_however_the_file_writes_them(text: str) -> None:
    loaded = parse(text, "lab.toml")
    terms = terms_of(loaded)
    assert terms
    assert not terms_of(reduced(loaded, terms))


def test_walls_keep_their_numbers_while_several_go() -> None:
    walls = "".join(f"[[scene.walls]]\nposition_m = -{at}.0\nstiffness_n_per_m = {at + 1}e3\n" for at in range(4))
    loaded = parse(walls, "lab.toml")
    named = {term.name: term for term in terms_of(loaded)}
    left = reduced(loaded, [named["wall 1"], named["wall 3"]])
    assert [wall.stiffness_n_per_m for wall in left.config.scene.walls] == [1e3, 3e3]


# --- what is needed --------------------------------------------------------------------------------------------------


def test_what_matters_stays_and_what_does_not_goes() -> None:
    """Friction of a quarter of the press moves the place of rest; a milligram in the hand does not."""
    scene = found(FRICTION)
    gone = {term.name for term in scene.left_out}
    assert {"sensor noise", "hand mass"} <= gone
    assert "Coulomb friction" not in gone
    broken = {one.term.name: one.broken for one in scene.removals}
    assert broken["Coulomb friction"]
    assert not broken["hand mass"]
    assert scene.minimal_operations < scene.operations
    assert "# A rig on my bench." in scene.minimal.text
    assert "# the bearing is old" in scene.minimal.text


def test_the_smallest_model_keeps_every_answer_and_nothing_more_can_go() -> None:
    """Not even what could not go alone: the sensor's steps are needed by a filter that itself is not."""
    scene = study(every_term(), SECONDS, 0.05, lambda _: None)
    full = rehearse(every_term(), SECONDS)
    assert not answers(rehearse(scene.minimal, SECONDS), full).broken(0.05)
    assert scene.proven
    for term in terms_of(scene.minimal):
        smaller = reduced(scene.minimal, [term])
        assert answers(rehearse(smaller, SECONDS), full).broken(0.05), f"{term.name} could go as well"
    steps = next(one for one in scene.removals if one.term.name == "sensor steps")
    assert steps.broken
    assert steps.term in scene.left_out


def test_with_no_tolerance_only_what_changes_nothing_at_all_goes() -> None:
    scene = study(every_term(), SECONDS, 0.0, lambda _: None)
    assert {"wall 1", "force limit"} <= {term.name for term in scene.left_out}
    exact, least = rehearse(every_term(), SECONDS), rehearse(scene.minimal, SECONDS)
    assert least.columns["x_m"] == exact.columns["x_m"]
    assert least.columns["force_n"] == exact.columns["force_n"]


def test_a_looser_tolerance_never_needs_more() -> None:
    counts = [len(found(FRICTION, tolerance).left_out) for tolerance in (0.0, 0.01, 0.1, 10.0)]
    assert counts == sorted(counts)
    assert counts[0] < counts[-1]


def test_the_second_wall_that_is_reached_is_needed() -> None:
    text = FRICTION + "[[scene.walls]]\nposition_m = -0.0005\nstiffness_n_per_m = 9000.0\n"
    scene = found(text)
    assert "wall 1" not in {term.name for term in scene.left_out}


# --- the command -----------------------------------------------------------------------------------------------------


def test_the_command_saves_a_configuration_that_loads_and_says_where_it_comes_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lab, minimal = tmp_path / "lab.toml", tmp_path / "minimal.toml"
    lab.write_text(FRICTION)
    assert run("--config", str(lab), "--duration", str(SECONDS), "--output", str(minimal)) == 0
    shown = capsys.readouterr().out
    assert len(shown.splitlines()) < 24
    assert "this scene needs" in shown
    text = minimal.read_text()
    assert text.startswith(f"# {lab} without what its scene does not need within 5 %: ")
    assert load(minimal).config.scene.walls[0].stiffness_n_per_m == 2000.0
    assert tomlkit.parse(text)["device"]["options"]["coulomb_n"] == 0.8


def test_the_default_output_fits_a_screen(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--duration", "0.5") == 0
    shown = capsys.readouterr().out
    assert len(shown.splitlines()) <= 50
    table = shown.split("\n\n")[0]
    assert all(len(line) <= 80 for line in table.splitlines())
    assert all(term.name in table for term in terms_of(every_term()))


def test_json_says_what_the_table_says_and_more(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lab = tmp_path / "lab.toml"
    lab.write_text(FRICTION)
    assert run("--config", str(lab), "--duration", "0.5", "--json") == 0
    told: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert {term["name"] for term in told["terms"]} == {term.name for term in terms_of(load(lab))}
    left = {term.name for term in terms_of(parse(told["minimal"]["config"], "told"))}
    assert left == {term["name"] for term in told["terms"]} - set(told["minimal"]["without"])
    assert {one["name"] for one in told["ticks"]} == set(SCENES)
    assert told["criterion"] == Criterion().declared()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--tolerance", "-1"], "--tolerance -1"),
        (["--tolerance", "nan"], "--tolerance nan"),
        (["--duration", "0"], "--duration 0"),
        (["--output", "/nowhere/at/all.toml"], "--output /nowhere/at/all.toml"),
        (["--config", str(directory("config") / "omega7.toml")], "only a simulated device"),
    ],
)
def test_a_misuse_is_named(arguments: list[str], named: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*arguments) == 2
    assert named in capsys.readouterr().err


# --- what a tick contains --------------------------------------------------------------------------------------------


def test_every_plain_wall_costs_the_same_and_an_empty_loop_none_of_it() -> None:
    """One more wall is one more time the same instructions, and the loop around it does not grow."""
    ticks = {one.name: one for one in scene_ticks()}
    wall = ticks["one wall"].operations - ticks["empty loop"].operations
    assert wall > 0
    assert ticks["two walls"].operations - ticks["one wall"].operations == wall
    assert ticks["three walls"].operations - ticks["two walls"].operations == wall
    assert all(one.steady for one in ticks.values() if one.name != "one wall, sensor with steps")


def test_the_page_shows_the_counts_as_they_are() -> None:
    """On another version of Python than the page names, whose instructions are others: what costs more than what."""
    page = (Path(__file__).parent.parent.parent / "docs" / "accuracy.md").read_text()
    ticks = {one.name: one.operations for one in scene_ticks()}
    version = re.search(r"^\| scene, .* CPython (\d+)\.(\d+) \|", page, flags=re.MULTILINE)
    assert version is not None
    as_named = sys.version_info[:2] == tuple(map(int, version.groups()))
    on_page: dict[str, int] = {}
    for shown, name in (
        ("no wall", "empty loop"), ("one wall, pressed", "one wall"), ("two walls", "two walls"),
        ("three walls", "three walls"), ("one wall with damping", "one wall with damping"),
        ("device with Coulomb friction", "one wall, device with friction"),
    ):  # fmt: skip
        (count,) = re.findall(rf"^\| {shown} \| (\d+)", page, flags=re.MULTILINE)
        on_page[name] = int(count)
        assert not as_named or int(count) == ticks[name], (
            f"{shown}: a tick takes {ticks[name]} instructions, docs/accuracy.md says {count}: if it has to, update it"
        )
    assert sorted(on_page, key=lambda name: on_page[name]) == sorted(on_page, key=lambda name: ticks[name])


def test_what_a_scene_names_it_pays_for() -> None:
    ticks = {one.name: one.operations for one in scene_ticks()}
    named = [name for name in ticks if re.match("one wall(,| with| that)", name) and "touched" not in name]
    assert len(named) == len(ticks) - 5, "all but the empty loop and the four scenes of plain walls"
    assert [name for name in named if ticks[name] <= ticks["one wall"]] == []


def test_a_term_with_the_value_of_nothing_is_not_there() -> None:
    plain = tick_operations(parse(bare(), "plain"))
    nothing = bare(
        wall="damping_n_s_per_m = 0.0\nchanges = []",
        device="coulomb_n = 0.0\nnoise_m = 0.0\nforce_delay_samples = 0\nbandwidth_hz = 0.0\nchanges = []",
        rest='[velocity]\nestimator = "difference"\nsamples = 1',
    )
    assert tick_operations(parse(nothing, "nothing")) == plain


def test_a_wall_that_has_changed_for_the_last_time_costs_no_more_than_one_that_never_does() -> None:
    plain = tick_operations(parse(bare(), "plain"))
    changed = tick_operations(parse(bare(wall="changes = [{ at_s = 0.05, stiffness_n_per_m = 1900.0 }]"), "changed"))
    assert changed == plain


@pytest.mark.nightly
@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_configuration_gets_a_smallest_model_that_keeps_its_answers(name: str) -> None:
    loaded = load(directory("config") / f"{name}.toml")
    scene = study(loaded, 3.0, 0.05, lambda _: None)
    assert not scene.minimal_answers.broken(0.05)
    assert parse(scene.minimal.text, name)
