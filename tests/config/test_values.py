"""One value of a configuration changed from Python is checked as a file is, and the error names the key."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hapticd.config.loading import load, parse
from hapticd.errors import ConfigError

TEXT = """
[device.options]
mass_kg = 0.3
[device.options.hand]
force = { profile = "constant", newton = -3.0 }
[[scene.walls]]
stiffness_n_per_m = 12000.0
[controller]
law = "energy-cycle"
[controller.params]
window = 3
"""
LAB = parse(TEXT, "lab.toml")


def test_the_new_value_counts_and_the_others_stay() -> None:
    stiffer = LAB.with_values({"scene.walls[0].stiffness_n_per_m": 15e3, "controller.params.window": 4})
    assert stiffer.config.scene.walls[0].stiffness_n_per_m == 15e3
    assert stiffer.params.model_dump()["window"] == 4
    assert stiffer.options == LAB.options
    assert LAB.config.scene.walls[0].stiffness_n_per_m == 12e3
    assert parse(stiffer.text, "lab.toml") == stiffer


def test_tables_that_the_text_does_not_have_are_made() -> None:
    found = LAB.with_values({"velocity.samples": 3, "device.options.hand.mass_kg": 0.2})
    assert found.config.velocity.samples == 3
    assert found.options.model_dump()["hand"]["mass_kg"] == 0.2


def test_parameters_leave_with_their_law_and_come_after_it_in_any_order() -> None:
    other = LAB.with_values({"controller.law": "tdpa"})
    assert other.params == other.law.Params()
    with pytest.raises(ConfigError, match=r"controller\.params\.window"):
        LAB.with_values({"controller.params.window": 2, "controller.law": "tdpa"})
    assert LAB.with_values({"controller.law": "energy-cycle"}).params == LAB.params
    given = {"controller.params.damping_cap_n_s_per_m": 7.0, "controller.law": "tdpa"}
    assert LAB.with_values(given).params.model_dump()["damping_cap_n_s_per_m"] == 7.0


def test_parameters_of_couplings_and_forces_leave_with_their_law_too() -> None:
    lab = LAB.with_values({"remote.params.base_s": 0.002})
    other = lab.with_values({"remote.law": "tdpa"})
    assert other.port_params == other.port_law.Params()
    assert lab.with_values({"remote.law": "late-cycle"}).port_params == lab.port_params


def test_options_leave_with_their_driver() -> None:
    other = LAB.with_values({"device.driver": "serial-rig"})
    assert type(other.options) is other.driver.Options
    assert "mass_kg" not in other.options.model_dump()


def test_numbers_and_vectors_of_numpy_are_numbers_and_vectors() -> None:
    ball = {"name": "ball", "shape": "sphere", "radius_m": 0.03, "stiffness_n_per_m": 800.0}
    values = {
        "scene.walls[0].stiffness_n_per_m": np.float32(8000.0),
        "scene.objects": [ball],
        "controller.params.window": np.int64(2),
    }
    found = LAB.with_values(values).with_values({"scene.objects[0].position_m": np.array([0.0, 0.01, -0.02])})
    assert found.config.scene.walls[0].stiffness_n_per_m == 8000.0
    assert found.config.scene.objects[0].position_m == (0.0, 0.01, -0.02)
    assert found.params.model_dump()["window"] == 2


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("scene.walls[0].stiffness_n_per_m", -5.0, r"lab\.toml: scene\.walls\[0\]\.stiffness_n_per_m = -5"),
        ("scene.walls[3].stiffness_n_per_m", 5.0, r"scene\.walls\[3\]\.stiffness_n_per_m: the configuration has no"),
        ("scene.walls.stiffness_n_per_m", 5.0, r"scene\.walls\.stiffness_n_per_m: the configuration has no such place"),
        ("scene.wals", [], r'scene\.wals.*did you mean "walls"'),
        ("controller.law", "tdap", r'controller\.law = "tdap".*did you mean "tdpa"'),
        ("controller.params.windo", 2, r"controller\.params\.windo"),
        ("device.options.mass_kg", None, r"device\.options\.mass_kg = None: must be a value that TOML can hold"),
        ("device.options.mass_kg", object(), r"device\.options\.mass_kg = <object"),
        ("a b", 1, r'"a b": must be a key such as'),
        ("", 1, "must be a key such as"),
    ],
)
def test_what_cannot_be_is_refused_by_its_key(key: str, value: Any, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        LAB.with_values({key: value})


def test_a_string_of_several_lines_is_the_text_and_any_other_a_file(tmp_path: Path) -> None:
    file = tmp_path / "lab.toml"
    file.write_text(TEXT)
    assert load(TEXT).config == load(file).config == load(str(file)).config
    with pytest.raises(ConfigError, match="no such file"):
        load("[controller]")


def test_a_configuration_shows_itself_in_a_line() -> None:
    assert repr(LAB) == "<configuration lab.toml: loopback with energy-cycle at 1000 Hz>"
