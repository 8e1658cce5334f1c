"""One client on the simulated omega7 under a law: the daemon's own tick, and what became of the press."""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from hapticd.config.loading import LoadedConfig, parse
from hapticd.config.remote import COME_IN_S
from hapticd.offline.felt import WINDOW_S, felt_index
from hapticd.offline.outcome import Balance, Criterion, Outcome
from hapticd.offline.rehearsal import Rehearsal
from hapticd.simulation.options import SimulationOptions
from hapticd.tick.remote.update import Update
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.remote.clients import Client, FeltWall, Seen, TamedWall, Tool
from hapticd_studies.remote.network import Network, turns

DURATION_S = 4.0
MAX_FORCE_N = 12.0
REST_S = 2.0
"""How long a hand that has moved presses in the end."""

HANDS = ("press", "stroke", "tap")

COLUMNS = (
    "outcome",
    "span_m",
    "mean_m",
    "felt",
    "peak_force_n",
    "largest_step_n",
    "drag_n_s_per_m",
    "leak_n_s_per_m",
)
"""Of a run, in the order of its row.

`largest_step_n`: of the applied force from one tick to the next; `drag_n_s_per_m`: what the law took from second 2 to
4, as a damping of the device's motion; `leak_n_s_per_m`: the same of what the client gave.
"""

_CONFIG = """
[device.options]
model = "omega7"
hand.force = {hand}
hand.mass_kg = {hand_kg!r}
hand.damping_n_s_per_m = {hand_n_s_per_m!r}
hand.stiffness_n_per_m = {hand_n_per_m!r}
[[scene.{port}]]
name = "client"
max_force_n = 12.0
{more}
[controller]
law = "none"
"""


@dataclass(frozen=True, slots=True)
class Case:
    """One client, how it is heard, and the hand that presses it.

    Attributes:
        name: SEED:INDEX, or what it is for.
        kind: `tool`: a body behind a coupling, on a table; `force`: a wall as a raw force; `tamed`: the same, tuned by
            hand.
        stiffness_n_per_m: of the coupling or the wall [N/m].
        network: how it is heard.
        press_n: how hard the hand presses [N].
        tool_kg: mass of the body behind the coupling [kg].
        table_n_per_m: stiffness of what that lies on [N/m].
        hand_kg, hand_n_s_per_m, hand_n_per_m: what of the hand moves with the device.
        seed: of everything random.
        come_in_s: in which the coupling comes to its stiffness [s].
        hand: `press`: it presses and stays; `stroke`, `tap`: first it goes to and fro for 4 s, past the surface.
    """

    name: str
    kind: str
    stiffness_n_per_m: float
    network: Network
    press_n: float = 3.0
    tool_kg: float = 0.2
    table_n_per_m: float = 5000.0
    hand_kg: float = 0.05
    hand_n_s_per_m: float = 1.0
    hand_n_per_m: float = 100.0
    seed: int = 1
    hand: str = "press"
    come_in_s: float = COME_IN_S

    @property
    def duration_s(self) -> float:
        """Of its run [s]."""
        return DURATION_S if self.hand == "press" else DURATION_S + REST_S

    def client(self) -> Client:
        """The program itself, from its beginning."""
        if self.kind == "tool":
            return Tool(self.tool_kg, self.table_n_per_m, self.stiffness_n_per_m)
        return (TamedWall if self.kind == "tamed" else FeltWall)(self.stiffness_n_per_m)

    def config(self, law: LawSpec) -> LoadedConfig:
        """The daemon's configuration for it."""
        coupling = f"stiffness_n_per_m = {self.stiffness_n_per_m!r}\ndamping_n_s_per_m = 2.0\nhold_s = 0.25"
        coupling += f"\ncome_in_s = {self.come_in_s!r}"
        loaded = _parsed(
            _CONFIG.format(
                hand=self._force(),
                hand_kg=self.hand_kg,
                hand_n_s_per_m=self.hand_n_s_per_m,
                hand_n_per_m=self.hand_n_per_m,
                port="couplings" if self.kind == "tool" else "forces",
                more=coupling if self.kind == "tool" else "hold_s = 0.25\nunchanged_s = 0.0",
            )
        )
        return loaded.with_values({"remote.law": law.name, "remote.params": dict(law.values)})

    def words(self) -> list[str]:
        """All that it is, a line a thing, for people."""
        found = asdict(self)
        found |= found.pop("network")
        return [f"{name} = {value}" for name, value in found.items()]

    def _force(self) -> str:
        """What the hand does, as a profile of the simulated device."""
        press_n = self.press_n
        if self.hand == "press":
            return f'{{ profile = "constant", newton = {-press_n!r} }}'
        pulse = 2.0 * math.pi * random.Random(self.seed).uniform(0.5, 2.0)
        points = []
        for at in range(round(DURATION_S / 0.005)):
            time_s = 0.005 * at
            if self.hand == "stroke":
                points.append([time_s, press_n * (1.6 * math.sin(pulse * time_s) - 1.0)])
            else:
                points.append([time_s, press_n * (0.65 * math.cos(pulse * time_s) - 0.35)])
        points.append([DURATION_S + 0.1, -press_n])
        return f'{{ profile = "recorded", points = {points} }}'

    def balance(self) -> Balance:
        """Where the hand's force and all springs balance."""
        total = self.client().stiffness_n_per_m + self.hand_n_per_m
        return Balance(-self.press_n / total, total)


