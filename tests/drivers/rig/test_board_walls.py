"""Walls on the firmware of both boards in the daemon's own loop: a tick is a millisecond of the board."""

from __future__ import annotations

from pathlib import Path

import pytest

from hapticd.config.loading import parse
from hapticd.config.walls import MAX_WALLS
from hapticd.loop.loop import ControlLoop
from hapticd.loop.memory import EventReader, RecordReader, SharedMemory
from hapticd.tick.assemble import make_tick
from hapticd.tick.event import EventCode
from hapticd.tick.record import RecordLayout
from hapticd_drivers.rig import conversation
from hapticd_drivers.rig.serial_rig import SerialRig
from tests.drivers.device_time import DeviceTime
from tests.drivers.rig.device import PATIENCE_S
from tests.drivers.rig.serial_lab import HELD_M, PRESS_N, WALL_M
from tests.firmware.board import Board, Built

TICKS = 2000
SETTLED = 500
STIFFNESS_N_PER_M = 2000.0
STILL_M = {"hapkit": 4.5 * 14.51e-6, "uno": 4.5 * 7.67e-6}
"""Four counts: ring-damping leaves as many of a coarse sensor that is late [m]."""


def places_m(board: Board, law: str, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Where the handle is at the end, after a hand has pressed it into a wall [m]."""
    text = f"""
        [device]
        driver = "serial-rig"
        [device.options]
        port = "{board.port}"
        sign_checked = true
        answer_after_us = 0
        [[scene.walls]]
        position_m = {WALL_M - HELD_M}
        stiffness_n_per_m = {STIFFNESS_N_PER_M}
        {f'[controller]{chr(10)}law = "{law}"' if law else ""}
        [safety]
        auto_arm = true
    """
    loaded = parse(text, "test")
    loop = loaded.config.loop
    driver = loaded.driver(loaded.options, loop.period_s)
    assert isinstance(driver, SerialRig)
    driver._state_wait_s = PATIENCE_S  # a busy computer is no late rig
    with driver:
        assert driver._talk is not None
        driver._talk.set_home(0, driver._talk.state().position[0])  # as a calibration does
    info = driver.open()
    board.grip(0.0, 2.0, 0.0)
    board.hand(-PRESS_N)
    clock = DeviceTime(TICKS)
    monkeypatch.setattr("hapticd.loop.loop.time", clock)
    shared = SharedMemory(RecordLayout(1, info.has_orientation, MAX_WALLS), loop.rate_hz)
    tick = make_tick(loaded, info)
    clock.loop = ControlLoop(driver, tick, shared, loop, loaded.config.safety, True, clock.sleep_until)
    clock.loop.run()
    told = [(event.code, event.text) for event in EventReader(shared).read()]
    records = RecordReader(shared).read(TICKS)
    shared.close()
    assert [code for code, _ in told] == [EventCode.STARTED, EventCode.ARMED], told
    return [record.position_m[0] for record in records[-SETTLED:]]


@pytest.mark.parametrize("parts", ["hapkit_parts", "board_parts"])
@pytest.mark.parametrize(("law", "still"), [("", True), ("none", False)])
def test_the_default_law_holds_a_wall_that_shakes_without_one(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, parts: str, law: str, still: bool
) -> None:
    monkeypatch.setattr(conversation, "PATIENCE_S", PATIENCE_S)
    monkeypatch.setattr(conversation, "URGENT_PATIENCE_S", PATIENCE_S)
    built: Built = request.getfixturevalue(parts)
    with Board(built, tmp_path / "port", pace="patient") as board:
        found_m = places_m(board, law, monkeypatch)
        swing_m = max(found_m) - min(found_m)
        if still:
            assert swing_m < STILL_M[board.kind]
            depth_m = PRESS_N / STIFFNESS_N_PER_M
            assert sum(found_m) / SETTLED == pytest.approx(WALL_M - HELD_M - depth_m, abs=0.1 * depth_m)
        else:
            assert swing_m > 1e-3
