"""The contract of every driver, on the Hapkit's firmware: machine code on a simulated processor, an analog sensor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from hapticd.testing.driver_contract import AnyDriver, DriverContract
from hapticd_drivers.rig import conversation
from hapticd_drivers.rig.frames import framed
from hapticd_drivers.rig.link import Link
from hapticd_drivers.rig.serial_rig import SerialRig, SerialRigOptions
from tests.drivers.rig.device import PATIENCE_S
from tests.firmware.board import Board, Built

ON_THE_LINE_US = 1000.0
"""What a command takes to the motor, and more."""


class Counted(SerialRig):
    """Knows how many bytes it has sent, so that the board can be asked about the last of them."""

    sent = 0

    def _connect(self) -> Link:
        link = super()._connect()
        send = link.send

        def counted(message: bytes) -> None:
            self.sent += len(framed(message))
            send(message)

        link.send = counted  # type: ignore[method-assign]  # the one link of this test
        return link


class TestHapkit(DriverContract):
    @pytest.fixture
    def driver(self, hapkit_parts: Built, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[AnyDriver]:
        monkeypatch.setattr(conversation, "PATIENCE_S", PATIENCE_S)
        monkeypatch.setattr(conversation, "URGENT_PATIENCE_S", PATIENCE_S)
        with Board(hapkit_parts, tmp_path / "port", pace="patient") as board:
            self.board = board
            options = SerialRigOptions(port=str(board.port), sign_checked=True)
            with Counted(options, 0.001) as before:
                assert before._talk is not None
                before._talk.set_home(0, 0)  # what a calibration has told it
            made = Counted(options, 0.001)
            made.sent = before.sent
            yield made

    def force_on_device(self, driver: AnyDriver) -> Sequence[float]:
        assert isinstance(driver, Counted)
        self.board.run(ON_THE_LINE_US, driver.sent)
        return [self.board.state().motor_n]
