"""`hapticd hapkit-table`: a bent sensor on the real firmware, a hand that swings the handle, and an even board."""

from __future__ import annotations

import json
import math
import random
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from hapticd import cli
from hapticd.errors import ConfigError
from hapticd_drivers.rig import conversation
from hapticd_drivers.rig.angle_table import HALF_TURN, NODES, AngleTable, Swings
from hapticd_drivers.rig.board_header import read_table, table_line, with_table
from hapticd_drivers.rig.swinging import USABLE_ERROR
from tests.drivers.rig.device import PATIENCE_S
from tests.firmware.board import Board, Built, build
from tests.firmware.talk import Talk
from tests.firmware.test_hapkit import COUNT_M
from tests.firmware.tools import FIRMWARE

BEND = 0.1
"""Of the voltage's slope; its greatest error is that over 2 pi of a half turn: 16 counts, 0.24 mm."""

TURN_BACK_M = 0.022, 0.031
"""Another place each time, as the command asks for; the stops are at 0.035 m."""

HAND_N = 1.0
HAND_N_S_PER_M = 2.5
LOWEST_RAW, HIGHEST_RAW = 15, 980


@pytest.fixture
def firmware(tmp_path: Path) -> Path:
    """The sources, for a user to change."""
    copy = tmp_path / "firmware"
    for folder in ("protocol", "serial-rig"):
        shutil.copytree(FIRMWARE / folder, copy / folder)
    return copy


@contextmanager
def swung(board: Board) -> Iterator[None]:
    """A hand swings the handle to and fro."""
    over = threading.Event()

    def swing() -> None:
        chance = random.Random(0)
        way, turn_back_m = 1.0, TURN_BACK_M[0]
        while not over.is_set():
            position_m = board.state().position_m
            if way * position_m > turn_back_m:
                way, turn_back_m = -way, chance.uniform(*TURN_BACK_M)
                board.hand(way * HAND_N)
            over.wait(0.001)

    board.grip(0.0, HAND_N_S_PER_M, 0.0)
    board.hand(HAND_N)
    hand = threading.Thread(target=swing)
    hand.start()
    try:
        yield
    finally:
        over.set()
        hand.join(60.0)


