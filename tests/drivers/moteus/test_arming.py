"""Arming moteus controllers that take a moment to follow."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import ClassVar

import pytest

from hapticd_drivers.moteus import crew as moteus_crew
from hapticd_drivers.motors import crew
from tests.drivers.moteus.lab import Lab
from tests.drivers.motors.arming_contract import MotorArmingContract
from tests.drivers.motors.bench import PATIENCE_S


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    monkeypatch.setattr(crew, "URGENT_PATIENCE_S", PATIENCE_S)
    with Lab("fdcanusb", tmp_path, 2, monkeypatch) as made:
        yield made


class TestMoteus(MotorArmingContract):
    FAMILY = "moteus"
    CREW: ClassVar[ModuleType] = moteus_crew
    PATIENCE = "PREPARING_S"
