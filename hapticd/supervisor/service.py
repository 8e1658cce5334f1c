"""The daemon: what `hapticd run` does until it is told to stop."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import time
from typing import Any

import hapticd
from hapticd.config.loading import LoadedConfig, load
from hapticd.contracts.errors import HapticdError
from hapticd.contracts.event import Event, EventCode
from hapticd.contracts.record import Flag, TickRecord
from hapticd.control.shared import SKIPPED
from hapticd.supervisor.commands import CommandSocket, Reply
from hapticd.supervisor.controlled import Control
from hapticd.supervisor.instance import InstanceLock
from hapticd.supervisor.notify import Notifier
from hapticd.supervisor.release import release_device
from hapticd.supervisor.requests import Answer, Requests
from hapticd.telemetry.endpoint import CONTROL, TELEMETRY
from hapticd.telemetry.publisher import Publisher
from hapticd.telemetry.status import LateHistogram, Status
from hapticd.telemetry.wire import measure_epoch_offset_ns

DRAIN_S = 0.01
"""How often tick records are fetched and published [s]."""

STATUS_S = 1.0
STOP_TIMEOUT_S = 3.0

KNOWN = ("status", "arm", "disarm", "clear", "reload", "stop")
"""What the control socket understands."""

log = logging.getLogger("hapticd")


def _nobody(_verdict: str) -> None:
    """Answer to a request that nobody waits for."""


def _answering(reply: Reply) -> Answer:
    return lambda verdict: reply(not verdict, verdict)


class Service:
    """One running daemon.

    Args:
        config: what to run.
        instance: name of the instance, which is also that of its runtime directory.

    Raises:
        HapticdError: it cannot start; nothing is left behind.
    """

    def __init__(self, config: LoadedConfig, instance: str) -> None:
        self.config = config
        self.instance = instance
        self.notifier = Notifier()
        with contextlib.ExitStack() as undo:
            self.lock = InstanceLock(instance)
            undo.callback(self.lock.close)
            self.control = Control(config)
            undo.callback(self.control.close)
            undo.callback(self.control.end)
            self.publisher = Publisher(
                config.config.telemetry,
                self.lock.directory / TELEMETRY,
                self.control.info,
                measure_epoch_offset_ns(),
            )
            undo.callback(self.publisher.close)
            self.commands = CommandSocket(self.lock.directory / CONTROL)
            undo.callback(self.commands.close)
            self._undo = undo.pop_all()
        self.requests = Requests(self.control.shared)
        self.exit_code: int | None = None
        self._late = LateHistogram()
        self._busy_max_us = 0.0
        self._ticks = 0
        self._last: TickRecord | None = None
        self._events_seen = 0
        self._dropped_told = 0
        self._status_due_s = 0.0
        self._rate_from = (time.monotonic(), 0)
        self._rate_hz = 0.0
        self._fed_s = 0.0
        self._stopping = False
        self._stop_by_s = 0.0
        self._status = Status()

    def run(self) -> int:
        """Serve until told to stop; returns the exit code."""
        try:
            return asyncio.run(self._serve())
        finally:
            self._undo.close()

    async def _serve(self) -> int:
        loop = asyncio.get_running_loop()
        loop.add_signal_handler(signal.SIGTERM, self._stop, "SIGTERM")
        loop.add_signal_handler(signal.SIGINT, self._stop, "interrupt")
        loop.add_signal_handler(signal.SIGHUP, self.reload, _nobody)
        settings = self.config.config
        log.info(
            "%s: %s on %s at %g Hz, law %s, publishing on %s",
            self.instance,
            self.control.info.model,
            settings.device.driver,
            settings.loop.rate_hz,
            settings.controller.law,
            " and ".join(self.publisher.endpoints) or "nothing",
        )
        for warning in self.control.warnings:
            log.warning("%s", warning)
        while self.exit_code is None:
            self._turn()
            await asyncio.sleep(DRAIN_S)
        return self.exit_code

    def _turn(self) -> None:
        """One round: show that we live, fetch and publish, look after the loop."""
        now_s = time.monotonic()
        self.control.beat()
        self._publish()
        self._obey()
        self.requests.turn()
        if self.control.exit_code is not None:
            self._control_ended()
        elif self.control.stalled():
            self._control_lost(f"the control loop stood still for more than {self.control.stall_s:g} s")
        elif self._stopping and now_s > self._stop_by_s:
            self._control_lost(f"the control loop did not stop within {STOP_TIMEOUT_S:g} s")
        if now_s >= self._status_due_s and self.exit_code is None:
            self._status_due_s = now_s + STATUS_S
            self._publish_status(now_s)

    def _publish(self) -> None:
        before = self._last
        records = self.control.reader.read()
        for record in records:
            self._late.add(record.late_us)
            if record.busy_us > self._busy_max_us:
                self._busy_max_us = record.busy_us
        if records:
            self._ticks += len(records)
            if before is None:
                self.notifier.send("READY=1")
            self._last = records[-1]
            self._feed_watchdog()
            if before is None or before.flags & ~Flag.LIMITED != self._last.flags & ~Flag.LIMITED:
                self._status_due_s = 0.0
        self.publisher.publish(records)
        self.publisher.flush(time.monotonic_ns())
        for event in self.control.shared.read_events(self._events_seen):
            self._events_seen += 1
            self._tell(event)
        dropped = self.control.reader.dropped
        if dropped > self._dropped_told:
            lost, self._dropped_told = dropped - self._dropped_told, dropped
            self._tell_now(EventCode.RING_DROPPED, f"{lost} ticks were overwritten before they were published")

    def _feed_watchdog(self) -> None:
        """Tell systemd that ticks advance, at half the interval that it asks for."""
        now_s = time.monotonic()
        if self.notifier.watchdog_s and now_s - self._fed_s > 0.5 * self.notifier.watchdog_s - DRAIN_S:
            self._fed_s = now_s
            self.notifier.send("WATCHDOG=1")

    def _tell(self, event: Event) -> None:
        level = logging.ERROR if 200 <= event.code < 300 else logging.WARNING if event.code >= 300 else logging.INFO
        log.log(level, "%s", event.text, extra={"code": event.code, "tick": event.seq})
        self.publisher.event(event)
        self._status_due_s = 0.0

    def _tell_now(self, code: EventCode, text: str, **fields: float | int | str) -> None:
        seq = self._last.seq if self._last else 0
        self._tell(Event(code, text, seq, time.monotonic_ns(), fields))

    def _stop(self, why: str) -> None:
        """Let the loop ramp the force out and end."""
        if self._stopping:
            return
        self._stopping = True
        self._stop_by_s = time.monotonic() + STOP_TIMEOUT_S
        self.notifier.send("STOPPING=1")
        self._tell_now(EventCode.STOPPING, f"{why}: ramping the force out")
        with contextlib.suppress(ProcessLookupError):
            self.control.process.send_signal(signal.SIGTERM)

    def _control_ended(self) -> None:
        self._publish()
        if self._stopping and self.control.exit_code == 0:
            log.info("stopped")
            self.exit_code = 0
            return
        code = self.control.exit_code
        how = f"was killed by signal {-code}" if code and code < 0 else f"ended with exit code {code}"
        self._control_lost(f"the control process {how}")

    def _control_lost(self, text: str) -> None:
        """The loop no longer looks after the device: take the force away from outside, and end."""
        self.control.kill()
        outcome = release_device(self.config)
        self._tell_now(EventCode.CONTROL_LOST, f"{text}; {outcome}")
        self.exit_code = 1

    def _obey(self) -> None:
        """Do what the control socket asks for."""
        for request, reply in self.commands.receive():
            match request["do"]:
                case "status":
                    reply(True, status=self._status.as_map())
                case "arm" | "disarm" | "clear" as do:
                    self.requests.submit({"do": do}, _answering(reply))
                case "reload" if request.get("wait"):
                    self.reload(_answering(reply))
                case "reload":
                    reply(True)
                    self.reload(_nobody)
                case "stop":
                    self._stop("asked over the control socket")
                    reply(True)
                case other:
                    reply(False, f"cannot do {other[:40]!r}; known: {', '.join(KNOWN)}")

    def reload(self, answer: Answer) -> None:
        """Read the configuration file again and hand law, scene and limits to the loop; a bad file changes nothing.

        Args:
            answer: told "" when the new configuration is in force, else why it is not.
        """
        self.notifier.send("RELOADING=1", f"MONOTONIC_USEC={time.monotonic_ns() // 1000}")
        try:
            wanted = load(self.config.path)
            self._check_reloadable(wanted)
        except HapticdError as error:
            self._refuse(str(error), answer)
            return

        def finish(verdict: str) -> None:
            if verdict:
                self._refuse(f"{wanted.path}: {verdict}", answer)
                return
            self.config = wanted
            self.publisher.reconfigure(wanted.config.telemetry)
            self.notifier.send("READY=1")
            self._status_due_s = 0.0
            answer("")

        self.requests.submit(self._switch_letter(wanted), finish)

    def _refuse(self, why: str, answer: Answer) -> None:
        self._tell_now(EventCode.REFUSED, f"configuration refused, nothing changed: {why}")
        self.notifier.send("READY=1")
        answer(why)

    def _check_reloadable(self, wanted: LoadedConfig) -> None:
        """Refuse what only a restart can change.

        Raises:
            HapticdError: names the tables.
        """
        old, new = self.config.config, wanted.config
        fixed = [name for name in ("loop", "device", "velocity") if getattr(old, name) != getattr(new, name)]
        endpoints = [(table.ipc, table.tcp, table.send_high_water) for table in (old.telemetry, new.telemetry)]
        if endpoints[0] != endpoints[1]:
            fixed.append("telemetry endpoints")
        if fixed:
            raise HapticdError(f"{wanted.path}: [{'], ['.join(fixed)}] changed: that needs a restart")

    def _switch_letter(self, wanted: LoadedConfig) -> dict[str, Any]:
        settings = wanted.config
        return {
            "do": "switch",
            "law": settings.controller.law,
            "params": wanted.params.model_dump(),
            "scene": settings.scene.model_dump(),
            "safety": settings.safety.model_dump(),
            "keep_law": settings.controller == self.config.config.controller,
            "was": self.config.config.controller.law,
            "config": wanted.hash,
        }

    def _publish_status(self, now_s: float) -> None:
        since_s, since_ticks = self._rate_from
        if now_s - since_s >= 0.5:
            self._rate_hz = (self._ticks - since_ticks) / (now_s - since_s)
            self._rate_from = (now_s, self._ticks)
        settings = self.config.config
        info = self.control.info
        last = self._last
        flags = last.flags if last else 0
        limit_n = settings.safety.max_force_n or info.max_force_n
        lifted = settings.safety.profile == "simulation" or limit_n == float("inf")
        self._status = status = Status(
            version=hapticd.__version__,
            instance=self.instance,
            rate_hz=settings.loop.rate_hz,
            measured_rate_hz=self._rate_hz,
            ticks=self._ticks,
            overruns=self.control.shared.words[SKIPPED],
            late_histogram=tuple(self._late.counts),
            late_max_us=self._late.max_us,
            busy_max_us=self._busy_max_us,
            ring_drops=self.control.reader.dropped,
            armed=bool(flags & Flag.ARMED),
            fallback=bool(flags & Flag.FALLBACK),
            releasing=bool(flags & Flag.RELEASING),
            latched=bool(flags & Flag.LATCHED),
            law=settings.controller.law,
            law_index=last.law if last else 0,
            driver=settings.device.driver,
            device=info.model,
            serial=info.serial,
            simulated=info.simulated,
            axes=info.axes,
            max_force_n=0.0 if lifted else limit_n,
            wall_axis=tuple(wall.axis for wall in settings.scene.walls),
            wall_position_m=tuple(wall.position_m for wall in settings.scene.walls),
            wall_stiffness_n_per_m=tuple(wall.stiffness_n_per_m for wall in settings.scene.walls),
            config_file=str(self.config.path),
            config_hash=self.config.hash,
            realtime=self.control.realtime,
            warnings=tuple(self.control.warnings),
        )
        self.publisher.status(status.as_map())
        self.notifier.send(f"STATUS={self._rate_hz:.0f} Hz, law {settings.controller.law}")
