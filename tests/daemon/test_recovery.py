"""What is asked of a daemon that looks for its device reaches the next control process, and delays none for nothing."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from hapticd.loop.memory import DISARM, DISARMED, LATCHED, LAW, MAY_ARM, NEXT_SEQ, SKIPPED
from hapticd.loop.resume import ResumeState
from hapticd.simulation.options import SimulationOptions
from hapticd.supervisor import recovery
from hapticd.supervisor.recovery import Recovery
from hapticd_drivers.loopback import Loopback


class UnderWay:
    """A start that takes its time."""

    def __init__(self, _config: Any, resume: ResumeState) -> None:
        self.resume = resume
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
    made.begin(LOST, "unplugged")
    try_now(made)
    return made, tries


LEFT = {NEXT_SEQ: 70, SKIPPED: 2, LAW: 1, MAY_ARM: True, LATCHED: True, DISARM: 0, DISARMED: 0}
LOST: Any = SimpleNamespace(
    exit_code=0, shared=SimpleNamespace(words=LEFT), info=Loopback(SimulationOptions(), 1e-3).open()
)
NO_CONFIG: Any = None


def try_now(looking: Recovery) -> None:
    looking.next_try_s = 0.0
    looking.turn(LOST, NO_CONFIG)


def test_a_clear_reaches_the_try_that_is_under_way_by_another_one(
    looking: tuple[Recovery, list[UnderWay]],
) -> None:
    made, tries = looking
    assert tries[0].resume.latched
    made.amend(replace(made.resume, latched=False))
    assert tries[0].ended
    try_now(made)
    assert not tries[1].resume.latched


def test_clearing_again_and_again_keeps_no_device_away(looking: tuple[Recovery, list[UnderWay]]) -> None:
    made, tries = looking
    made.amend(replace(made.resume, latched=False))
    try_now(made)
    for _ in range(5):
        made.amend(replace(made.resume, latched=False))
        try_now(made)
    assert len(tries) == 2
    assert not tries[1].ended
