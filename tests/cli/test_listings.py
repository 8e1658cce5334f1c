"""`hapticd config`, `devices` and `controllers` list what may be set: for people, and as JSON for programs."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

from hapticd.cli import main
from tests.cli.shell import GOOD, hapticd


def test_config_show_fills_in_the_defaults() -> None:
    shown = tomllib.loads(hapticd("config", "show", GOOD).stdout)
    assert shown["safety"]["ramp_s"] == 0.05
    assert shown["device"]["options"]["mass_kg"] == 0.25
    assert shown["controller"]["params"]["pull_after"] == 4


def test_config_show_of_a_bad_file_prints_its_problems(bad: Path) -> None:
    done = hapticd("config", "show", bad)
    assert (done.returncode, done.stdout) == (2, "")
    assert [line.startswith(f"hapticd: {bad}: ") for line in done.stderr.splitlines()] == [True, True]


def test_config_schema_is_json() -> None:
    assert json.loads(hapticd("config", "schema").stdout)["title"] == "hapticd configuration"


def test_devices_lists_options_with_units_and_branches() -> None:
    (loopback,) = [plugin for plugin in json.loads(hapticd("devices", "--json").stdout) if plugin["name"] == "loopback"]
    parameters = {(parameter["key"], parameter["only_with"]): parameter for parameter in loopback["parameters"]}
    mass = parameters["mass_kg", ""]
    assert (mass["default"], mass["unit"], mass["required"]) == (0.25, "kg", False)
    assert parameters["changes[].at_s", ""]["required"]
    assert parameters["hand.force.newton", 'hand.force.profile = "step"']["unit"] == "N"


def test_controllers_lists_laws_for_people() -> None:
    shown = hapticd("controllers", COLUMNS="200").stdout
    assert "tdpa  Time-domain passivity control." in shown
    assert "damping_cap_n_s_per_m" in shown
    assert '"spring" | "total"' in shown
    only = hapticd("controllers", "energy-cycle", COLUMNS="40").stdout
    assert "tdpa" not in only
    assert "minimum" in "".join(only.split()), "a word that is longer than its column is broken and not cut off"
    assert "…" not in only


def test_a_parameter_without_a_description_is_told_by_what_it_may_be(tmp_path: Path) -> None:
    """Its meaning began with a semicolon."""
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab/damper.py").write_text(
        "from hapticd.law import Field, LawParams\n"
        "class Params(LawParams):\n    gain: float = Field(0.5, ge=0.0, le=1.0)\n"
        "class State:\n    pass\n"
        "def start(state, params, snapshot):\n    return State()\n"
        "def step(state, params, tick):\n    return 0.0\n"
    )
    done = hapticd("controllers", "lab.damper", PYTHONPATH=str(tmp_path), COLUMNS="120")
    assert done.returncode == 0, done.stderr
    (gain,) = [line.split() for line in done.stdout.splitlines() if "gain" in line]
    assert gain == ["gain", "0.5", "from", "0", "to", "1"]
    assert ";" not in done.stdout


@pytest.mark.parametrize(
    ("command", "kind", "typed", "meant"),
    [
        ("controllers", "law", "energy-cycl", "energy-cycle"),
        ("devices", "driver", "omega6", "omega7"),
    ],
)
def test_a_mistyped_plug_in_is_told_from_those_that_are_installed(
    command: str, kind: str, typed: str, meant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([command, typed])
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith(f'hapticd: no {kind} {typed!r}: did you mean "{meant}"? installed are ')


def test_a_plugin_that_cannot_be_imported_is_listed_with_the_reason(tmp_path: Path) -> None:
    information = tmp_path / "broken-1.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1\n")
    (information / "entry_points.txt").write_text("[hapticd.drivers]\nbroken = broken_driver:Broken\n")
    (tmp_path / "broken_driver.py").write_text("import no_such_library")
    done = hapticd("devices", "--json", PYTHONPATH=str(tmp_path))
    assert done.returncode == 0
    problems = {plugin["name"]: plugin["problem"] for plugin in json.loads(done.stdout)}
    assert problems["loopback"] == ""
    assert "No module named 'no_such_library'" in problems["broken"]
    assert "cannot be used" in hapticd("devices", PYTHONPATH=str(tmp_path)).stdout
    assert "driver.broken" not in json.loads(hapticd("config", "schema", PYTHONPATH=str(tmp_path)).stdout)["$defs"]
    alone = hapticd("devices", "broken", PYTHONPATH=str(tmp_path))
    assert (alone.returncode, alone.stdout) == (2, "")