def run(case: Case, law: LawSpec, take: Callable[[Rehearsal], object] | None = None) -> list[float]:
    """Run a case under a law, and say what became of it, in the order of `COLUMNS`.

    Args:
        case: the client, its network, the hand.
        law: on its port.
        take: is shown the daemon's tick and the device after every tick.
    """
    rehearsal = Rehearsal(case.config(law))
    period_s = rehearsal.period_s
    ticks = round(case.duration_s / period_s)
    port = rehearsal.tick.couplings[0]
    client = case.client()
    update = Update()
    inbox: deque[tuple[float, int, Update]] = deque()
    coming = turns(case.network, case.duration_s, case.seed)
    turn = next(coming, None)
    before_s = -1.0 / case.network.rate_hz
    newest = -1
    last_saw = -1
    known: list[Seen] = []
    true_m: list[float] = []
    peak_n = step_n = last_n = 0.0
    drag_j = given_j = motion = damping = own_n = last_m = 0.0
    for count in rehearsal.run(ticks):
        now_s = (count + 1) * period_s
        known.append(Seen(rehearsal.tick.motion.position_m[0], port.impulse_n_s[0]))
        while turn is not None and turn.at_s < now_s:
            saw = min(count, int(turn.sees_s / period_s))
            client.step(turn.at_s - before_s, known[saw]._replace(span_s=(saw - last_saw) * period_s), update)
            last_saw = saw
            update.seq += 1
            before_s = turn.at_s
            if turn.heard_s is not None:
                inbox.append((turn.heard_s, update.seq, _copy(update)))
            turn = next(coming, None)
        heard = [one for one in inbox if one[0] < now_s]
        if heard:
            latest = max(heard, key=lambda one: one[1])
            inbox = deque(one for one in inbox if one[0] >= now_s)
            if latest[1] > newest:
                newest = latest[1]
                port.take(latest[2])
        force_n = rehearsal.tick.force_n[0]
        peak_n = max(peak_n, abs(force_n))
        step_n = max(step_n, abs(force_n - last_n))
        last_n = force_n
        x_m = rehearsal.model.x_m
        true_m.append(x_m)
        if 0.5 * DURATION_S <= now_s < DURATION_S:
            moved_m = x_m - last_m
            drag_j += damping * moved_m * moved_m / period_s
            given_j += own_n * moved_m
            motion += moved_m * moved_m / period_s
        last_m, damping, own_n = x_m, port.channels[0].damping_n_s_per_m, port.channels[0].own_n
        if take is not None:
            take(rehearsal)
    over = max(motion, 1e-12)
    became = ended(case, rehearsal.model.options, period_s, np.array(true_m), rehearsal.fault, rehearsal.diverged)
    return [*became, peak_n, step_n, drag_j / over, max(0.0, given_j) / over]


def ended(
    case: Case, device: SimulationOptions, period_s: float, true_m: Any, fault: str | None, diverged: bool
) -> list[float]:
    """The first four of `COLUMNS`.

    Args:
        case: what was run.
        device: on which.
        period_s: between ticks [s].
        true_m: the device's true position by tick [m].
        fault: why the daemon would have stopped; None: it would not.
        diverged: the device left all bounds.
    """
    criterion = Criterion()
    if diverged:
        return [float(Outcome.DIVERGED), math.inf, math.nan, math.inf]
    last_m = true_m[-round(criterion.window_s / period_s) :]
    span_m, mean_m = float(np.ptp(last_m)), float(np.mean(last_m))
    felt = felt_index(true_m[-round(WINDOW_S / period_s) :], period_s)
    if fault is not None:
        return [float(Outcome.STOPPED), span_m, mean_m, felt]
    return [float(criterion.outcome(device, case.balance(), span_m, mean_m)), span_m, mean_m, felt]


def draw(seed: int, index: int, kind: str, hand: str = "press", come_in_s: float = COME_IN_S) -> Case:
    """One of the random clients, what the hand does, and how its coupling comes in."""
    random_ = random.Random(f"{seed}:{index}:{kind}")

    def between(low: float, high: float) -> float:
        return math.exp(random_.uniform(math.log(low), math.log(high)))

    paused = random_.random() < 0.25
    network = Network(
        rate_hz=between(30.0, 1000.0),
        delay_s=random_.choice((0.0, between(1e-3, 0.05))),
        jitter_s=random_.choice((0.0, between(1e-4, 0.02))),
        loss=random_.choice((0.0, random_.uniform(0.0, 0.3))),
        burst=random_.choice((1.0, random_.uniform(1.0, 5.0))),
        pause_at_s=1.5 if paused else 0.0,
        pause_s=between(0.05, 1.0) if paused else 0.0,
    )
    return Case(
        name=f"{seed}:{index}",
        kind=kind,
        stiffness_n_per_m=between(50.0, 8000.0),
        network=network,
        press_n=random_.uniform(1.0, 6.0),
        tool_kg=between(0.05, 1.0),
        table_n_per_m=between(500.0, 10000.0),
        hand_kg=random_.uniform(0.0, 0.1),
        hand_n_s_per_m=random_.uniform(0.3, 1.5),
        hand_n_per_m=random_.uniform(40.0, 200.0),
        seed=random_.randrange(1 << 30),
        hand=hand,
        come_in_s=come_in_s,
    )


@lru_cache(maxsize=64)
def _parsed(text: str) -> LoadedConfig:
    return parse(text, "client")


def _copy(update: Update) -> Update:
    copy = Update()
    copy.said, copy.seq = update.said, update.seq
    copy.stamp(copy.said, copy.seq)
    copy.position_m[:] = update.position_m
    copy.velocity_m_per_s[:] = update.velocity_m_per_s
    copy.force_n[:] = update.force_n
    return copy
