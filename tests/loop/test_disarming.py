"""Who asks to disarm is obeyed at once, whatever else was asked for."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from hapticd.config.loading import parse
from hapticd.errors import DeviceTimeoutError, DriverStateError
from hapticd.loop.memory import DISARM, DISARMED, DISARMED_SINCE, RECORDS, SharedMemory
from hapticd.supervisor.request_queue import ARMED_SINCE, Answer, RequestQueue
from hapticd.tick.event import EventCode
from hapticd.tick.flags import Flag
from hapticd.tick.record import RecordLayout
from tests.loop.bench import Bench


@pytest.fixture
def shared() -> Iterator[SharedMemory]:
    memory = SharedMemory(RecordLayout(1, False, 8), 1000.0)
    yield memory
    memory.close()


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench(parse("", "x"))
    yield bench
    bench.close()


class Answers(list[str]):
    """Answers in the order in which they came, each with who got it."""

    def to(self, who: str) -> Answer:
        return lambda text: self.append(f"{who}: {text or 'done'}")


def loop_answers(shared: SharedMemory, verdict: str = "") -> None:
    shared.answer(verdict)


def turn(requests: RequestQueue, shared: SharedMemory) -> None:
    """A turn of the supervisor, another one once the loop has ticked again."""
    requests.turn(shared.words[RECORDS])
    shared.words[RECORDS] += 1
    requests.turn(shared.words[RECORDS])


def loop_disarms(shared: SharedMemory) -> None:
    shared.words[DISARMED] = shared.words[DISARM]


class TestInTheQueue:
    def test_disarming_overtakes_a_request_that_is_being_worked_off(self, shared: SharedMemory) -> None:
        requests, answers = RequestQueue(shared), Answers()
        requests.submit({"do": "switch"}, answers.to("switch"))
        turn(requests, shared)
        requests.disarm(answers.to("disarm"))
        turn(requests, shared)
        assert answers == []
        loop_disarms(shared)
        turn(requests, shared)
        assert answers == ["disarm: done"]

    def test_it_is_answered_after_the_first_record_that_shows_it(self, shared: SharedMemory) -> None:
        """Who asks for the status then does not read that the device is armed."""
        requests, answers = RequestQueue(shared), Answers()
        assert not requests.disarming
        requests.disarm(answers.to("disarm"))
        assert requests.disarming
        shared.words[RECORDS] = 8
        loop_disarms(shared)
        requests.turn(7)
        shared.words[RECORDS] = 9
        requests.turn(8)
        assert (answers, requests.disarming) == ([], True)
        requests.turn(9)
        assert (answers, requests.disarming) == (["disarm: done"], False)

    @pytest.mark.parametrize(
        ("flags", "answer"), [(0, "disarm: done"), (Flag.ARMED, f"disarm: {ARMED_SINCE}")], ids=["gone", "armed anew"]
    )
    def test_who_waits_for_the_device_to_let_go_hears_when_it_has(
        self, shared: SharedMemory, flags: int, answer: str
    ) -> None:
        requests, answers = RequestQueue(shared), Answers()
        requests.disarm(answers.to("disarm"), wait=True)
        loop_disarms(shared)
        for record in range(1, 9):
            requests.turn(record, Flag.RELEASING)
            shared.words[RECORDS] = record + 1
            assert requests.disarming
        assert answers == []
        for record in range(9, 12):
            requests.turn(record, flags)
        assert answers == [answer]

    def test_the_first_record_without_a_force_does_not_say_yet_that_the_device_has_let_go(
        self, shared: SharedMemory
    ) -> None:
        """The loop records a tick before it disables the device, and ticks many times in a turn of the supervisor."""
        requests, answers = RequestQueue(shared), Answers()
        requests.disarm(answers.to("disarm"), wait=True)
        loop_disarms(shared)
        for record, flags in ((1, Flag.RELEASING), (10, Flag.RELEASING), (20, 0), (20, 0)):
            shared.words[RECORDS] = record
            requests.turn(record, flags)
        assert answers == []
        requests.turn(21, 0)
        assert answers == ["disarm: done"]

    @pytest.mark.parametrize("wait", [False, True])
    def test_one_who_asks_again_and_again_keeps_no_answer_away(self, shared: SharedMemory, wait: bool) -> None:
        """In each turn it has asked once more than the loop has done."""
        requests, answers = RequestQueue(shared), Answers()
        requests.disarm(answers.to("first"), wait=wait)
        for number in range(8):
            loop_disarms(shared)
            requests.disarm(answers.to(str(number)), wait=wait)
            turn(requests, shared)
        assert answers[:3] == ["first: done", "0: done", "1: done"]

    def test_what_waits_to_arm_does_not_after_somebody_disarmed(self, shared: SharedMemory) -> None:
        requests, answers = RequestQueue(shared), Answers()
        requests.submit({"do": "switch"}, answers.to("switch"))
        turn(requests, shared)
        for do in ("arm", "calibrate", "clear"):
            requests.submit({"do": do}, answers.to(do))
        requests.disarm(answers.to("disarm"))
        loop_disarms(shared)
        loop_answers(shared)
        turn(requests, shared)
        assert answers == [
            "arm: not done: disarming was asked for after it",
            "calibrate: not done: disarming was asked for after it",
            "disarm: done",
            "switch: done",
        ]
        assert shared.request()["do"] == "clear"

    def test_during_a_calibration_all_is_refused_at_once_and_nothing_arms_later(self, shared: SharedMemory) -> None:
        requests, answers = RequestQueue(shared), Answers()
        requests.submit({"do": "calibrate"}, answers.to("calibrate"))
        requests.submit({"do": "arm"}, answers.to("early arm"))
        turn(requests, shared)
        requests.submit({"do": "switch"}, answers.to("switch"))
        assert [answer.partition(" the device is calibrating")[0] for answer in answers] == ["early arm:", "switch:"]
        loop_answers(shared)
        turn(requests, shared)
        requests.submit({"do": "arm"}, answers.to("arm"))
        turn(requests, shared)
        assert answers[2:] == ["calibrate: done"]
        assert shared.request()["do"] == "arm"

    def test_a_loop_that_is_gone_answers_all(self, shared: SharedMemory) -> None:
        requests, answers = RequestQueue(shared), Answers()
        requests.submit({"do": "calibrate"}, answers.to("calibrate"))
        turn(requests, shared)
        requests.disarm(answers.to("disarm"))
        requests.abandon("gone")
        assert sorted(answers) == ["calibrate: gone", "disarm: done"], "there is no force any more"

    @pytest.mark.parametrize("left", ["", "the device did not answer"])
    def test_who_asked_to_disarm_a_loop_that_is_gone_hears_what_became_of_the_force(
        self, shared: SharedMemory, left: str
    ) -> None:
        """A loop that hung was answered for with ok, where nobody could take its force away."""
        requests, answers = RequestQueue(shared), Answers()
        requests.disarm(answers.to("disarm"))
        requests.submit({"do": "clear"}, answers.to("clear"))
        requests.abandon("gone", left)
        requests.settle("told once")
        said = f"the force may still be there: {left}; switch the device off" if left else "done"
        assert answers == ["clear: gone", f"disarm: {said}"]

    def test_what_a_lost_loop_had_done_before_is_told_as_it_was(self, shared: SharedMemory) -> None:
        requests, answers = RequestQueue(shared), Answers()
        requests.submit({"do": "clear"}, answers.to("clear"))
        requests.turn(0)
        loop_answers(shared)
        requests.abandon("gone")
        assert answers == ["clear: done"]

    def test_an_answer_comes_after_the_first_record_that_shows_what_was_done(self, shared: SharedMemory) -> None:
        requests, answers = RequestQueue(shared), Answers()
        requests.submit({"do": "switch"}, answers.to("switch"))
        shared.words[RECORDS] = 7
        requests.turn(7)
        loop_answers(shared)
        requests.turn(7)
        requests.turn(7)
        assert answers == []
        requests.turn(8)
        assert answers == ["switch: done"]


class TestInTheLoop:
    def test_disarming_calls_a_calibration_off(self, bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
        stopped = threading.Event()

        def calibrate() -> None:
            assert stopped.wait(30.0)
            raise DeviceTimeoutError("the arm did not get there")

        monkeypatch.setattr(bench.driver, "_calibrate", calibrate)
        monkeypatch.setattr(bench.driver, "_call_off", stopped.set)
        requests = bench.loop.requests
        bench.shared.post({"do": "calibrate"})
        requests.work()
        assert bench.ask(do="disarm") == ""
        while not bench.answered:
            bench.ticks(1)
            requests.work()
        assert bench.shared.verdict() == "the calibration was called off"
        assert "called off" in bench.told()[EventCode.CALIBRATION_ENDED].text

    def test_disarming_calls_a_calibration_off_that_waits_for_the_ramp_of_the_disarming_before(
        self, bench: Bench, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        moved: list[bool] = []
        monkeypatch.setattr(bench.driver, "_calibrate", lambda: moved.append(True))
        bench.ticks(1)
        assert bench.ask(do="arm") == ""
        bench.ticks(100)
        assert bench.ask(do="disarm") == ""
        bench.shared.post({"do": "calibrate"})
        bench.loop.requests.work()
        assert not bench.answered
        assert bench.ask(do="disarm") == ""
        while not bench.answered:
            bench.ticks(1)
            bench.loop.requests.work()
        assert bench.shared.verdict() == DISARMED_SINCE
        assert moved == []

    def test_a_calibration_that_fails_by_itself_says_why(self, bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
        def calibrate() -> None:
            raise DeviceTimeoutError("the arm did not get there")

        monkeypatch.setattr(bench.driver, "_calibrate", calibrate)
        assert bench.ask(do="calibrate") == "the arm did not get there"
        assert "did not get there" in bench.told()[EventCode.CALIBRATION_ENDED].text

    def test_a_call_off_from_before_does_not_stop_the_next_calibration(self, bench: Bench) -> None:
        bench.driver.call_off()
        assert bench.ask(do="disarm") == ""
        assert bench.ask(do="calibrate") == ""

    def test_a_driver_whose_call_off_fails_is_still_disabled(
        self, bench: Bench, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse() -> None:
            raise DriverStateError("no")

        seen: list[bool] = []

        def calibrate() -> None:
            bench.driver.disable()
            seen.append(True)

        monkeypatch.setattr(bench.driver, "_calibrate", calibrate)
        monkeypatch.setattr(bench.driver, "_call_off", refuse)
        assert bench.ask(do="calibrate") == ""
        assert seen == [True]
