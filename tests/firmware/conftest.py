"""The firmware of each board, built once, and boards that run it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
from pathlib import Path

import pytest

from tests.firmware.board import Board, Built, Kind, Pace, build


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Kind], Built]:
    return cache(lambda kind: build(tmp_path_factory.mktemp("firmware"), kind))


@pytest.fixture
def start_board(built: Callable[[Kind], Built], tmp_path: Path) -> Iterator[Callable[[Pace, Kind], Board]]:
    """Starts boards that end with the test."""
    with ExitStack() as boards:
        yield lambda pace, kind: boards.enter_context(Board(built(kind), tmp_path / "rig", pace))
