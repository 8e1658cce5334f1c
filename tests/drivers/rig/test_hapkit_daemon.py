"""The whole daemon on a Hapkit's firmware; how it holds a wall is in test_hapkit_walls.py, in the rig's own time."""

from __future__ import annotations

import os
import signal

import pytest

from tests.daemon.running import Subscriber
from tests.drivers.rig.serial_lab import HELD_M, Lab, on_a_board
from tests.firmware.board import Built

pytestmark = pytest.mark.timeout(300)


@pytest.fixture
def board_parts(hapkit_parts: Built) -> Built:
    return hapkit_parts


@on_a_board(HELD_M)
def test_a_hapkit_is_calibrated_pushes_a_wall_and_is_without_force_when_the_loop_is_killed(lab: Lab) -> None:
    with Subscriber(lab.daemon.endpoint, "hapticd/status") as subscriber:
        status = subscriber.until("hapticd/status")
        assert (status["device"], status["serial"], status["armed"]) == ("hapkit", "0001", False)
        lab.press()
        assert subscriber.until("hapticd/status", calibrated=True)["device_metrics"]["round_trip_us"] > 0.0
    os.kill(lab.daemon.control_pid(), signal.SIGKILL)
    assert lab.daemon.wait_exit() == 1
    assert lab.board.state().motor_n == 0.0
    assert "the device is without force" in lab.daemon.output()
