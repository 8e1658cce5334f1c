"""What a scene in space needs: axes, objects, friction, each taken out and held against the full model."""

from __future__ import annotations

import json

import pytest

from hapticd.cli import main
from hapticd.config.loading import LoadedConfig, load, parse
from hapticd.offline.rehearsal import rehearse
from hapticd.paths import directory
from hapticd_studies.scene.answers import answers
from hapticd_studies.scene.study import Scene, study
from hapticd_studies.scene.terms import reduced, terms_of

SECONDS = 0.5
FAR = '\n[[scene.objects]]\nname = "lamp"\nshape = "sphere"\nradius_m = 0.02\nposition_m = [0.0, 0.3, 0.3]\n'


def table() -> LoadedConfig:
    """A hand strokes over a table with friction, along x; a lamp is far away."""
    text = (directory("config") / "table-edge.toml").read_text().replace("period_s = 4.0", "period_s = 1.0")
    return parse(text + FAR + "stiffness_n_per_m = 4000.0\n", "table.toml")


@pytest.fixture(scope="module")
def scene() -> Scene:
    return study(table(), SECONDS, 0.05, lambda _: None)


def without(loaded: LoadedConfig, *names: str) -> LoadedConfig:
    return reduced(loaded, [term for term in terms_of(loaded) if term.name in names])


def test_a_stroke_needs_its_axes_the_table_and_its_friction_and_nothing_it_never_touches(scene: Scene) -> None:
    needed = {one.term.name: one.broken for one in scene.removals}
    gone = {term.name for term in scene.left_out}
    assert {"axis y", "object lamp"} <= gone
    assert not {"axis x", "axis z", "object table", "friction of table"} & gone
    assert {"force", "path"} <= set(needed["object table"])
    assert "force" in needed["friction of table"]


def test_the_smallest_model_keeps_every_answer(scene: Scene) -> None:
    run = rehearse(parse(scene.minimal.text, "again"), SECONDS)
    assert not answers(run, rehearse(table(), SECONDS)).broken(0.05)
    left = {one.term.name for one in scene.removals if one.term not in scene.left_out}
    assert {term.name for term in terms_of(scene.minimal)} == left - {"object table"}  # the last object stays


def test_an_axis_that_is_left_out_stays_where_it_starts_and_the_others_do_not_feel_it() -> None:
    full, held = (rehearse(each, SECONDS) for each in (table(), without(table(), "axis y")))
    assert set(held.columns["position_y_m"]) == {0.0}
    assert held.columns["position_x_m"] == full.columns["position_x_m"]  # nothing pushes it along y here
    assert answers(held, full).path < 1e-9


def test_a_coupled_device_is_first_taken_apart_and_then_loses_an_axis() -> None:
    ball = load(directory("config") / "ball.toml")
    names = {term.name for term in terms_of(ball)}
    assert {"coupling of the axes", "axis x", "axis y", "axis z"} <= names
    apart = without(ball, "coupling of the axes", "axis y")
    full, run = rehearse(ball, SECONDS), rehearse(apart, SECONDS)
    assert set(run.columns["position_y_m"]) == {0.0}
    found = answers(run, full)
    assert found.path > 0.0
    assert found.felt > 0.0


def test_the_command_says_of_each_what_it_changes(capsys: pytest.CaptureFixture[str]) -> None:
    config = directory("config") / "table-edge.toml"
    with pytest.raises(SystemExit) as left:
        main(["study", "scene", "--config", str(config), "--duration", str(SECONDS), "--json"])
    assert not left.value.code
    told = json.loads(capsys.readouterr().out)
    terms = {one["name"]: one for one in told["terms"]}
    assert terms["friction of table"]["answers"]["force"] > 0.05
    assert terms["axis y"]["answers"]["path"] < 1e-6
    assert {"path", "felt"} <= set(terms["axis z"]["answers"])
