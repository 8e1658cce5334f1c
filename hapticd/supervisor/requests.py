"""Requests to the loop, one at a time and in order: the mailbox holds a single letter."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from hapticd.contracts.errors import HapticdError
from hapticd.control.shared import DONE, MAIL, SharedMemory

MOST_WAITING = 100

Answer = Callable[[str], None]
"""Called with "" when the loop has done it, else with why not."""


class Requests:
    """The queue in front of the loop's mailbox.

    Args:
        shared: the memory shared with the loop.
    """

    def __init__(self, shared: SharedMemory) -> None:
        self._shared = shared
        self._waiting: deque[tuple[dict[str, Any], Answer]] = deque()
        self._posted: Answer | None = None

    def submit(self, letter: dict[str, Any], answer: Answer) -> None:
        """Queue a letter; its answer comes from a later `turn`."""
        if len(self._waiting) >= MOST_WAITING:
            answer("too many requests are waiting for the loop; try again")
        else:
            self._waiting.append((letter, answer))

    def turn(self) -> None:
        """Hand out the answer that has come, and post the next letter."""
        words = self._shared.words
        if self._posted is not None:
            if words[DONE] != words[MAIL]:
                return
            answer, self._posted = self._posted, None
            answer(self._shared.verdict())
        if self._waiting:
            letter, answer = self._waiting.popleft()
            try:
                self._shared.post(letter)
            except HapticdError as error:
                answer(str(error))
            else:
                self._posted = answer

    def abandon(self, why: str) -> None:
        """Answer all that wait: the loop is gone."""
        answers = [answer for _, answer in self._waiting]
        if self._posted is not None:
            answers.insert(0, self._posted)
        self._posted = None
        self._waiting.clear()
        for answer in answers:
            answer(why)
