"""Arming ODrives that take a moment to follow."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import ClassVar

import pytest

from hapticd_drivers.motors import crew
from hapticd_drivers.odrive import crew as odrive_crew
from tests.drivers.motors.arming_contract import MotorArmingContract
from tests.drivers.motors.bench import PATIENCE_S
from tests.drivers.odrive.lab import Lab


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    monkeypatch.setattr(crew, "URGENT_PATIENCE_S", PATIENCE_S)
    monkeypatch.setattr(odrive_crew, "LOOKED_S", PATIENCE_S)
    monkeypatch.setattr(odrive_crew, "HEARTBEAT_S", PATIENCE_S)
    with Lab("slcan", tmp_path, 2, monkeypatch) as made:
        yield made


class TestOdrive(MotorArmingContract):
    FAMILY = "odrive"
    CREW: ClassVar[ModuleType] = odrive_crew
    PATIENCE = "OBEYS_S"
