"""One of the study's random clients in real time: a real daemon, real sockets, and its network's delays slept.

What it said and when it came into force is kept, so that the same can be run again offline, tick by tick: there the
time that a busy computer took is as it was, and what is left is what the law made of it.
"""

from __future__ import annotations

import contextlib
import heapq
import time
from bisect import bisect_right
from dataclasses import dataclass, field, replace

import msgpack
import zmq

from hapticd.config.loading import LoadedConfig
from hapticd.config.plugin_tables import RemoteLawTable
from hapticd.config.ports import PortLimits, port_limits
from hapticd.offline.outcome import Balance, Criterion, Outcome
from hapticd.offline.rehearsal import Rehearsal, simulation_options
from hapticd.remote.message import WrongMessageError, examine, merge
from hapticd.tick.remote.streamed_force import LET_GO_S
from hapticd.tick.remote.update import FORCE, POSITION, VELOCITY, Update
from hapticd_studies.law_spec import parse_laws
from hapticd_studies.remote.clients import Client, Seen
from hapticd_studies.remote.network import turns
from hapticd_studies.remote.runs import Case, draw
from tests.daemon.running import PATIENCE_S, Daemon
from tests.remote.stage import runtime

PORT = "client"
PERIOD_S = 1e-3
MOST_N = 12.0
DAMPERS = "damper:damping_n_s_per_m=50,damper:damping_n_s_per_m=100"
STILL_M = 1e-4
"""Twice what the study calls still: positions are the sensor's, and a client sees now one tick more, now less [m]."""
PAUSE_AFTER_S = 0.7
"""After the hand presses the client stands still, where it does."""

_NAP_S = 3e-4


@dataclass(frozen=True, slots=True)
class Tick:
    """What a client was told of a tick."""

    seq: int
    deadline_ns: int
    x_m: float
    impulse_n_s: float
    device_n: float
    port_n: float
    in_force: int
    held: bool
    age_s: float


@dataclass(frozen=True, slots=True)
class Step:
    """A step: after which tick, on what it saw of which and how long after what it saw before, and what it said."""

    after: int
    saw: int
    passed_s: float
    span_s: float
    fields: dict[str, list[float]]


@dataclass(slots=True)
class Session:
    """What happened.

    Attributes:
        case: the client.
        config: of the daemon.
        ticks: told, in their order.
        steps: of the client; the number of a message is its place here.
        late_s: how late each was sent, beyond its own network [s].
    """

    case: Case
    config: LoadedConfig
    ticks: list[Tick] = field(default_factory=list)
    steps: list[Step] = field(default_factory=list)
    late_s: list[float] = field(default_factory=list)
    last_seen: Tick | None = None

    @property
    def heard(self) -> dict[int, tuple[int, float]]:
        """By tick the message that was first in force in it, and how old it was when the tick began [s]."""
        found: dict[int, tuple[int, float]] = {}
        last = -1
        for tick in self.ticks:
            if tick.in_force not in (last, -1):
                last = tick.in_force
                found[tick.seq] = last, max(0.0, tick.age_s - PERIOD_S)
        return found

    def unramped(self) -> list[Tick]:
        """Ticks in which the force was above what the ramp lets through, which begins and ends with the client's words.

        Of ticks that were not told it is taken that the ramp rose.
        """
        ramp_s = self.config.config.safety.ramp_s
        step = PERIOD_S / (ramp_s if self.case.kind == "tool" else min(ramp_s, LET_GO_S))
        weight, last, found = 0.0, self.ticks[0].seq - 1, []
        for tick in self.ticks:
            if tick.held or tick.seq > last + 1:
                weight = min(1.0, weight + step * (tick.seq - last))
            else:
                weight = max(0.0, weight - step)
            last = tick.seq
            if abs(tick.port_n) > weight * MOST_N * (1.0 + 1e-9):
                found.append(tick)
        return found

    @property
    def outcome(self) -> Outcome:
        """What became of the press, from what was told."""
        return self.judged([tick.x_m for tick in self.ticks])

    @property
    def span_m(self) -> float:
        """How far it moved at the end [m]."""
        x_m = [tick.x_m for tick in self.ticks[-round(Criterion().window_s / PERIOD_S) :]]
        return max(x_m) - min(x_m)

    def judged(self, x_m: list[float]) -> Outcome:
        """What became of a press whose positions these are, to the end."""
        criterion = Criterion(still_m=STILL_M)
        ended = x_m[-round(criterion.window_s / PERIOD_S) :]
        balance: Balance = self.case.balance()
        options = simulation_options(self.config)
        return criterion.outcome(options, balance, max(ended) - min(ended), sum(ended) / len(ended))


