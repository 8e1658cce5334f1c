"""Requests to the loop, one at a time and in order, since it has room for one. Disarming waits behind none."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any

from hapticd.errors import HapticdError
from hapticd.loop.memory import (
    ANSWERED,
    ANSWERED_AT,
    DISARM,
    DISARMED,
    DISARMED_SINCE,
    RECORDS,
    REQUESTS,
    SharedMemory,
)
from hapticd.tick.flags import Flag

MOST_WAITING = 100

EXPIRED = "not done, and it will not be: the loop was busy until the time for it had passed; ask again"
"""The answer to a request whose deadline has come while it waited."""

ARMED_SINCE = "it was disarmed, and somebody has armed it again since"
"""The answer to who waits for a device to let go that is armed again by then."""

Answer = Callable[[str], None]
"""Called with "" when the loop has done it, else with why not."""


class RequestQueue:
    """The queue of requests to a loop.

    Args:
        shared: the memory shared with the loop.
    """

    def __init__(self, shared: SharedMemory) -> None:
        self._shared = shared
        self._waiting: deque[_Waiting] = deque()
        self._posted: Answer | None = None
        self._calibrating = False
        self._disarming: deque[tuple[int, Answer, bool]] = deque()  # each by the number of its request
        self._disarmed: deque[tuple[int, Answer, bool]] = deque()  # each by the record that was the newest then
        self._letting_go: list[Answer] = []  # until the device has let go
        self._let_go_by = inf  # the record after which it has: the first one that was seen without a force
        self._held: list[Answer] = []  # to disarm or stop, until it is known what became of the force

    @property
    def disarming(self) -> bool:
        """Whether somebody has asked to disarm and has no answer yet."""
        return bool(self._disarming or self._disarmed or self._letting_go)

    def submit(self, request: dict[str, Any], answer: Answer, by_ns: int | None = None) -> None:
        """Queue a request; its answer comes from a later `turn`.

        During a calibration, which takes as long as it takes, all are refused: who has given up waiting is not to find
        the device armed afterwards.

        Args:
            request: for the loop.
            answer: called with what came of it.
            by_ns: on CLOCK_MONOTONIC, when it is too late for the loop to begin with it [ns]; None: never.
        """
        if self._calibrating:
            answer("the device is calibrating: wait, or call it off with `hapticd disarm`")
        elif len(self._waiting) >= MOST_WAITING:
            answer("too many requests are waiting for the loop; try again")
        else:
            self._waiting.append(_Waiting(request, answer, by_ns))

    def disarm(self, answer: Answer, *, wait: bool = False) -> None:
        """Have the loop let go at its next tick; a calibration is called off, and what was to arm later does not.

        Args:
            answer: called once that has begun.
            wait: once the device has let go instead.
        """
        self._shared.words[DISARM] += 1
        self._disarming.append((self._shared.words[DISARM], answer, wait))
        waiting, self._waiting = self._waiting, deque()
        for one in waiting:
            if one.request["do"] in ("arm", "calibrate"):
                one.answer(DISARMED_SINCE)
            else:
                self._waiting.append(one)

    def turn(self, fetched: int, flags: int = 0) -> None:
        """Hand out the answers that have come, and send the next request.

        An answer waits for the first record after it, so that the asker finds what was done in the status.

        Args:
            fetched: tick records of this loop that were fetched so far.
            flags: of the newest of them.
        """
        words = self._shared.words
        self._drop_expired(time.monotonic_ns())
        while self._disarmed and fetched > self._disarmed[0][0]:
            _, asker, waits = self._disarmed.popleft()
            if waits:
                if not self._letting_go:  # later askers must not delay earlier ones
                    self._let_go_by = inf
                self._letting_go.append(asker)
            else:
                asker("")
        while self._disarming and self._disarming[0][0] <= words[DISARMED]:
            self._disarmed.append((words[RECORDS], *self._disarming.popleft()[1:]))
        if self._letting_go:
            self._turn_letting_go(fetched, flags)
        if self._posted is not None:
            if words[ANSWERED] != words[REQUESTS] or fetched <= words[ANSWERED_AT]:
                return
            answer, self._posted = self._posted, None
            self._calibrating = False
            answer(self._shared.verdict())
        if self._waiting:
            first = self._waiting.popleft()
            try:
                self._shared.post(first.request)
            except HapticdError as error:
                first.answer(str(error))
            else:
                self._posted = first.answer
                if first.request["do"] == "calibrate":
                    self._calibrating = True
                    waiting, self._waiting = self._waiting, deque()
                    for other in waiting:
                        self.submit(other.request, other.answer)

    def _turn_letting_go(self, fetched: int, flags: int) -> None:
        """Answer with the record after the first without a force: the loop disables the device between the two."""
        self._let_go_by = inf if flags & Flag.RELEASING else min(self._let_go_by, fetched)
        if flags & Flag.ARMED or fetched > self._let_go_by:
            askers, self._letting_go = self._letting_go, []
            for asker in askers:
                asker(ARMED_SINCE if flags & Flag.ARMED else "")

    def abandon(self, why: str, force_left: str | None = "") -> None:
        """Answer all that wait: the loop is gone; who asked to disarm or stop asks for its force, and hears of that.

        Args:
            why: the answer to all others.
            force_left: why the force may still be there; "" when it is gone, None: to be told by `settle`.
        """
        self._held += [answer for _, answer, _ in (*self._disarmed, *self._disarming)] + self._letting_go
        answers = [one.answer for one in self._waiting]
        if self._posted is not None:
            if self._shared.words[ANSWERED] == self._shared.words[REQUESTS]:
                self._posted(self._shared.verdict())
            else:
                answers.insert(0, self._posted)
        self._posted = None
        self._calibrating = False
        self._disarmed.clear()
        self._disarming.clear()
        self._letting_go = []
        self._waiting.clear()
        for answer in answers:
            answer(why)
        if force_left is not None:
            self.settle(force_left)

    def hold(self, answer: Answer) -> None:
        """Have somebody wait for `settle`: who asks to stop, or to disarm while the loop is gone already."""
        self._held.append(answer)

    def settle(self, force_left: str) -> None:
        """Answer those who asked to disarm or stop: what became of the force of a loop that is gone is known.

        Args:
            force_left: why it may still be there; "" when it is gone.
        """
        held, self._held = self._held, []
        for answer in held:
            answer(f"the force may still be there: {force_left}; switch the device off" if force_left else "")

    def _drop_expired(self, now_ns: int) -> None:
        """Answer what has waited for too long, at once: who asked is about to stop listening."""
        if any(one.expired(now_ns) for one in self._waiting):
            waiting, self._waiting = self._waiting, deque()
            for one in waiting:
                if one.expired(now_ns):
                    one.answer(EXPIRED)
                else:
                    self._waiting.append(one)


@dataclass(frozen=True, slots=True)
class _Waiting:
    request: dict[str, Any]
    answer: Answer
    by_ns: int | None

    def expired(self, now_ns: int) -> bool:
        return self.by_ns is not None and now_ns >= self.by_ns
