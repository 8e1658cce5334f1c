"""The JSON Schema says what the loader does, as far as JSON Schema can."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from hapticd import plugins
from hapticd.config.schema import json_schema
from hapticd.paths import directory


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    return json_schema()


def errors(schema: dict[str, Any], text: str) -> list[str]:
    validator = jsonschema.Draft202012Validator(schema)
    return [error.message for error in validator.iter_errors(tomllib.loads(text))]


def test_the_schema_is_valid_and_complete_by_itself(schema: dict[str, Any]) -> None:
    jsonschema.Draft202012Validator.check_schema(schema)

    def references(part: Any) -> set[str]:
        if isinstance(part, dict):
            here = {part["$ref"]} if isinstance(part.get("$ref"), str) else set()
            return here.union(*map(references, part.values()))
        return set().union(*map(references, part)) if isinstance(part, list) else set()

    assert references(schema) <= {f"#/$defs/{name}" for name in schema["$defs"]}


@pytest.mark.parametrize("file", sorted(directory("config").glob("*.toml")), ids=lambda file: file.stem)
def test_shipped_configurations_satisfy_it(schema: dict[str, Any], file: Path) -> None:
    assert not errors(schema, file.read_text())


def test_it_covers_every_installed_plugin_with_descriptions_and_units(schema: dict[str, Any]) -> None:
    definitions = schema["$defs"]
    for name in plugins.names(plugins.DRIVERS):
        assert f"driver.{name}" in definitions
    for name in plugins.names(plugins.CONTROLLERS):
        assert f"law.{name}" in definitions
    rate = definitions["LoopConfig"]["properties"]["rate_hz"]
    assert (rate["description"], rate["minimum"]) == ("ticks a second [Hz]", 100.0)


def test_options_follow_the_driver_and_parameters_the_law(schema: dict[str, Any]) -> None:
    assert errors(schema, "[device.options]\nmas_kg = 1")  # loopback is the default
    assert errors(schema, "[device]\ndriver = 'loopback'\noptions = { mas_kg = 1 }")
    assert not errors(schema, "[device]\ndriver = 'a-driver-of-ones-own'\noptions = { anything = 1 }")
    assert errors(schema, "[controller.params]\ndamping_cap_n_s_per_m = 1")  # energy-cycle is the default
    assert not errors(schema, "[controller]\nlaw = 'tdpa'\nparams = { damping_cap_n_s_per_m = 1 }")
    assert errors(schema, "[controller]\nlaw = 'tdpa'\nparams = { window = 2 }")
    assert errors(schema, "[loop]\nrate_hz = 50")