def pressed(seed: int, index: int, kind: str, at_s: float) -> tuple[Case, LoadedConfig]:
    """A client of the study whose hand presses some time after the daemon's start, and the daemon's configuration."""
    case = draw(seed, index, kind)
    network = replace(case.network, pause_at_s=at_s + PAUSE_AFTER_S if case.network.pause_s else 0.0)
    case = replace(case, network=network)
    force = {"profile": "step", "newton": -case.press_n, "at_s": at_s}
    law = parse_laws(RemoteLawTable().law, {})[0]
    return case, case.config(law).with_values({"device.options.hand.force": force})


def drive(daemon: Daemon, case: Case, config: LoadedConfig, ticks: int) -> Session:
    """Be that client until the daemon has made so many ticks."""
    session = Session(case, config)
    context = zmq.Context()
    with context, context.socket(zmq.SUB) as state, context.socket(zmq.DEALER) as scene:
        state.setsockopt(zmq.RCVHWM, 0)
        state.setsockopt(zmq.SUBSCRIBE, b"")
        scene.setsockopt(zmq.LINGER, 0)
        state.connect(f"ipc://{runtime(daemon)}/state")
        scene.connect(f"ipc://{runtime(daemon)}/scene")
        assert state.poll(int(PATIENCE_S * 1e3)), "no state came"
        _go_on(session, state, scene, ticks)
    return session


def again(session: Session) -> list[float]:
    """Positions offline, when each message comes into force in the tick in which it did; up to the last one [m]."""
    said, heard = _said(session), session.heard
    rehearsal = Rehearsal(session.config)
    port = rehearsal.tick.ports[0]
    found = []
    for tick in rehearsal.run(session.ticks[-1].seq + 1):
        found.append(rehearsal.tick.motion.position_m[0])
        if tick + 1 in heard:
            number, age_s = heard[tick + 1]
            port.take(said[number], age_s)
    return found


def under(session: Session, laws: str) -> list[Outcome]:
    """What would have become of it under other laws, each message as late as it was."""
    return [_under(session, law) for law in laws.split(",")]


def _under(session: Session, law: str) -> Outcome:
    spec = parse_laws(law, {})[0]
    config = session.config.with_values({"remote.law": spec.name, "remote.params": dict(spec.values)})
    rehearsal = Rehearsal(config)
    port, simulator = rehearsal.tick.ports[0], _Simulator(session.case.client())
    limits = port_limits(config.config.scene)[0]
    came, heard = list(session.steps), session.heard
    known: list[Seen] = []
    said: list[Update] = []
    sent = Update()
    for tick in rehearsal.run(session.ticks[-1].seq + 1):
        known.append(Seen(rehearsal.tick.motion.position_m[0], port.impulse_n_s[0]))
        while len(said) < len(came) and came[len(said)].after <= tick:
            step = came[len(said)]
            simulator.step(step.passed_s, step.span_s, known[step.saw])
            _take(sent, limits, len(said), _fields(simulator.update))
            said.append(_copy(sent))
        number, age_s = heard.get(tick + 1, (len(said), 0.0))
        if number < len(said):
            port.take(said[number], age_s)
    return Outcome.DIVERGED if rehearsal.diverged else session.judged([seen.x_m for seen in known])