def hapkit_table(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Exit code, output and messages of the command."""
    with pytest.raises(SystemExit) as ended:
        cli.main(["hapkit-table", *arguments])
    said = capsys.readouterr()
    return int(ended.value.code or 0), said.out, said.err


def unevenness(board: Board) -> int:
    """Largest error over the half turns of the travel [counts]."""
    board.plant(mass_kg=0.002, damping_n_s_per_m=0.5)
    board.bend_sensor(BEND)
    with Talk(board) as host:
        host.greet()
        begin = host.poll().position[0]
        worst = 0
        for step in range(40):
            board.grip(2000.0, 4.0, step * 45 * COUNT_M)
            board.run(7_000)
            worst = max(worst, abs(host.poll().position[0] - begin - board.state().counts))
        return worst


def test_a_table_measured_by_swinging_makes_an_uneven_sensor_even(
    hapkit_parts: Built,
    firmware: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(conversation, "ANSWER_S", 1.0)  # a busy computer is no silent board
    monkeypatch.setattr(conversation, "PATIENCE_S", PATIENCE_S)
    header = firmware / "serial-rig" / "hapkit" / "board.h"
    with Board(hapkit_parts, tmp_path / "port", "frames") as board:
        board.bend_sensor(BEND)
        with swung(board):
            code, out, err = hapkit_table(
                capsys, "--port", str(board.port), "--board", str(header), "--write", "--json", "--longest", "240"
            )
        assert board.state().motor_n == 0.0
    assert code == 0, err
    found: dict[str, Any] = json.loads(out)
    assert found["uneven_counts"] == pytest.approx(BEND * HALF_TURN / (2.0 * math.pi), abs=USABLE_ERROR)
    assert read_table(header.read_text()) == found["nodes"]
    with Board(hapkit_parts, tmp_path / "before", "steps") as before:
        assert unevenness(before) > 14
    with Board(build(tmp_path, "hapkit", firmware), tmp_path / "after", "steps") as after:
        assert unevenness(after) <= 3


def test_a_handle_that_rests_gives_no_table(
    hapkit_parts: Built, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with Board(hapkit_parts, tmp_path / "port", "frames") as board:
        code, out, err = hapkit_table(capsys, "--port", str(board.port), "--longest", "1")
    assert (code, out) == (1, "")
    assert "0 half turns could be used" in err
    assert "twice a second" in err


def test_a_board_without_an_angle_sensor_is_refused(
    board_parts: Built, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with Board(board_parts, tmp_path / "port", "frames") as board:
        code, _, err = hapkit_table(capsys, "--port", str(board.port))
    assert code == 2
    assert "is a serial-rig: only a hapkit has an angle table" in err


def test_a_header_that_cannot_be_read_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    header = tmp_path / "board.h"
    for arguments, told in (
        (["--board", str(header)], "No such file"),
        (["--write"], "say into which header with --board"),
    ):
        code, _, err = hapkit_table(capsys, *arguments)
        assert code == 2
        assert told in err
    header.write_text("#define TABLE {1, 2}")
    assert "17 numbers" in hapkit_table(capsys, "--board", str(header))[2]


def straight(raw: float) -> int:
    return int((raw - LOWEST_RAW) * HALF_TURN / (HIGHEST_RAW - LOWEST_RAW))


def test_the_shipped_header_is_read_as_the_compiler_reads_it_and_takes_another_table() -> None:
    text = (FIRMWARE / "serial-rig" / "hapkit" / "board.h").read_text()
    assert read_table(text) == [straight(64 * node) for node in range(NODES)]
    other = [60 * node - 9 for node in range(NODES)]
    changed = with_table(text, other)
    assert read_table(changed) == other
    assert table_line(other) in changed
    assert read_table(with_table(changed, read_table(text))) == read_table(text)


@pytest.mark.parametrize("spoilt", ["", "#define TABLE {x}", "#define TABLE {LINE(0), 4}"])
def test_a_header_without_a_table_is_refused(spoilt: str) -> None:
    with pytest.raises(ConfigError):
        read_table(spoilt)


Motion = Callable[[float], float]


def learned(motion: Motion, seconds: float = 20.0, start_us: int = 0) -> AngleTable | None:
    """From a handle whose place in half turns a motion gives, on a sensor that is bent as the board's."""
    swings = Swings([straight(64 * node) for node in range(NODES)])
    for tick in range(round(1000 * seconds)):
        place = motion(0.001 * tick)
        share = place - math.floor(place)
        bent = share + BEND * math.sin(2.0 * math.pi * share) / (2.0 * math.pi)
        swings.add((start_us + 1000 * tick) % (1 << 32), math.floor(place) * HALF_TURN + round(bent * HALF_TURN))
    return swings.table()


def to_and_fro(time_s: float) -> float:
    """As a hand swings: neither evenly nor always alike."""
    return 2.3 * math.sin(2.0 * math.pi * (0.9 + 0.1 * math.sin(0.7 * time_s)) * time_s) + 0.1 * math.sin(4.0 * time_s)


def test_the_correction_is_the_bend_whatever_the_hand_does() -> None:
    found = learned(to_and_fro)
    assert found is not None
    assert found.is_good
    for node, corrected in enumerate(found.nodes[1:-1], start=1):
        bent = straight(64 * node) / HALF_TURN
        share = bent
        for _ in range(50):
            share = bent - BEND * math.sin(2.0 * math.pi * share) / (2.0 * math.pi)
        assert corrected == pytest.approx(share * HALF_TURN, abs=2.5)


def test_a_clock_that_overflows_is_no_jump() -> None:
    found, as_if_not = learned(to_and_fro, start_us=(1 << 32) - 5_000_000), learned(to_and_fro)
    assert found is not None
    assert as_if_not is not None
    assert (found.nodes, found.passes) == (as_if_not.nodes, as_if_not.passes)


@pytest.mark.parametrize(
    "motion",
    [
        lambda time_s: 0.4 * math.sin(10.0 * time_s),  # within a half turn
        lambda time_s: 1.0 + 0.3 * math.sin(10.0 * time_s),  # to and fro over one edge
        lambda time_s: 2.0 * math.floor(time_s) + 0.5,  # jumps
    ],
)
def test_of_what_is_no_swing_nothing_is_learned(motion: Motion) -> None:
    assert learned(motion) is None
