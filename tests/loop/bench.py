"""A control loop on a bench, without its clock: requests are worked off as between the ticks of a running one."""

from __future__ import annotations

from typing import Any

from hapticd import plugins
from hapticd.config.loading import LoadedConfig
from hapticd.driver import DriverState
from hapticd.loop.loop import ControlLoop
from hapticd.loop.memory import ANSWERED, DISARM, DISARMED, REQUESTS, EventReader, SharedMemory
from hapticd.tick.assemble import make_tick
from hapticd.tick.event import LoopEvent
from hapticd.tick.guard import Mode
from hapticd.tick.record import RecordLayout
from hapticd.tick.tick import ControlTick

PERIOD_S = 1e-3


class Bench:
    """A loop that ticks when it is told to, disarmed at first."""

    def __init__(self, start: LoadedConfig) -> None:
        self.driver = start.driver(start.options, PERIOD_S)
        info = self.driver.open()
        self.shared = SharedMemory(RecordLayout(1, False, 8), 1000.0)
        self.tick = make_tick(start, info)
        settings = start.config
        self.loop = ControlLoop(
            self.driver, self.tick, self.shared, settings.loop, settings.safety, False, lambda deadline_ns: deadline_ns
        )
        for name in plugins.names(plugins.CONTROLLERS):
            self.loop.requests.know(name, plugins.law(name))
        self.loop.requests.worker.start()
        self.tick.start(self.driver.read())
        self.events = EventReader(self.shared)

    def ticks(self, count: int) -> ControlTick:
        """The tick, so many of them later."""
        for _ in range(count):
            force_n = self.tick.advance(self.driver.read(), PERIOD_S)
            if self.tick.guard.mode is not Mode.DISARMED:
                self.driver.write(force_n)
            elif self.driver.state is DriverState.ENABLED:
                self.driver.disable()
        return self.tick

    def ask(self, **request: Any) -> str:
        """The verdict, once the request is worked off, a slice a tick."""
        if request["do"] == "disarm":
            self.shared.words[DISARM] += 1
            self.loop.session.disarm()
            return "" if self.shared.words[DISARMED] == self.shared.words[DISARM] else "still armed"
        self.shared.post(request)
        while not self.answered:
            self.ticks(1)
            self.loop.requests.work()
        return self.shared.verdict()

    @property
    def answered(self) -> bool:
        """Whether no request waits for its verdict."""
        return self.shared.words[REQUESTS] == self.shared.words[ANSWERED]

    def close(self) -> None:
        self.loop.requests.worker.end()
        self.driver.close()
        self.shared.close()

    def told(self) -> dict[int, LoopEvent]:
        return {event.code: event for event in self.events.read()}
