"""What is asked of a daemon that looks for its device reaches the next control process, and delays none for nothing."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from hapticd.loop.resume import ResumeState
from hapticd.supervisor import recovery
from hapticd.supervisor.recovery import Recovery


class UnderWay:
    """A start that takes its time."""

    def __init__(self, _config: Any, before: ResumeState) -> None:
        self.before = before
        self.ended = False

    def poll(self) -> None: ...

    def end(self) -> None:
        self.ended = True


@pytest.fixture
def looking(monkeypatch: pytest.MonkeyPatch) -> tuple[Recovery, list[UnderWay]]:
    """A recovery in the middle of a try, and all its tries."""
    tries: list[UnderWay] = []

    def start(*arguments: Any) -> UnderWay:
        tries.append(UnderWay(*arguments))
        return tries[-1]

    monkeypatch.setattr(recovery, "LoopStart", start)
    made = Recovery()
    made.begin(LOST, NO_TICK, True, False, "unplugged")
    try_now(made)
    return made, tries


LOST: Any = SimpleNamespace(exit_code=0, shared=SimpleNamespace(words=[0]))
NO_TICK: Any = None
NO_CONFIG: Any = None


def try_now(looking: Recovery) -> None:
    looking.next_try_s = 0.0
    looking.turn(LOST, NO_CONFIG)


def test_a_clear_reaches_the_try_that_is_under_way_by_another_one(
    looking: tuple[Recovery, list[UnderWay]],
) -> None:
    made, tries = looking
    assert tries[0].before.latched
    made.amend(replace(made.before, latched=False))
    assert tries[0].ended
    try_now(made)
    assert not tries[1].before.latched


def test_clearing_again_and_again_keeps_no_device_away(looking: tuple[Recovery, list[UnderWay]]) -> None:
    made, tries = looking
    made.amend(replace(made.before, latched=False))
    try_now(made)
    for _ in range(5):
        made.amend(replace(made.before, latched=False))
        try_now(made)
    assert len(tries) == 2
    assert not tries[1].ended
