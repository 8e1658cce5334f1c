"""The serial rig's firmware, built once, and a board that runs it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.firmware.board import Board, Built, Pace, build


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    return build(tmp_path_factory.mktemp("firmware"))


@pytest.fixture
def start_board(built: Built, tmp_path: Path) -> Iterator[Callable[[Pace], Board]]:
    """Starts boards that end with the test."""
    with ExitStack() as boards:
        yield lambda pace: boards.enter_context(Board(built, tmp_path / "rig", pace))
