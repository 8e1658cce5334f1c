"""The configurations that are shipped: those that a computer alone can run, by what they say themselves."""

from __future__ import annotations

from hapticd.config.loading import load
from hapticd.paths import directory

CONFIG = directory("config")
SIMULATED = sorted(file for file in CONFIG.glob("*.toml") if load(file).config.device.driver == "loopback")