class _Simulator:
    """The client with what it knows: as `mean_force_n` does it, the mean over the time between what it saw."""

    def __init__(self, client: Client) -> None:
        self.update = Update()
        self._client = client
        self._before_n_s = self._mean_n = self._whole_n_s = 0.0

    def step(self, passed_s: float, span_s: float, seen: Seen) -> None:
        if span_s > 0.0:
            self._mean_n = (seen.impulse_n_s - self._before_n_s) / span_s
            self._before_n_s = seen.impulse_n_s
        self._whole_n_s += self._mean_n * passed_s
        self._client.step(passed_s, Seen(seen.x_m, self._whole_n_s), self.update)


def _go_on(session: Session, state: zmq.Socket[bytes], scene: zmq.Socket[bytes], ticks: int) -> None:
    network, simulator = session.case.network, _Simulator(session.case.client())
    began_ns = time.monotonic_ns()
    coming = turns(network, 3600.0, session.case.seed)
    turn = next(coming)
    before_s = -1.0 / network.rate_hz
    leaving: list[tuple[float, int]] = []
    told = session.ticks
    while True:
        while state.poll(0):
            told.append(_tick(state.recv()))
        if told and told[-1].seq >= ticks:
            return
        now_s = (time.monotonic_ns() - began_ns) * 1e-9
        while told and turn.at_s <= now_s:
            saw = bisect_right(told, began_ns + turn.sees_s * 1e9, key=lambda tick: tick.deadline_ns) - 1
            _step(session, simulator, max(saw, 0), turn.at_s - before_s)
            before_s = turn.at_s
            if turn.heard_s is not None:
                heapq.heappush(leaving, (turn.heard_s, len(session.steps) - 1))
            turn = next(coming)
        while leaving and leaving[0][0] <= now_s:
            due_s, number = heapq.heappop(leaving)
            scene.send(msgpack.packb({"name": PORT, "seq": number, **session.steps[number].fields}))
            session.late_s.append((time.monotonic_ns() - began_ns) * 1e-9 - due_s)
        time.sleep(_NAP_S)


def _step(session: Session, simulator: _Simulator, saw: int, passed_s: float) -> None:
    seen = session.ticks[saw]
    before = session.last_seen or seen
    session.last_seen = seen
    span_s = (seen.deadline_ns - before.deadline_ns) * 1e-9
    simulator.step(passed_s, span_s, Seen(seen.x_m, seen.impulse_n_s))
    session.steps.append(Step(session.ticks[-1].seq, seen.seq, passed_s, span_s, _fields(simulator.update)))


def _tick(frame: bytes) -> Tick:
    said = msgpack.unpackb(frame)
    port = said["ports"][PORT]
    return Tick(
        said["seq"],
        said["deadline_ns"],
        said["position_m"][0],
        port["impulse_n_s"][0],
        said["force_n"][0],
        port["force_n"][0],
        port["seq"],
        port["state"] == "held",
        port["age_s"],
    )


def _fields(update: Update) -> dict[str, list[float]]:
    said = {}
    for bit, name in ((POSITION, "position_m"), (VELOCITY, "velocity_m_per_s"), (FORCE, "force_n")):
        if update.said & bit:
            said[name] = [getattr(update, name)[0]]
    return said


def _said(session: Session) -> list[Update]:
    """What the daemon made of each message."""
    limits = port_limits(session.config.config.scene)[0]
    update, found = Update(), []
    for number, step in enumerate(session.steps):
        _take(update, limits, number, step.fields)
        found.append(_copy(update))
    return found


def _take(update: Update, limits: PortLimits, number: int, fields: dict[str, list[float]]) -> None:
    """What the daemon does with a message: a simulator that goes astray says places that it refuses."""
    with contextlib.suppress(WrongMessageError):
        merge(examine({"name": PORT, "seq": number, **fields}, limits, 1), update, number)


def _copy(update: Update) -> Update:
    copy = Update()
    copy.said, copy.seq = update.said, update.seq
    copy.position_ns, copy.velocity_ns = update.position_ns, update.velocity_ns
    copy.position_m[:] = update.position_m
    copy.velocity_m_per_s[:] = update.velocity_m_per_s
    copy.force_n[:] = update.force_n
    return copy
