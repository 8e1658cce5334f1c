"""Requests to the loop, one at a time and in order: the mailbox holds a single letter. Disarming waits behind none."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from hapticd.errors import HapticdError
from hapticd.loop.memory import DISARM, DISARMED, DONE, MAIL, SharedMemory

MOST_WAITING = 100

Answer = Callable[[str], None]
"""Called with "" when the loop has done it, else with why not."""


class RequestQueue:
    """The queue in front of the loop's mailbox.

    Args:
        shared: the memory shared with the loop.
    """

    def __init__(self, shared: SharedMemory) -> None:
        self._shared = shared
        self._waiting: deque[tuple[dict[str, Any], Answer]] = deque()
        self._posted: Answer | None = None
        self._calibrating = False
        self._disarming: list[Answer] = []

    def submit(self, letter: dict[str, Any], answer: Answer) -> None:
        """Queue a letter; its answer comes from a later `turn`.

        During a calibration, which takes as long as it takes, all are refused: nobody who has given up waiting is to
        find the device armed afterwards.
        """
        if self._calibrating:
            answer("the device is calibrating: wait, or call it off with `hapticd disarm`")
        elif len(self._waiting) >= MOST_WAITING:
            answer("too many requests are waiting for the loop; try again")
        else:
            self._waiting.append((letter, answer))

    def disarm(self, answer: Answer) -> None:
        """Have the loop let go at its next tick; a calibration is called off, and what was to arm later does not."""
        self._shared.words[DISARM] += 1
        self._disarming.append(answer)
        waiting, self._waiting = self._waiting, deque()
        for letter, other in waiting:
            if letter["do"] in ("arm", "calibrate"):
                other("disarmed meanwhile")
            else:
                self._waiting.append((letter, other))

    def turn(self) -> None:
        """Hand out the answers that have come, and post the next letter."""
        words = self._shared.words
        if self._disarming and words[DISARMED] == words[DISARM]:
            answers, self._disarming = self._disarming, []
            for answer in answers:
                answer("")
        if self._posted is not None:
            if words[DONE] != words[MAIL]:
                return
            answer, self._posted = self._posted, None
            self._calibrating = False
            answer(self._shared.verdict())
        if self._waiting:
            letter, answer = self._waiting.popleft()
            try:
                self._shared.post(letter)
            except HapticdError as error:
                answer(str(error))
            else:
                self._posted = answer
                if letter["do"] == "calibrate":
                    self._calibrating = True
                    waiting, self._waiting = self._waiting, deque()
                    for other, its_answer in waiting:
                        self.submit(other, its_answer)

    def abandon(self, why: str) -> None:
        """Answer all that wait: the loop is gone."""
        answers = self._disarming + [answer for _, answer in self._waiting]
        if self._posted is not None:
            answers.insert(0, self._posted)
        self._posted = None
        self._calibrating = False
        self._disarming = []
        self._waiting.clear()
        for answer in answers:
            answer(why)
