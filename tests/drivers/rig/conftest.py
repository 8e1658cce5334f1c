"""The protocol core and the AVR firmware, each built once a session; each test has a rig of its own."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from hapticd_drivers.rig import conversation, mover
from hapticd_drivers.rig.serial_rig import SerialRig, SerialRigOptions
from tests.drivers.rig.device import PATIENCE_S, Rig, build
from tests.drivers.rig.ticking import PERIOD_S, MakeDriver, tick
from tests.firmware.board import Built
from tests.firmware.board import build as build_board


@pytest.fixture(scope="session")
def rig_core(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return build(tmp_path_factory.mktemp("core"))


@pytest.fixture
def rig(rig_core: ctypes.CDLL, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Rig]:
    """A rig in this process; nothing is urgent here, since a busy computer must not look like a silent rig."""
    monkeypatch.setattr(conversation, "PATIENCE_S", PATIENCE_S)
    monkeypatch.setattr(conversation, "URGENT_PATIENCE_S", PATIENCE_S)
    monkeypatch.setattr(mover, "ANSWER_S", PATIENCE_S)
    with Rig(rig_core, tmp_path / "port") as made:
        yield made


@pytest.fixture(scope="session")
def board_parts(tmp_path_factory: pytest.TempPathFactory) -> Built:
    return build_board(tmp_path_factory.mktemp("board"))


@pytest.fixture(scope="session")
def hapkit_parts(tmp_path_factory: pytest.TempPathFactory) -> Built:
    return build_board(tmp_path_factory.mktemp("hapkit"), "hapkit")


@pytest.fixture
def make_driver(rig: Rig) -> Iterator[MakeDriver]:
    """Drivers that are closed in the end."""
    with ExitStack() as closing:

        def make(**options: object) -> SerialRig:
            made = SerialRig(SerialRigOptions.model_validate({"port": str(rig.port), **options}), PERIOD_S)
            closing.callback(made.close)
            return made

        yield make


@pytest.fixture
def driver(rig: Rig, make_driver: MakeDriver) -> SerialRig:
    """A driver whose rig knows its home already, and whose sign was checked."""
    rig.set_home()
    return make_driver(sign_checked=True)


@pytest.fixture
def pushing(rig: Rig, driver: SerialRig) -> SerialRig:
    """The same, pushing the handle with 1 N."""
    driver.open()
    driver.enable()
    tick(rig, driver, 1.0)
    assert rig.force_n == 1.0
    return driver
