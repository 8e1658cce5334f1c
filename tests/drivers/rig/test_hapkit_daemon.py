"""The whole daemon, `hapticd run`, on the Hapkit's firmware in a simulated processor: a millisecond of it is a tick."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.drivers.resting import DisturbedError, Rest, calmest
from tests.drivers.rig.serial_lab import ATTEMPTS, HELD_M, PRESS_N, STIFFNESS_N_PER_M, WALL_M, Lab
from tests.drivers.rig.test_board_walls import STILL_M as STILL_BY_KIND_M
from tests.firmware.board import Board, Built

TICKS = 1500
STILL_M = STILL_BY_KIND_M["hapkit"]


@pytest.mark.parametrize(("law", "still"), [("", True), ("none", False)])
def test_a_daemon_holds_a_wall_with_the_default_law_that_shakes_without_one(
    hapkit_parts: Built, tmp_path: Path, law: str, still: bool
) -> None:
    """It finds the rig, checks its sign, homes and arms it, as a student does."""
    rest = pressed(hapkit_parts, tmp_path, law, still)
    if still:
        assert rest.swing_m < STILL_M
        assert rest.mean_m == pytest.approx(WALL_M - PRESS_N / STIFFNESS_N_PER_M, abs=1e-4)
    else:
        assert rest.swing_m > 1e-3


def pressed(parts: Built, place: Path, law: str, still: bool) -> Rest:
    """The calmest half second of a handle that a hand presses into the wall; anew where the loop was disturbed.

    Args:
        parts: of the board.
        place: a directory for it.
        law: its name; empty for the default.
        still: whether it is to rest, so that a handle that does not though the link was disturbed says nothing.
    """
    said = []
    for _ in range(ATTEMPTS):
        with Board(parts, place / "board", pace="frames") as board:
            board.place(HELD_M)
            with Lab(board, law=law) as lab:
                try:
                    rest = calmest(lab.press().daemon.endpoint, TICKS, STILL_M)
                except DisturbedError as disturbed:
                    said.append(str(disturbed))
                    continue
                if still and rest.disturbed:
                    said.append(str(rest))
                    continue
                lab.daemon.process.terminate()
                assert lab.daemon.wait_exit() == 0
                assert board.state().motor_n == 0.0
                return rest
    raise AssertionError(said)
