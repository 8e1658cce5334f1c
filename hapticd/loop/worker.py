"""A thread for what would hold the loop up: it is there before the first tick, and right below the loop in priority."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable


class Worker:
    """One thread that waits for work, and does it beside the loop.

    To start a thread when it is needed takes milliseconds where memory is locked, since its whole stack is made at
    once. A busy computer would keep an ordinary thread from its work, and the loop with it whenever that thread holds
    the interpreter; and one of the loop's own priority would keep the loop from its processor.
    """

    def __init__(self) -> None:
        self._work: Callable[[], None] | None = None
        self._ending = False
        self._started = False
        self._gate = threading.Lock()  # open while there is something to do
        self._gate.acquire()

    def start(self) -> None:
        """Have the thread wait; called by the loop's thread, once that is scheduled as it will be.

        It begins as an ordinary thread and is waited for, which takes its time on a busy computer. A second call does
        nothing.
        """
        if self._started:
            return
        self._started = True
        thread = threading.Thread(target=self._run, name="beside-the-loop", daemon=True)
        thread.start()
        priority = os.sched_getparam(0).sched_priority - 1
        if priority > 0 and thread.native_id is not None:  # else the loop is not real-time, or has no room below it
            with contextlib.suppress(OSError):
                os.sched_setscheduler(thread.native_id, os.sched_getscheduler(0), os.sched_param(priority))

    def do(self, work: Callable[[], None]) -> None:
        """Have something done; returns at once. What was asked for before has to be done by then.

        Args:
            work: may not raise.
        """
        self._work = work
        self._gate.release()

    def end(self) -> None:
        """Let the thread end, once it has done what was asked for."""
        self._ending = True
        if self._gate.locked():
            self._gate.release()

    def _run(self) -> None:
        while not self._ending:
            self._gate.acquire()
            work, self._work = self._work, None
            if work is not None:
                work()
            del work  # what it has raised is not kept
