"""What is asked of a daemon that looks for its device reaches the next control process, and delays none for nothing."""

from __future__ import annotations

import errno
import itertools
import os
import subprocess
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import Mock, call

import pytest

from hapticd.config.loading import parse
from hapticd.errors import DeviceNotFoundError
from hapticd.loop.memory import (
    DEVICE_LOST,
    DISARM,
    DISARMED,
    FIELDS,
    FORCE_LEFT,
    LATCHED,
    LAW,
    LAW_CODE,
    MAY_ARM,
    NEXT_SEQ,
    PORT_LAW_CODE,
    SKIPPED,
    SharedMemory,
)
from hapticd.loop.resume import ResumeState
from hapticd.simulation.options import SimulationOptions
from hapticd.supervisor import recovery
from hapticd.supervisor.child import LoopProcess
from hapticd.supervisor.command_handler import CommandHandler
from hapticd.supervisor.recovery import Recovery
from hapticd.supervisor.reload import Reload
from hapticd.supervisor.request_queue import RequestQueue
from hapticd_drivers.loopback import Loopback
from tests.daemon.running import wait_until


class UnderWay:
    """A start that takes its time."""

    def __init__(self, config: Any, _rescue: object, _mark: object, resume: ResumeState) -> None:
        self.config = config
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
    made = Recovery(Mock(), Mock())
    made.begin(LOST, "unplugged")
    try_now(made)
    return made, tries


