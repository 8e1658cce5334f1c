"""The configuration of a law that is tried: one wall, and a hand that presses it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import tomlkit

from hapticd.config.loading import LoadedConfig, parse


def pressed(
    law: str,
    params: Mapping[str, Any] | None = None,
    *,
    stiffness_n_per_m: float = 12e3,
    hand_n: float = -3.0,
    start_m: float = 0.0,
    rate_hz: float = 1000.0,
    device: Mapping[str, Any] | None = None,
) -> LoadedConfig:
    """A law on the simulated device; arguments as those of `hapticd.testing.press`.

    Raises:
        ConfigError: a law, a parameter or a value that a configuration could not have.
    """
    hand = {"force": {"profile": "constant", "newton": hand_n}}
    tables = {
        "loop": {"rate_hz": rate_hz},
        "device": {"options": {"initial_position_m": start_m, "hand": hand, **(device or {})}},
        "scene": {"walls": [{"stiffness_n_per_m": stiffness_n_per_m}]},
        "controller": {"law": law, "params": dict(params or {})},
    }
    return parse(tomlkit.dumps(tables), "press")
