"""A daemon on the real firmware in a simulated processor, with a hand at its handle.

A millisecond of the rig is a frame of the daemon's.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from hapticd.tick.event import EventCode
from tests.daemon.running import PATIENCE_S, Daemon, Subscriber, wait_until
from tests.firmware.board import Board, Built

WALL_M = -0.01
STIFFNESS_N_PER_M = 2000.0
PRESS_N = 2.0
HELD_M = 0.02
STOP_M = {"uno": -0.049, "hapkit": -0.034}
"""A handle that is further down is at the lower stop [m]."""

ATTEMPTS = 5
"""A busy computer may miss enough deadlines for the loop to let go, or starve the simulated processor until
it looks lost: that tells nothing of the driver."""


def config(board: Board, homing: str, law: str = "") -> str:
    """The file of a lab; no law is the default one."""
    return f"""
        [loop]
        law_budget = 1.0
        [device]
        driver = "serial-rig"
        [device.options]
        port = "{board.port}"
        trace = 200
        calibration_speed_m_per_s = 0.2
        [[device.options.axes]]
        homing = "{homing}"
        [[scene.walls]]
        position_m = {WALL_M}
        stiffness_n_per_m = {STIFFNESS_N_PER_M}
        {f'[controller]{chr(10)}law = "{law}"' if law else ""}
    """


class Lab:
    """A daemon on a board.

    Args:
        board: the rig; a hand holds its handle at `HELD_M`.
        homing: how it is calibrated; for "here", positions count from there.
        law: of the wall; "" leaves the default.
    """

    def __init__(self, board: Board, homing: str = "here", law: str = "") -> None:
        self.board = board
        self.zero_m = HELD_M if homing == "here" else 0.0
        self.daemon = Daemon(config(board, homing, law))
        self.ask = self.daemon.ask

    def __enter__(self) -> Lab:
        self.daemon.wait_ready()
        return self

    def __exit__(self, *exception: object) -> None:
        self.daemon.__exit__(*exception)

    def press(self) -> Lab:
        """Calibrate, arm, and let a hand press the handle into the wall; anew where this computer was too busy."""
        said = []
        end_s = time.monotonic() + 4.0 * PATIENCE_S
        while time.monotonic() < end_s:
            self.board.hand(0.0)
            self._hold()
            if self.zero_m == 0.0:
                self.board.grip(0.0, 0.0, 0.0)  # it drives the handle
            said.append(self.ask("calibrate"))
            if not said[-1]:
                self._hold()
                said.append(self.ask("arm"))
                if "hapticd clear" in said[-1]:
                    self.ask("clear")
                    said.append(self.ask("arm"))
                if not said[-1]:
                    self.board.grip(0.0, 2.0, 0.0)
                    self.board.hand(-PRESS_N)
                    if self._pushes():
                        return self
            time.sleep(1.0)
        raise AssertionError(f"the wall never pushed: {said}, {self.daemon.output()}")

    def _hold(self) -> None:
        self.board.grip(100.0, 5.0, HELD_M)
        wait_until(lambda: abs(self.board.state().position_m - HELD_M) < 0.002, "the hand to hold the handle")

    def _pushes(self) -> bool:
        """Whether the wall pushes back before the hand has reached the stop."""
        while True:
            state = self.board.state()
            if state.motor_n > 0.5 * PRESS_N:
                return True
            if state.position_m < STOP_M[self.board.kind]:
                return False
            time.sleep(0.01)

    def held(self) -> bool:
        """Whether the handle comes to rest, for half a second, where hand and wall are in balance."""
        depth_m = PRESS_N / STIFFNESS_N_PER_M
        end_s = time.monotonic() + 10.0
        still = 0
        with Subscriber(self.daemon.endpoint, "hapticd/position") as subscriber:  # it hears of now and not of before
            for _, fields in subscriber.maps():
                off_m = abs(fields["position_m"][0] - (WALL_M - depth_m))
                still = still + 1 if off_m < 0.1 * depth_m else 0
                if still == 500 or time.monotonic() > end_s:
                    break
        return still == 500


def until(subscriber: Subscriber, *texts: str) -> None:
    """Return when an event has come with one of these texts, by which the loop ended for want of its device."""
    ended = (EventCode.DEVICE_LOST, EventCode.DEVICE_FAULT)
    end_s = time.monotonic() + 2.0 * PATIENCE_S
    for topic, fields in subscriber.maps():
        if topic == "hapticd/event" and fields["code"] in ended and any(text in fields["text"] for text in texts):
            return
        assert time.monotonic() < end_s, f"none of {texts} came"


def on_a_board(place_m: float, homing: str = "here") -> Callable[[Callable[[Lab], None]], Callable[..., None]]:
    """A test of a lab of its own; anew where the supervisor ended a loop that this computer did not let run.

    Args:
        place_m: where the handle stands at first.
        homing: how the rig is calibrated.
    """

    def decorate(test: Callable[[Lab], None]) -> Callable[..., None]:
        def run(board_parts: Built, tmp_path: Path) -> None:
            for attempt in range(1, ATTEMPTS + 1):
                with Board(board_parts, tmp_path / "board", pace="frames") as board:
                    board.place(place_m)
                    with Lab(board, homing) as lab:
                        try:
                            test(lab)
                        except AssertionError:
                            if attempt == ATTEMPTS or "stood still" not in lab.daemon.output():
                                raise
                        else:
                            return

        run.__doc__ = test.__doc__
        return run

    return decorate
