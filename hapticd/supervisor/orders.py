"""What may be asked of a running daemon over its control socket, and what is done about it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from hapticd.contracts.event import EventCode
from hapticd.supervisor.commands import Reply
from hapticd.supervisor.requests import Answer

if TYPE_CHECKING:
    from hapticd.supervisor.service import Service

KNOWN = ("status", "arm", "disarm", "calibrate", "tare", "clear", "reload", "stop")
"""What the control socket understands."""


class Orders:
    """Obeys the control socket.

    Args:
        service: the daemon that it is for.
    """

    def __init__(self, service: Service) -> None:
        self._service = service

    def turn(self) -> None:
        """Do what has been asked for, or pass it on to the loop, whose answer comes later."""
        service = self._service
        for request, reply in service.commands.receive():
            match request["do"]:
                case "status":
                    reply(True, status=service.report.status.as_map())
                case "arm" | "disarm" | "calibrate" | "tare" | "clear" as do if service.recovery.lost:
                    self._without_device(do, reply)
                case "disarm":
                    service.requests.disarm(_answering(reply))
                case "arm" | "calibrate" | "tare" | "clear" as do:
                    service.requests.submit({"do": do}, _answering(reply))
                case "reload" if request.get("wait"):
                    service.reload.ask(_answering(reply))
                case "reload":
                    reply(True)
                    service.reload.ask()
                case "stop":
                    service.stop("asked over the control socket")
                    reply(True)
                case other:
                    reply(False, f"cannot do {other[:40]!r}; known: {', '.join(KNOWN)}")

    def _without_device(self, do: str, reply: Reply) -> None:
        """What can be done while the device is away is said to the loop that will find it again."""
        service = self._service
        recovery = service.recovery
        match do:
            case "arm" | "calibrate" | "tare":
                reply(False, f"there is no device to {do}: {recovery.why}")
            case "disarm":
                recovery.amend(replace(recovery.before, may_arm=False))
                service.tell_now(EventCode.DISARMED, "the device stays disarmed when it is back")
                reply(True)
            case _:
                recovery.amend(replace(recovery.before, latched=False))
                service.tell_now(EventCode.CLEARED, "fault cleared")
                reply(True)


def _answering(reply: Reply) -> Answer:
    return lambda verdict: reply(not verdict, verdict)
