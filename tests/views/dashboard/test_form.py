"""Every shipped configuration as a form: each field's key is one that can be edited, and holds the file's value."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hapticd.config.editing import with_edits
from hapticd.config.loading import load, parse
from hapticd.paths import directory
from hapticd_views.dashboard.editor import _EDITABLE
from hapticd_views.dashboard.form import form

CONFIGS = sorted(directory("config").glob("*.toml"))


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_what_the_form_holds_is_what_the_file_means(path: Path) -> None:
    loaded = load(path)
    shown = json.loads(json.dumps(form(loaded), allow_nan=False))
    (law,) = [law for law in shown["laws"] if law["name"] == shown["law"]]
    fields = [*law["fields"], *shown["limits"], *(field for part in shown["scene"] for field in part["fields"])]
    assert all(_EDITABLE.fullmatch(field["key"]) for field in fields)
    assert all(field["kind"] in ("number", "whole", "flag", "choice", "text") for field in fields)
    same = parse(with_edits(loaded.text, str(path), {field["key"]: field["value"] for field in fields}), str(path))
    assert same.params == loaded.params
    assert same.config.scene == loaded.config.scene
    assert same.config.safety == loaded.config.safety


def test_an_object_goes_by_its_name_and_its_stiffness_can_be_edited() -> None:
    loaded = load(directory("config") / "ball.toml")
    (ball,) = form(loaded)["scene"]
    assert ball["title"] == "ball (sphere)"
    key = "scene.objects[0].stiffness_n_per_m"
    assert key in [field["key"] for field in ball["fields"]]
    edited = parse(with_edits(loaded.text, "ball.toml", {key: 700.0}), "ball.toml")
    assert edited.config.scene.objects[0].stiffness_n_per_m == 700.0
