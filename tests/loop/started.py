"""A loop with a clock and a device of the test's, from its start to its end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from hapticd.config.loading import parse
from hapticd.device import DeviceInfo, Sample
from hapticd.driver import Driver, DriverOptions
from hapticd.errors import DriverError
from hapticd.loop.loop import ControlLoop
from hapticd.loop.memory import SKIPPED, EventReader, SharedMemory
from hapticd.tick.assemble import make_tick
from hapticd.tick.event import LoopEvent
from hapticd.tick.record import RecordLayout
from tests.loop.clock import Clock
from tests.tick.rig import device

WALL = "[[scene.walls]]\nstiffness_n_per_m = 1000.0\n"


class AtRest(Driver[DriverOptions]):
    """A device that stands still.

    Args:
        declared: what it says of itself.

    Attributes:
        sample: what it says.
        before_read: done at each read.
        on_disable: done as it lets go.
        refusal: why it lets no forces through, if it does not.
    """

    def __init__(self, **declared: Any) -> None:
        super().__init__(DriverOptions(), 1e-3)
        self._declared = declared
        self.sample = Sample(1)
        self.before_read: Callable[[], None] = lambda: None
        self.on_disable: Callable[[], None] = lambda: None
        self.refusal: DriverError | None = None

    def _open(self) -> DeviceInfo:
        return device(**self._declared)

    def _enable(self) -> None:
        if self.refusal is not None:
            raise self.refusal

    def _read(self) -> Sample:
        self.before_read()
        return self.sample

    def _write(self, force_n: Sequence[float]) -> None: ...

    def _disable(self) -> None:
        self.on_disable()

    def _close(self) -> None: ...


class Started:
    """A loop that runs where it is told to.

    Args:
        clock: its clock.
        auto_arm: whether it arms by itself.
        text: its configuration.
        declared: what its device says of itself.

    Attributes:
        config: the configuration.
        told: the events of the run, once it has ended.
        skipped: deadlines that were missed until then.
        tick_number: of the tick that is next.
    """

    def __init__(self, clock: Clock, auto_arm: bool = True, text: str = WALL, **declared: Any) -> None:
        self.clock = clock
        self.driver = AtRest(**declared)
        self.shared = SharedMemory(RecordLayout(1, False, 8), 1000.0)
        self.config = parse(text, "started")
        self.tick = make_tick(self.config, self.driver.open())
        settings = self.config.config
        self.loop = ControlLoop(
            self.driver, self.tick, self.shared, settings.loop, settings.safety, auto_arm, self._sleep_until
        )
        self.told: list[LoopEvent] = []
        self.skipped = 0
        self.tick_number = 0
        self._each_tick: Callable[[int], None] = lambda _number: None
        self._ticks = 0

    def run(self, each_tick: Callable[[int], None], ticks: int) -> None:
        """Tick so often, and end; `each_tick` is told the number of the one to come."""
        self._each_tick, self._ticks = each_tick, ticks
        events = EventReader(self.shared)
        try:
            self.loop.run()
        finally:
            self.told = events.read()
            self.skipped = self.shared.words[SKIPPED]
            self.shared.close()

    def _sleep_until(self, deadline_ns: int) -> int:
        self._each_tick(self.tick_number)
        self.tick_number += 1
        self.loop.session.stop_requested = self.tick_number > self._ticks
        return self.clock.sleep_until(deadline_ns)
