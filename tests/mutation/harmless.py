"""Slips that change nothing, and why: what `harmless.toml` says."""

from __future__ import annotations

import tomllib
from pathlib import Path

EQUAL: dict[str, list[str]] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text())
"""By the reason, each as `str` of a `Slip` says it."""

HARMLESS = frozenset(slip for slips in EQUAL.values() for slip in slips)
