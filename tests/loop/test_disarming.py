"""Who asks to disarm is obeyed at once, whatever else was asked for."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from hapticd.config.loading import parse
from hapticd.errors import DeviceTimeoutError, DriverStateError
from hapticd.loop.memory import DISARM, DISARMED, SharedMemory
from hapticd.supervisor.request_queue import Answer, RequestQueue
from hapticd.tick.event import EventCode
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


def loop_disarms(shared: SharedMemory) -> None:
    shared.words[DISARMED] = shared.words[DISARM]


class TestInTheQueue:
    def test_disarming_overtakes_a_request_that_is_being_worked_off(self, shared: SharedMemory) -> None:
        requests, answers = RequestQueue(shared), Answers()
        requests.submit({"do": "switch"}, answers.to("switch"))
        requests.turn()
        requests.disarm(answers.to("disarm"))
        requests.turn()
        assert answers == []
        loop_disarms(shared)
        requests.turn()
        assert answers == ["disarm: done"]

    def test_what_waits_to_arm_does_not_after_somebody_disarmed(self, shared: SharedMemory) -> None:
        requests, answers = RequestQueue(shared), Answers()
        requests.submit({"do": "switch"}, answers.to("switch"))
        requests.turn()
        for do in ("arm", "calibrate", "clear"):
            requests.submit({"do": do}, answers.to(do))
        requests.disarm(answers.to("disarm"))
        loop_disarms(shared)
        loop_answers(shared)
        requests.turn()
        assert answers == ["arm: disarmed meanwhile", "calibrate: disarmed meanwhile", "disarm: done", "switch: done"]
        assert shared.letter() == {"do": "clear"}

    def test_during_a_calibration_all_is_refused_at_once_and_nothing_arms_later(self, shared: SharedMemory) -> None:
        requests, answers = RequestQueue(shared), Answers()
        requests.submit({"do": "calibrate"}, answers.to("calibrate"))
        requests.submit({"do": "arm"}, answers.to("early arm"))
        requests.turn()
        requests.submit({"do": "switch"}, answers.to("switch"))
        assert [answer.partition(" the device is calibrating")[0] for answer in answers] == ["early arm:", "switch:"]
        loop_answers(shared)
        requests.turn()
        requests.submit({"do": "arm"}, answers.to("arm"))
        requests.turn()
        assert answers[2:] == ["calibrate: done"]
        assert shared.letter() == {"do": "arm"}

    def test_a_loop_that_is_gone_answers_all(self, shared: SharedMemory) -> None:
        requests, answers = RequestQueue(shared), Answers()
        requests.submit({"do": "calibrate"}, answers.to("calibrate"))
        requests.turn()
        requests.disarm(answers.to("disarm"))
        requests.abandon("gone")
        assert sorted(answers) == ["calibrate: gone", "disarm: gone"]


class TestInTheLoop:
    def test_disarming_calls_a_calibration_off(self, bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
        stopped = threading.Event()

        def calibrate() -> None:
            assert stopped.wait(30.0)
            raise DeviceTimeoutError("the arm did not get there")

        monkeypatch.setattr(bench.driver, "_calibrate", calibrate)
        monkeypatch.setattr(bench.driver, "_call_off", stopped.set)
        letters = bench.loop.requests
        bench.shared.post({"do": "calibrate"})
        letters.work()
        assert bench.ask(do="disarm") == ""
        while not bench.answered:
            bench.ticks(1)
            letters.work()
        assert bench.shared.verdict() == "the calibration was called off"
        assert "called off" in bench.told()[EventCode.CALIBRATION_ENDED].text

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
