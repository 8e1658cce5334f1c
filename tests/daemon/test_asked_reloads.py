"""Who asks for a reload while one is under way waits for the next one, and no crowd of them fills the memory."""

from __future__ import annotations

import pytest

from hapticd.supervisor.request_queue import MOST_WAITING
from hapticd.supervisor.state import DaemonState


@pytest.fixture
def state() -> DaemonState:
    made = DaemonState.__new__(DaemonState)  # of all its parts this needs one
    made.reload_asked = []
    return made


def test_those_who_wait_for_a_verdict_are_bounded_and_the_others_told_at_once(state: DaemonState) -> None:
    """While a law took two minutes to be imported every request was kept, and 5000 a second are taken."""
    verdicts: list[str] = []
    for _ in range(MOST_WAITING + 5):
        state.ask_reload(verdicts.append)
    assert verdicts == ["too many are waiting for a verdict on the file; try again"] * 5
    for answer in state.reload_asked:
        answer("")
    assert verdicts[5:] == [""] * MOST_WAITING


def test_those_who_do_not_wait_are_one_reload(state: DaemonState) -> None:
    for _ in range(1000):
        state.ask_reload()
    assert len(state.reload_asked) == 1
    verdicts: list[str] = []
    state.ask_reload(verdicts.append)
    state.ask_reload()
    for answer in state.reload_asked:
        answer("refused")
    assert (len(state.reload_asked), verdicts) == (2, ["refused"])
