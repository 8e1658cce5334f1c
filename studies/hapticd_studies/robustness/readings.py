"""Which laws, and which readings of each, stand in the table."""

from __future__ import annotations

import typing
from collections.abc import Iterator
from typing import Any, Literal

from hapticd import plugins
from hapticd.errors import PluginError
from hapticd.law import LawParams
from hapticd.simulation.compiler.compile import compiled_step
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.paper.scenarios import TDPA_AS_PUBLISHED
from hapticd_studies.robustness.devices import Device

PAPER = "energy-cycle"

_BARE = {"cap": "none", "force_delay": "none", "small_leaks": 0.0}
# What one change from the default does not show.
_COMBINED: dict[str, tuple[dict[str, Any], ...]] = {
    "tdpa": (TDPA_AS_PUBLISHED, {**TDPA_AS_PUBLISHED, "observer": "printed"}, {"reference": "stored"}),
    PAPER: (
        {"window": 1},
        {"small_leaks": 0.0},
        _BARE,
        {**_BARE, "sum": "start", "rule": "signed"},
        {**_BARE, "sum": "start", "rule": "non-negative"},
        {**_BARE, "plateaus": "literal", "contact_loss": "ignored"},
    ),
}


SHORT = {
    "as published": "damping_cap_n_s_per_m=0, min_speed_m_per_s=0, reset=never",
    "bare": "cap=none, force_delay=none, small_leaks=0",
}
"""Names for parameters that often stand together."""


def short(label: str) -> tuple[str, str]:
    """The law of a label, and its parameters as few words as possible."""
    name, *values = label.split(":")
    text = ", ".join(values)
    for word, meaning in SHORT.items():
        text = text.replace(meaning, word)
    return name, text


def every_reading() -> list[LawSpec]:
    """Every installed law with its defaults, and the readings of those that leave a choice: the paper's law comes last.

    Of the paper's law: each choice that is not the default, alone, and some combinations that are known.
    """
    names = sorted(plugins.names(plugins.CONTROLLERS), key=lambda name: (name == PAPER, name != "none", name))
    found = []
    for name in names:
        try:
            compiled_step(plugins.law(name))
        except PluginError:
            if name in (PAPER, "none"):
                raise
            continue  # somebody else's law, and it is not asked for by name
        found += [_reading(name, values) for values in ({}, *_choices(name))]
    return found


def params_on(reading: LawSpec, device: Device) -> LawParams:
    """The parameters on a device: a law that wants to know mass or damping is told what the maker could know."""
    values = dict(reading.values)
    if values.get("cap") == "known-mass":
        values.setdefault("mass_kg", device.options.mass_kg)
    if "device_damping_n_s_per_m" in reading.law.Params.model_fields:
        values.setdefault("device_damping_n_s_per_m", device.options.viscous_n_s_per_m)
    params: LawParams = reading.law.Params.model_validate(values)
    return params


def _reading(name: str, values: dict[str, Any]) -> LawSpec:
    given = (f"{key}={_shown(value)}" for key, value in values.items())
    return LawSpec(":".join([name, *given]), name, values)


def _choices(name: str) -> list[dict[str, Any]]:
    found = list(_alone(plugins.law(name).Params)) if name == PAPER else []
    return found + [values for values in _COMBINED.get(name, ()) if values not in found]


def _alone(model: type[LawParams]) -> Iterator[dict[str, Any]]:
    for key, info in model.model_fields.items():
        options: tuple[Any, ...] = ()
        if typing.get_origin(info.annotation) is Literal:
            options = typing.get_args(info.annotation)
        elif info.annotation is bool:
            options = (True, False)
        for option in options:
            if option != info.default:
                yield {key: option}


def _shown(value: object) -> str:
    """A value as `--laws` takes it."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)
