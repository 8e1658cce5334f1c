"""What may be asked of a running daemon over its control socket, and what is done about it."""

from __future__ import annotations

import time
from dataclasses import asdict, replace
from typing import Any

from hapticd.faults.record import machine
from hapticd.supervisor.commands import Reply
from hapticd.supervisor.events import log
from hapticd.supervisor.request_queue import Answer
from hapticd.supervisor.state import DaemonState
from hapticd.tick.event import EventCode, marker_problem

KNOWN = ("status", "receipt", "arm", "disarm", "calibrate", "tare", "clear", "mark", "reload", "stop")
"""What the control socket understands."""

PATIENCE_NS = 5_000_000_000
"""How long a request may wait for the loop when it does not say until when [ns]."""


class CommandHandler:
    """Obeys the control socket.

    Args:
        state: the daemon.
    """

    def __init__(self, state: DaemonState) -> None:
        self._state = state

    def turn(self) -> None:
        """Do what has been asked for, or pass it on to the loop, whose answer comes later."""
        state = self._state
        if state.recovery.lost:
            self._settle()
        for request, reply, who in state.commands.receive():
            if request["do"] in KNOWN[2:]:
                log.info("%s: asked by %s", request["do"], who)
            match request["do"]:
                case "status":
                    reply(True, status=self._status(), clock_ns=time.monotonic_ns())
                case "receipt":
                    reply(True, receipt=self._receipt())
                case "mark":
                    self._mark(request.get("text"), reply)
                case "disarm":
                    self.disarm(_answering(reply), wait=bool(request.get("wait")))
                case "arm" | "calibrate" | "tare" | "clear" as do if state.recovery.lost:
                    self._without_device(do, reply)
                case "arm" | "calibrate" | "tare" | "clear" as do:
                    state.requests.submit({"do": do}, _answering(reply), _deadline_ns(request))
                case "reload" if request.get("wait"):
                    state.ask_reload(_answering(reply))
                case "reload":
                    reply(True)
                    state.ask_reload()
                case "stop":
                    state.stop_reason = state.stop_reason or "asked over the control socket"
                    state.requests.hold(_answering(reply))  # until it is known what became of the force
                case other:
                    reply(False, f"cannot do {other[:40]!r}; known: {', '.join(KNOWN)}")

    def end(self, force_left: str) -> None:
        """Answer all that wait, and what has come meanwhile: the loop has ended.

        Args:
            force_left: why the force may still be there; "" when it is gone.
        """
        self.turn()
        self._state.requests.abandon("the daemon has stopped", force_left)

    def disarm(self, answer: Answer | None = None, *, wait: bool = False) -> None:
        """Have the loop let go; without a device see that the next one is not armed by itself.

        Who asks then hears of it once the force of the lost device has been looked after: it may only be silent.
        """
        state = self._state
        answer = answer or _unanswered
        if not state.recovery.lost:
            state.requests.disarm(answer, wait=wait)
            state.arm_hold.keep(state.loop)  # now: as the daemon ends, no turn does it
            return
        state.recovery.amend(replace(state.recovery.resume, may_arm=False))
        state.arm_hold.keep(state.loop)
        state.tell(EventCode.DISARMED, "the device stays disarmed when it is back")
        state.requests.hold(answer)
        self._settle()  # at once where that can be: by the next turn there may be another loop, with a queue of its own

    def _settle(self) -> None:
        if self._state.loop.force_seen_to:
            self._state.requests.settle(self._state.release.force_left)

    def _status(self) -> dict[str, Any]:
        return self._state.publisher.completed(self._state.status.made.as_map())

    def _receipt(self) -> dict[str, Any]:
        """What a recording of this daemon says of itself: status, the whole configuration, the computer."""
        state = self._state
        return {
            **self._status(),
            "config_hash": state.config.hash,
            "config_text": state.config.text,
            "device_info": asdict(state.loop.info),
            **machine(),
        }

    def _mark(self, text: object, reply: Reply) -> None:
        problem = marker_problem(text)
        if not problem:
            self._state.tell(EventCode.MARKED, str(text))
        reply(not problem, problem)

    def _without_device(self, do: str, reply: Reply) -> None:
        """What can be done while the device is away is said to the loop that will find it again."""
        state = self._state
        recovery = state.recovery
        match do:
            case "arm" | "calibrate" | "tare":
                reply(False, f"there is no device to {do}: {recovery.why}")
            case _:
                recovery.amend(replace(recovery.resume, latched=False))
                recovery.hurry()
                state.tell(EventCode.CLEARED, "fault cleared")
                reply(True)


def _deadline_ns(request: dict[str, Any]) -> int:
    """Until when the loop may begin with a request: as it says itself, and no later than is usual."""
    usual_ns = time.monotonic_ns() + PATIENCE_NS
    by_ns = request.get("by_ns")
    return min(by_ns, usual_ns) if isinstance(by_ns, int) else usual_ns


def _unanswered(_verdict: str) -> None:
    """For one who does not wait: the event log has the verdict."""


def _answering(reply: Reply) -> Answer:
    return lambda verdict: reply(not verdict, verdict)
