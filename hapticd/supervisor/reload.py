"""A configuration that is to take over from the running one: what it may change, and the letter that tells the loop."""

from __future__ import annotations

from typing import Any

from hapticd.config.loading import LoadedConfig, load
from hapticd.contracts.errors import HapticdError


def wanted_config(now: LoadedConfig) -> LoadedConfig:
    """Read the file of a configuration again.

    Raises:
        HapticdError: it cannot be used, or changes what only a restart can change.
    """
    wanted = load(now.path)
    old, new = now.config, wanted.config
    fixed = [name for name in ("loop", "device", "velocity") if getattr(old, name) != getattr(new, name)]
    endpoints = [(table.ipc, table.tcp, table.send_high_water) for table in (old.telemetry, new.telemetry)]
    if endpoints[0] != endpoints[1]:
        fixed.append("telemetry endpoints")
    if fixed:
        raise HapticdError(f"{wanted.path}: [{'], ['.join(fixed)}] changed: that needs a restart")
    return wanted


def switch_letter(now: LoadedConfig, wanted: LoadedConfig) -> dict[str, Any]:
    """The request to the loop."""
    settings = wanted.config
    return {
        "do": "switch",
        "law": settings.controller.law,
        "params": wanted.params.model_dump(),
        "scene": settings.scene.model_dump(),
        "safety": settings.safety.model_dump(),
        "keep_law": settings.controller == now.config.controller,
        "was": now.config.controller.law,
        "config": wanted.hash,
    }