LEFT = {NEXT_SEQ: 70, SKIPPED: 2, LAW: 1, MAY_ARM: True, LATCHED: True, DISARM: 0, DISARMED: 0}
LEFT |= {LAW_CODE: 0, PORT_LAW_CODE: 0, FIELDS: 0}
LOST: Any = SimpleNamespace(
    exit_code=0,
    left_behind="",
    force_seen_to=False,
    shared=SimpleNamespace(words=LEFT),
    info=Loopback(SimulationOptions(), 1e-3).open(),
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
        made.hurry()
        try_now(made)
    assert len(tries) == 2
    assert not tries[1].ended


@pytest.mark.parametrize("do", ["clear", "reload"])
def test_a_clear_and_a_file_that_is_taken_have_the_device_looked_for_at_once(
    lost: Lost, tmp_path: Path, do: str
) -> None:
    """What kept it away may be mended now, also where the file says what it said, as of a driver's own module."""
    file = tmp_path / "lab.toml"
    file.touch()
    lost.waits_s(8)
    answered: list[bool] = []
    state: Any = SimpleNamespace(
        config=parse("", str(file)),
        recovery=lost.made,
        reload_asked=[lambda verdict: answered.append(not verdict)] if do == "reload" else [],
        commands=SimpleNamespace(receive=lambda: [({"do": do}, answered.append, "a test")]),
        loop=SimpleNamespace(force_seen_to=False),
        notifier=Mock(),
        tell=Mock(),
        adopt=Mock(),
    )
    if do == "clear":
        CommandHandler(state).turn()
    else:
        taking = Reload(state)

        def verdict() -> bool:
            taking.turn()
            return bool(answered)

        wait_until(verdict, "a verdict")
    assert answered == [True]
    assert lost.waits_s(2) == pytest.approx([0.0, 1.0], abs=0.02)


@pytest.mark.parametrize("left", ["", "the device did not let go: no answer"])
def test_who_disarms_a_device_that_is_lost_hears_once_it_is_known_what_became_of_its_force(
    left: str,
) -> None:
    """It was answered with ok at once, with the loop still hanging in its driver and the force on the hand."""
    made = Recovery(Mock(), Mock())
    made.begin(LOST, "silent")
    verdicts: list[str] = []
    asked = [({"do": "disarm"}, lambda _ok, verdict: verdicts.append(verdict), "a test")]
    stalled: list[bool] = []
    loop: Any = SimpleNamespace(
        exit_code=None, force_seen_to=False, stalled=lambda: bool(stalled), kill=lambda: None, info=LOST.info
    )
    state: Any = SimpleNamespace(
        recovery=made,
        loop=loop,
        requests=RequestQueue(cast("SharedMemory", SimpleNamespace(words=defaultdict(int)))),
        commands=SimpleNamespace(receive=lambda: [asked.pop()] if asked else []),
        arm_hold=Mock(),
        release=SimpleNamespace(force_left=left),
        tell=Mock(),
    )
    state.requests.disarm(verdicts.append)
    state.requests.abandon("device lost", None)  # as it is lost
    handler = CommandHandler(state)

    def turn() -> None:
        made.turn(loop, NO_CONFIG)
        handler.turn()
        state.requests.turn(1 << 60)

    for _ in range(3):
        turn()
    assert verdicts == []
    assert not made.resume.may_arm
    stalled.append(True)
    turn()
    said = f"the force may still be there: {left}; switch the device off" if left else ""
    assert verdicts == [said] * 2
    asked.append(({"do": "disarm"}, lambda _ok, verdict: verdicts.append(verdict), "a test"))
    turn()
    assert verdicts == [said] * 3, "by the next turn there may be another loop"


@pytest.mark.parametrize(("text", "tries_wanted"), [("[safety]\nmax_force_n = 2.0\n", 2), ("# a remark\n", 1)])
def test_a_reload_reaches_the_try_that_is_under_way_by_another_one(
    looking: tuple[Recovery, list[UnderWay]], tmp_path: Path, text: str, tries_wanted: int
) -> None:
    """Under way it has the file of before, and its limit of force, which the daemon would show as changed."""
    made, tries = looking
    file = tmp_path / "lab.toml"
    file.write_text(text)
    verdicts: list[str] = []
    state: Any = SimpleNamespace(
        config=parse("", str(file)),
        recovery=made,
        reload_asked=[verdicts.append],
        notifier=SimpleNamespace(send=lambda *_: None),
        tell=lambda *_: None,
        adopt=lambda config, _ring: setattr(state, "config", config),
    )
    taking = Reload(state)

    def answered() -> bool:
        taking.turn()
        return bool(verdicts)

    wait_until(answered, "a verdict")
    assert (verdicts, state.config.text) == ([""], text)
    made.turn(LOST, state.config)
    assert len(tries) == tries_wanted
    assert [each.ended for each in tries] == [True, False][-tries_wanted:]
    assert tries_wanted == 1 or tries[-1].config is state.config


class Lost:
    """A device that stays away, and a clock of the test's."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 1000.0
        self.plugged_in = False
        monkeypatch.setattr(recovery, "time", SimpleNamespace(monotonic=lambda: self.now_s))
        monkeypatch.setattr(recovery, "HotplugWatch", lambda: SimpleNamespace(news=self._news))
        monkeypatch.setattr(recovery, "LoopStart", self._refuse)
        self.rescue = Mock()
        self.made = Recovery(self.rescue, Mock())
        self.tries_s: list[float] = []

    def _news(self) -> bool:
        news, self.plugged_in = self.plugged_in, False
        return news

    def _refuse(self, *_arguments: Any) -> UnderWay:
        self.tries_s.append(self.now_s)
        raise DeviceNotFoundError("not there")

    def waits_s(self, tries: int) -> list[float]:
        """How long it was from one try to the next, a turn every 10 ms."""
        self.tries_s = [self.now_s]
        while len(self.tries_s) <= tries:
            self.now_s = round(self.now_s + 0.01, 2)
            self.made.turn(LOST, NO_CONFIG)
        return [later - earlier for earlier, later in itertools.pairwise(self.tries_s)]


@pytest.fixture
def lost(monkeypatch: pytest.MonkeyPatch) -> Lost:
    away = Lost(monkeypatch)
    away.made.begin(LOST, "unplugged")
    return away


def test_the_waits_double_from_one_second_to_thirty(lost: Lost) -> None:
    """T8."""
    assert lost.waits_s(8) == pytest.approx([1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0, 30.0], abs=0.02)


def test_what_is_plugged_in_is_tried_a_second_later_and_the_waits_begin_anew(lost: Lost) -> None:
    """T8."""
    lost.waits_s(6)
    lost.plugged_in = True
    assert lost.waits_s(4) == pytest.approx([1.0, 1.0, 2.0, 4.0], abs=0.02)


@pytest.mark.parametrize(("steady_s", "waits_s"), [(59.9, [8.0, 16.0]), (60.2, [1.0, 2.0])])
def test_a_device_that_stayed_for_a_minute_is_looked_for_as_if_for_the_first_time(
    monkeypatch: pytest.MonkeyPatch, lost: Lost, steady_s: float, waits_s: list[float]
) -> None:
    """T8."""
    lost.waits_s(2)  # the next one that fails is followed by 8 s
    found = SimpleNamespace(poll=lambda: LOST, end=lambda: None)
    refuse = lost._refuse
    monkeypatch.setattr(recovery, "LoopStart", lambda *_arguments: found)
    while lost.made.lost:
        lost.now_s += 0.01
        lost.made.turn(LOST, NO_CONFIG)
    monkeypatch.setattr(recovery, "LoopStart", refuse)
    lost.now_s += steady_s
    lost.made.begin(LOST, "unplugged again")
    assert lost.waits_s(2) == pytest.approx(waits_s, abs=0.02)


def test_soon_after_the_computer_came_up_the_first_wait_is_as_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its clock shows less than a minute then."""
    away = Lost(monkeypatch)
    away.now_s = 5.0
    away.made.begin(LOST, "unplugged")
    assert away.waits_s(3) == pytest.approx([1.0, 2.0, 4.0], abs=0.02)
    assert away.made.lost_s == 5.0
    assert away.made.why == "not there"


@pytest.mark.parametrize("stalled", [False, True])
def test_nothing_is_tried_before_the_process_that_lost_it_has_ended(lost: Lost, stalled: bool) -> None:
    """One that hangs in its driver is killed, once, and the force taken away from outside: its device may be there."""
    killed: list[bool] = []
    ending: Any = SimpleNamespace(
        exit_code=None, force_seen_to=False, stalled=lambda: stalled, kill=lambda: killed.append(True)
    )
    lost.now_s += 100.0
    for _ in range(3):  # one that waits inside the kernel stays
        assert lost.made.turn(ending, NO_CONFIG) is None
    assert lost.tries_s == []
    assert killed == [True] * stalled
    said = "the control loop did not let go of its device and was killed"
    assert lost.rescue.mock_calls == [call(said)] * stalled


@pytest.mark.parametrize(
    ("code", "said"),
    [
        (DEVICE_LOST, ""),
        (FORCE_LEFT, "the control loop could not take the force away"),
        (-11, "the loop's process was killed by signal 11"),
        (1, "the loop's process ended with exit code 1"),
    ],
)
def test_a_loop_that_lost_its_device_and_did_not_let_go_has_the_force_taken_away_once(
    lost: Lost, code: int, said: str
) -> None:
    """A lost device may only be silent, and hold its last force."""
    process = SimpleNamespace(poll=lambda: code, returncode=code)
    ended = LoopProcess.__new__(LoopProcess)
    ended.process, ended.force_seen_to = cast("subprocess.Popen[bytes]", process), False
    for _ in range(3):
        lost.made.turn(ended, NO_CONFIG)
    assert lost.rescue.mock_calls == ([call(said)] if said else [])


def test_who_has_seen_to_what_kept_the_device_away_waits_for_nothing(lost: Lost) -> None:
    """It took up to 30 s until the next try. Again and again, it ends no try that is under way."""
    lost.waits_s(8)
    lost.made.hurry()
    assert lost.waits_s(4) == pytest.approx([0.0, 1.0, 2.0, 4.0], abs=0.02)


def test_what_comes_is_news_once_and_what_goes_is_none(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The lists are looked at four times a second."""
    clock = SimpleNamespace(now_s=0.0)
    monkeypatch.setattr(recovery, "time", SimpleNamespace(monotonic=lambda: clock.now_s))
    monkeypatch.setattr(recovery, "PLACES", (tmp_path / "usb", tmp_path / "tty"))
    (tmp_path / "usb").mkdir()  # there are no serial lines
    (tmp_path / "usb" / "mouse").touch()
    watch = recovery.HotplugWatch()
    assert not watch.news()
    (tmp_path / "usb" / "arm").touch()
    assert not watch.news()  # too soon for a look
    clock.now_s += 0.3
    assert watch.news()
    clock.now_s += 0.3
    assert not watch.news()
    (tmp_path / "usb" / "mouse").unlink()
    clock.now_s += 0.3
    assert not watch.news()
    (tmp_path / "usb" / "arm").unlink()
    (tmp_path / "usb" / "other").touch()
    clock.now_s += 0.3
    assert watch.news()


def test_the_loop_that_has_the_device_is_handed_over_and_nothing_is_looked_for_any_more(
    looking: tuple[Recovery, list[UnderWay]], monkeypatch: pytest.MonkeyPatch
) -> None:
    made, tries = looking
    assert made.lost
    found: Any = SimpleNamespace()
    monkeypatch.setattr(tries[0], "poll", lambda: found)
    assert made.turn(LOST, NO_CONFIG) is found
    assert not made.lost


def test_a_loop_that_has_the_device_and_cannot_be_taken_is_not_left_alone_with_it(
    looking: tuple[Recovery, list[UnderWay]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would hold the device against every try to come, and with `safety.auto_arm` its forces."""
    made, tries = looking

    def no_room() -> None:
        raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))

    monkeypatch.setattr(tries[0], "poll", no_room)
    assert made.turn(LOST, NO_CONFIG) is None
    assert made.lost
    assert tries[0].ended
    try_now(made)
    assert [each.ended for each in tries] == [True, False]


def test_what_was_plugged_in_before_the_device_was_lost_is_no_news(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(recovery, "PLACES", (tmp_path,))
    monkeypatch.setattr(recovery, "LoopStart", UnderWay)
    made = Recovery(Mock(), Mock())
    (tmp_path / "another").touch()
    made.begin(LOST, "unplugged")
    made.next_try_s = due_s = made.next_try_s + 100.0
    made.turn(LOST, NO_CONFIG)
    assert made.next_try_s == due_s
