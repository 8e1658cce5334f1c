"""Each shipped configuration does what its own comment promises; the model is deterministic, so one run decides."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from pydantic import BaseModel

from hapticd.config.loading import load
from hapticd.config.models import Config
from hapticd.config.problems import tables_of
from hapticd.paths import directory
from hapticd.tick.assemble import make_tick, place_device

SHIPPED = sorted(directory("config").glob("*.toml"))
REAL_DEVICES = {name: name for name in ("hid-rig", "inverse3", "moteus", "odrive", "omega7", "serial-rig")}
REAL_DEVICES |= {"hapkit": "serial-rig", "falcon": "omega7"}
RESTS = ["fig6-set1", "fig6-set2-wall", "fig6-set2-device", "native-8-none", "every-term"] + [
    f"wall-{k}-{law}" for k in (12, 18, 20) for law in ("energy-cycle", "tdpa")
]
IN_SPACE = {"ball", "cup", "table-edge", "peg-in-hole", "mesh"}  # tests/offline/test_space.py holds them to their word
DRIVEN = {"remote-tool"}  # tests/tick/remote/test_shipped.py drives it
OSCILLATES = [f"wall-{k}-{law}" for k in (12, 18, 20) for law in ("none", "tdpa-unbounded")]


def depths_m(name: str, seconds: float) -> tuple[list[float], float]:
    """Depth in the wall over the last half second of a run, and the depth that the stiffness calls for."""
    loaded = load(directory("config") / f"{name}.toml")
    period_s = loaded.config.loop.period_s
    driver = loaded.driver(loaded.options, period_s)
    place_device(loaded, driver)
    info = driver.open()
    tick = make_tick(loaded, info)
    tick.start(driver.read())
    tick.arm()
    driver.enable()
    depths = []
    for _ in range(round(seconds / period_s)):
        driver.write(tick.step(driver.read(), period_s))
        depths.append(-tick.motion.position_m[0])
    driver.close()
    options = tomllib.loads(loaded.text)["device"]["options"]
    called_for = -options["hand"]["force"]["newton"] / loaded.config.scene.walls[0].stiffness_n_per_m
    return depths[-round(0.5 / period_s) :], called_for


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_every_shipped_configuration_loads(file: Path) -> None:
    assert load(file).config.device.driver == REAL_DEVICES.get(file.stem, "loopback")


@pytest.mark.parametrize("name", RESTS)
def test_a_configuration_that_promises_rest_rests_at_the_right_depth(name: str) -> None:
    depths, called_for = depths_m(name, 6.0)
    assert max(depths) - min(depths) < (2e-4 if name.startswith("native") else 5e-5)
    assert sum(depths) / len(depths) == pytest.approx(called_for, rel=0.1, abs=3e-5)


@pytest.mark.parametrize("name", OSCILLATES)
def test_a_configuration_that_promises_oscillation_oscillates(name: str) -> None:
    depths, _ = depths_m(name, 6.0)
    assert max(depths) - min(depths) > 5e-4


def test_every_shipped_configuration_promises_something() -> None:
    assert {file.stem for file in SHIPPED} == {*RESTS, *OSCILLATES, *REAL_DEVICES, *IN_SPACE, *DRIVEN, "hapticd"}


def test_the_reference_names_every_key_of_the_daemon() -> None:
    text = (directory("config") / "hapticd.toml").read_text()

    def keys(model: type[BaseModel]) -> set[str]:
        inner = {
            key for field in model.model_fields.values() for table in tables_of(field.annotation) for key in keys(table)
        }
        return set(model.model_fields) | inner

    missing = {key for key in keys(Config) if not re.search(rf"\b{key}\b", text)}
    assert not missing


def test_the_reference_sets_its_law_to_what_it_is_without_being_set() -> None:
    loaded = load(directory("config") / "hapticd.toml")
    assert loaded.params == loaded.law.Params()


def test_what_the_reference_comments_out_is_valid_too() -> None:
    """Every `# key = value` line can be uncommented."""
    text = (directory("config") / "hapticd.toml").read_text()
    uncommented = re.sub(r"^# (\w+ = )", r"\1", text, flags=re.MULTILINE)
    assert uncommented != text
    tables = tomllib.loads(uncommented)
    tables["device"].pop("options")
    assert Config.model_validate(tables).safety.supervisor_stall_s == 10.0
