"""A configuration is TOML as people write it; whatever else a file holds, it is refused and never crashes."""

from __future__ import annotations

import hashlib
import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import tomlkit
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hapticd.config.effective import effective_toml
from hapticd.config.loading import load, parse
from hapticd.config.models import Config
from hapticd.errors import ConfigError
from hapticd.paths import default_config, directory
from hapticd.settings import Table

REFERENCE = (directory("config") / "hapticd.toml").read_text()


def test_an_empty_file_is_the_defaults() -> None:
    loaded = parse("", "empty.toml")
    assert loaded.config == Config()
    assert loaded.options == loaded.driver.Options()
    assert loaded.params == loaded.law.Params()


def test_whole_numbers_serve_as_floats_and_arrays_as_tuples() -> None:
    text = "[[scene.walls]]\nstiffness_n_per_m = 3000\nchanges = [{ at_s = 1, stiffness_n_per_m = 2 }]"
    (wall,) = parse(text, "lab.toml").config.scene.walls
    assert type(wall.stiffness_n_per_m) is float
    assert isinstance(wall.changes, tuple)


def test_the_hash_is_what_sha256sum_prints(tmp_path: Path) -> None:
    file = tmp_path / "lab.toml"
    file.write_bytes(b"\xef\xbb\xbf# BOM and CRLF, as an editor on Windows writes them\r\n[loop]\r\nrate_hz = 500\r\n")
    loaded = load(file)
    assert loaded.sha256 == hashlib.sha256(file.read_bytes()).hexdigest()
    assert loaded.sha256.startswith(loaded.hash)
    assert loaded.path == file
    assert loaded.config.loop.rate_hz == 500.0


def test_the_text_and_path_give_the_same_configuration_in_another_process() -> None:
    loaded = parse(REFERENCE, "lab.toml")
    again = parse(loaded.text, str(loaded.path))
    assert again == loaded


def test_a_whole_number_beyond_64_bits_is_refused_wherever_it_stands() -> None:
    """A law's parameter had no bound of its own: the daemon ran, and the reload that brought such a number ended it."""
    text = f"[device.options]\nchanges = [{{ at_s = {1 << 63} }}]\n[controller.params]\nseed = {-(1 << 63) - 1}\n"
    with pytest.raises(ConfigError) as refused:
        parse(text, "lab.toml")
    assert refused.value.problems == (
        "lab.toml: device.options.changes[0].at_s = 9223372036854775808: a whole number of TOML has 64 bits",
        "lab.toml: controller.params.seed = -9223372036854775809: a whole number of TOML has 64 bits",
    )


@pytest.mark.parametrize(
    ("folder", "file", "reason"),
    [("lab\udce9", "ring.field", "no UTF-8"), ("lab", "ring\\u0000.field", "is no path")],
)
def test_a_mesh_that_lies_where_no_other_process_can_be_sent_is_refused(folder: str, file: str, reason: str) -> None:
    """A reload tells the loop where it lies, and ended the daemon below a directory whose name is in Latin-1."""
    text = f'[[scene.objects]]\nname = "ring"\nshape = "mesh"\nstiffness_n_per_m = 9.0\nfile = "{file}"\n'
    with pytest.raises(ConfigError, match=rf"scene.objects\[0\].file = .*: .*{reason}"):
        parse(text, f"/{folder}/lab.toml")


def test_a_law_of_ones_own_is_named_by_its_module(monkeypatch: pytest.MonkeyPatch) -> None:
    own = ModuleType("mylab.laws")
    law = parse("", "x").law
    vars(own).update(Params=law.Params, State=law.State, start=law.start, step=law.step)
    monkeypatch.setitem(sys.modules, "mylab", ModuleType("mylab"))
    monkeypatch.setitem(sys.modules, "mylab.laws", own)
    assert parse("[controller]\nlaw = 'mylab.laws'\nparams = { pull_after = 3 }", "x").law is own


def test_a_plugin_that_declares_a_table_inside_an_array_gets_tuples() -> None:
    class Point(Table):
        at: tuple[float, float]

    class Track(Table):
        points: tuple[Point, ...]
        grid: tuple[tuple[int, ...], ...] = ()

    track = Track.model_validate({"points": [{"at": [1, 2]}], "grid": [[1], [2, 3]]})
    assert track.points[0].at == (1.0, 2.0)
    assert track.grid == ((1,), (2, 3))


def test_without_a_configuration_the_machines_own_is_used(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    own = tmp_path / "hapticd.toml"
    monkeypatch.setattr("hapticd.paths.SYSTEM_CONFIG", own)
    assert default_config() == directory("config") / "hapticd.toml"
    own.touch()
    assert default_config() == own


@pytest.mark.parametrize("file", sorted(directory("config").glob("*.toml")), ids=lambda file: file.stem)
def test_the_effective_configuration_is_the_same_configuration(file: Path) -> None:
    loaded = load(file).with_values({"remote.params": {"base_s": 0.002}})
    again = parse(effective_toml(loaded), str(file))
    plugins = {"device": None, "controller": None, "remote": None}
    assert again.config.model_copy(update=plugins) == loaded.config.model_copy(update=plugins)
    remote: dict[str, Any] = {"params": {}}
    assert again.config.remote.model_copy(update=remote) == loaded.config.remote.model_copy(update=remote)
    assert (again.options, again.params, again.port_params) == (loaded.options, loaded.params, loaded.port_params)
    assert (again.driver, again.law, again.port_law) == (loaded.driver, loaded.law, loaded.port_law)


def accepted_or_refused(name: str, read: Callable[[], object]) -> None:
    """Nothing but a ConfigError comes out, and each of its lines starts with the file."""
    problems: tuple[str, ...] | None = None
    try:
        read()
    except ConfigError as error:
        problems = error.problems
    assert problems != ()
    assert all(problem.startswith(f"{name}: ") and "\n" not in problem for problem in problems or ())


@given(st.text(max_size=200))
def test_any_text_is_accepted_or_refused(text: str) -> None:
    accepted_or_refused("any.toml", lambda: parse(text, "any.toml"))


@given(st.binary(max_size=200))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_bytes_are_accepted_or_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "any.toml"
    file.write_bytes(content)
    accepted_or_refused(str(file), lambda: load(file))


KEYS = st.sampled_from(sorted(set(re.findall(r"\w+", REFERENCE)))) | st.text(max_size=8)
SCALARS = (
    st.booleans()
    | st.integers()
    | st.floats()
    | st.datetimes()
    | st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
    | st.sampled_from(["loopback", "tdpa", "constant", "recorded", "z", "os.path", "a..b", "tcp://127.0.0.1:1"])
)
VALUES = st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=4))


@given(st.dictionaries(KEYS, VALUES, max_size=6))
def test_any_toml_is_accepted_or_refused(tables: dict[str, object]) -> None:
    accepted_or_refused("any.toml", lambda: parse(tomlkit.dumps(tables), "any.toml"))


@given(st.data())
def test_a_file_with_one_wrong_value_is_accepted_or_refused(data: st.DataObject) -> None:
    lines = REFERENCE.splitlines()
    settable = [number for number, line in enumerate(lines) if " = " in line and not line.startswith("#")]
    number = data.draw(st.sampled_from(settable))
    key = lines[number].partition(" = ")[0]
    lines[number] = f"{key} = {tomlkit.item(data.draw(VALUES)).as_string()}"
    accepted_or_refused("any.toml", lambda: parse("\n".join(lines), "any.toml"))
