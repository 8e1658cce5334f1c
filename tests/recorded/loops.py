"""A loop that runs from its start to its end, with a clock and a device of the test's, and all that it tells."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import pytest

from hapticd import plugins
from hapticd.config.loading import parse
from hapticd.device import DeviceInfo, Sample
from hapticd.driver import Driver, DriverOptions
from hapticd.errors import DriverError
from hapticd.loop.loop import ControlLoop
from hapticd.loop.memory import (
    ANSWERED,
    DISARM,
    REQUESTS,
    SKIPPED,
    SUPERVISOR_BEAT,
    EventReader,
    RecordReader,
    SharedMemory,
)
from hapticd.loop.remote_slots import SlotWriter
from hapticd.loop.resume import FROM_START, ResumeState, left_by
from hapticd.supervisor.reload import switch_request
from hapticd.tick.assemble import make_tick
from hapticd.tick.contact import Contact
from hapticd.tick.record import RecordLayout
from hapticd.tick.remote.update import Update
from hapticd.trace import DriverTrace, lines
from tests.loop.clock import Clock
from tests.recorded.hand import Hand
from tests.recorded.journal import Journal
from tests.tick.rig import device

Act = Callable[["Loop"], Any]


@dataclass(frozen=True)
class Script:
    """What happens in a run.

    Attributes:
        text: its configuration.
        axes: of the device.
        ticks: how many.
        acts: what is done right before a tick.
        declared: what the device says of itself, beside its axes.
        seed: of the hand.
        reach_m: of the hand.
        resume: where the loop goes on from.
        auto_arm: whether it arms by itself.
        each_tick: done before every tick.
    """

    text: str
    axes: str = "z"
    ticks: int = 1000
    acts: Mapping[int, Act] | None = None
    declared: Mapping[str, Any] | None = None
    seed: int = 1
    reach_m: float = 0.01
    resume: ResumeState = FROM_START
    auto_arm: bool = True
    each_tick: Act = lambda _loop: None


class Scripted(Driver[DriverOptions]):
    """A device that a hand moves, whatever force it is given; what befalls it is set from outside.

    Attributes:
        read_s: how long a read takes [s].
        stale: whether it has nothing new.
        sample: what it says.
        befall: raised by the next read or write, by name.
        moves: whether the hand goes on.
    """

    def __init__(self, clock: Clock, journal: Journal, hand: Hand, info: DeviceInfo) -> None:
        super().__init__(DriverOptions(), 1e-3)
        self.trace = DriverTrace(8)
        self.metrics[0] = 0.25
        self.read_s = 0.1e-3
        self.stale = False
        self.sample = Sample(len(info.axes))
        self.befall: dict[str, Exception] = {}
        self.moves = True
        self.off_m = 0.0
        self._clock, self._journal, self._hand, self._declared = clock, journal, hand, info

    def _open(self) -> DeviceInfo:
        return self._declared

    def _enable(self) -> None:
        self._happens("enable")

    def _read(self) -> Sample:
        self._clock.pass_s(self.read_s)
        self._happens("read", False)
        sample = self.sample
        if not self.stale:
            if self.moves:
                sample.position_m[:] = [at + self.off_m for at in self._hand.go()]
                sample.velocity_m_per_s[:] = self._hand.velocity_m_per_s
            sample.time_ns = self._clock.now_ns
            sample.sequence += 1
        return sample

    def _write(self, force_n: Sequence[float]) -> None:
        self._happens("write", False)
        self._journal.note("written_n", list(force_n))
        self._journal.note("written after s", self._clock.now_s - 1.0)

    def _disable(self) -> None:
        self._happens("disable")

    def _calibrate(self) -> None:
        self._happens("calibrate")

    def _close(self) -> None:
        self._happens("close")

    def _happens(self, what: str, tell: bool = True) -> None:
        if tell:
            self._journal.say(what)
            self.trace.keep(what)
            self.metrics[1] += 1.0
        if what in self.befall:
            raise self.befall.pop(what)


class Loop:
    """A run of a script: what its acts use."""

    def __init__(self, script: Script, patch: pytest.MonkeyPatch) -> None:
        self.clock = Clock(patch)
        self.clock.computed_ns = 0
        self.journal = Journal()
        self.config = parse(script.text, "recorded")
        info = device(script.axes, **(script.declared or {}))
        hand = Hand(script.seed, len(script.axes), script.reach_m)
        self.driver = Scripted(self.clock, self.journal, hand, info)
        self.shared = SharedMemory(RecordLayout(len(script.axes), False, 8), 1000.0)
        self.tick = make_tick(self.config, self.driver.open())
        settings = self.config.config
        self.loop = ControlLoop(
            self.driver,
            self.tick,
            self.shared,
            settings.loop,
            settings.safety,
            script.auto_arm,
            self._sleep_until,
            script.resume,
        )
        for name in plugins.names(plugins.CONTROLLERS):
            self.loop.requests.know(name, plugins.law(name))
        patch.setattr(self.loop.requests.worker, "do", lambda work: work())
        self.beats = True
        self.computes_s = 20e-6
        self._have_laws_compute(patch)
        self._script = script
        self._number = 0
        self._acts = dict(script.acts or {})
        self._asked = False
        self._records = RecordReader(self.shared)
        self._events = EventReader(self.shared)

    def run(self) -> Journal:
        """From start to end."""
        try:
            self.loop.run()
        except DriverError as error:
            self.journal.say(f"ended: {type(error).__name__}: {error}")
        self._hear()
        self.journal.say(f"left: {left_by(self.shared, self.driver._info or device())}")
        self.journal.say(f"metrics: {list(self.shared.metrics[:3])}")
        self.journal.say(f"trace: {[line.partition(' ')[2] for line in lines(self.shared.trace)]}")
        self.shared.close()
        return self.journal

    def ask(self, **request: Any) -> None:
        """Post a request; its answer is written down."""
        self._asked = True
        self.shared.post(request)

    def disarm(self) -> None:
        """Ask to let go."""
        self.shared.words[DISARM] += 1

    def switch(self, text: str, **other: Any) -> None:
        """Ask for another configuration."""
        wanted = parse(text, "another")
        self.ask(**{**switch_request(self.config, wanted), "config": "another", **other})
        self.config = wanted

    def say(self, port: int, **said: Any) -> None:
        """Be a client that says something of a port."""
        update = Update()
        for name, value in said.items():
            if isinstance(value, list):
                getattr(update, name)[:] = value
            else:
                setattr(update, name, value)
        update.seq = self._number
        update.received_ns = self.clock.now_ns
        update.stamp(update.said, update.received_ns)
        SlotWriter(self.shared, [(each.name, each.kind) for each in self.tick.ports]).write(port, update)

    def _sleep_until(self, deadline_ns: int) -> int:
        self._hear()
        number = self.journal.tick = self._number
        if self._number in self._acts:
            self._acts[self._number](self)
        self._script.each_tick(self)
        if self.beats:
            self.shared.words[SUPERVISOR_BEAT] = self.clock.now_ns
        self.loop.session.stop_requested = number >= self._script.ticks
        self._number += 1
        woke_ns = self.clock.sleep_until(deadline_ns) + 1000 * (number % 5)
        self.clock.now_ns = woke_ns
        return woke_ns

    def _have_laws_compute(self, patch: pytest.MonkeyPatch) -> None:
        act = Contact.act

        def compute_and_act(contact: Contact, periods: float) -> None:
            assert self.clock.computed_ns is not None
            self.clock.computed_ns += round(self.computes_s * 1e9)
            act(contact, periods)

        patch.setattr(Contact, "act", compute_and_act)

    def _hear(self) -> None:
        self.journal.note("skipped, as the supervisor sees it", float(self.shared.words[SKIPPED]))
        for record in self._records.read():
            self._note("", record)
        for event in self._events.read():
            at = event.deadline_ns if event.seq > self._script.resume.seq else 0
            told = {name: f"{value:.6g}" if isinstance(value, float) else value for name, value in event.fields.items()}
            self.journal.say(f"event {event.code} of tick {event.seq} at {at}: {event.text} {told}")
        if self._asked and self.shared.words[REQUESTS] == self.shared.words[ANSWERED]:
            self._asked = False
            self.journal.say(f"verdict: {self.shared.verdict().partition(': installed are')[0]!r}")

    def _note(self, name: str, value: Any) -> None:
        if value is None:
            return
        if is_dataclass(value):
            for field in fields(value):
                self._note(f"{name}.{field.name}", getattr(value, field.name))
        elif isinstance(value, tuple | list):
            for index, each in enumerate(value):
                self._note(f"{name}[{index}]", each)
        elif isinstance(value, str | bytes):
            self.journal.note(f"{name} {value!r}", 1.0)
        else:
            self.journal.note(name, float(value))


def run(script: Script) -> Journal:
    """A run of a script."""
    with pytest.MonkeyPatch.context() as patch:
        return Loop(script, patch).run()
