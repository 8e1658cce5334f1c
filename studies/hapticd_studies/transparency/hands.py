"""What hands do at a wall: a force over time, in straight lines, and the times at which the grip changes.

Forces act along the outward normal: negative presses. A hand's spring turns a force outward into a place before the
wall, so that a device that is lifted does not fly away; one that is let go of does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from random import Random
from typing import Any

from hapticd_studies.draws import digits

KINDS = ("press", "tap", "stroke", "tremor", "hold", "regrip", "let-go")

IN, HOLD, OUT = 0, 1, 2
"""What a hand is about: pressing more, staying, easing or away."""

LIFT_N = 0.3
"""Outward force of a hand that is away from the wall: a few millimetres on its spring."""
LET_GO_S = 0.02

_SMOOTH = 12  # straight lines in one smooth change
_PER_TURN = 24  # and in one turn of a sine: 1 % off at most
_ARRIVAL_S = 0.5
_DRIFT_N = 0.1  # rms of what a hand that holds does not mean


@dataclass(slots=True)
class Movement:
    """What one hand does.

    Attributes:
        points: [time s, force N], straight lines between them.
        phases: [time s, IN, HOLD or OUT], each until the next.
        releases: when it begins to leave the wall [s].
        grips: new values of the hand from some time on, as `device.options.changes` takes them.
    """

    points: list[tuple[float, float]] = field(default_factory=lambda: [(0.0, LIFT_N)])
    phases: list[tuple[float, int]] = field(default_factory=lambda: [(0.0, OUT)])
    releases: list[float] = field(default_factory=list)
    grips: list[dict[str, float]] = field(default_factory=list)

    @property
    def now_s(self) -> float:
        """Until when it is known [s]."""
        return self.points[-1][0]

    def change(self, to_n: float, took_s: float) -> None:
        """A smooth change, as fast as a minimum-jerk move: 10 s^3 - 15 s^4 + 6 s^5."""
        from_s, from_n = self.points[-1]
        self.phases.append((from_s, IN if to_n < from_n else OUT))
        if to_n >= 0.0 > from_n:
            self.releases.append(from_s)
        for count in range(1, _SMOOTH + 1):
            s = count / _SMOOTH
            self.points.append((from_s + s * took_s, from_n + (to_n - from_n) * s * s * s * (10 - 15 * s + 6 * s * s)))

    def wait(self, took_s: float) -> None:
        """The force stays."""
        last_s, last_n = self.points[-1]
        self.phases.append((last_s, HOLD if last_n < 0.0 else OUT))
        self.points.append((last_s + took_s, last_n))


def movement(kind: str, source: Random, duration_s: float, grip: dict[str, float]) -> Movement:
    """A hand of a kind; its forces and paces are drawn anew for every move.

    Args:
        kind: one of `KINDS`.
        source: of all that is drawn.
        duration_s: it lasts at least this [s].
        grip: `hand_mass_kg`, `hand_damping_n_s_per_m`, `hand_stiffness_n_per_m` of the hand.
    """
    if kind == "stroke":  # presses and eases without leaving
        return _sine(-3.0, source.uniform(1.5, 2.0), source.choice([0.3, 2.0]), duration_s)
    if kind == "tremor":
        return _sine(-3.0, 0.3, source.uniform(8.0, 10.0), duration_s)
    if kind == "hold":
        return _hold(source, duration_s)
    found = Movement()
    pace_s = 1.0 / source.uniform(1.0, 4.0)
    while found.now_s < duration_s:
        if kind == "press":
            _press(found, source)
        elif kind == "tap":
            _tap(found, source, pace_s)
        elif kind == "regrip":
            _regrip(found, source, grip, duration_s)
        else:
            _let_go(found, source, grip)
    return found


def _press(found: Movement, source: Random) -> None:
    """0.2-6 N, light ones as common as hard ones; rest, release, wait."""
    found.change(-0.2 * 30.0 ** source.random(), source.uniform(0.1, 0.5))
    found.wait(source.uniform(0.5, 3.0))
    found.change(LIFT_N, source.uniform(0.05, 0.3))
    found.wait(source.uniform(0.3, 1.0))


def _tap(found: Movement, source: Random, pace_s: float) -> None:
    """2-6 N at 1-4 Hz; the push lasts 60-150 ms."""
    push_s = source.uniform(0.06, min(0.15, 0.8 * pace_s))
    found.change(-source.uniform(2.0, 6.0), 0.5 * push_s)
    found.change(LIFT_N, 0.5 * push_s)
    found.wait((pace_s - push_s) * source.uniform(0.8, 1.2))


def _regrip(found: Movement, source: Random, grip: dict[str, float], duration_s: float) -> None:
    """Press with 1-5 N and take the device otherwise every 1-3 s: 0.3 to 3 times as firmly."""
    found.change(-source.uniform(1.0, 5.0), source.uniform(0.1, 0.5))
    while found.now_s < duration_s:
        found.wait(source.uniform(1.0, 3.0))
        firmer = 0.3 * 10.0 ** source.random()
        found.grips.append({"at_s": found.now_s, **{name: digits(firmer * value) for name, value in grip.items()}})


def _let_go(found: Movement, source: Random, grip: dict[str, float]) -> None:
    """Press with 2-6 N, open the hand within 20 ms, and take the device again 0.2-2 s later."""
    found.change(-source.uniform(2.0, 6.0), source.uniform(0.1, 0.5))
    found.wait(source.uniform(0.3, 1.0))
    found.grips.append({"at_s": found.now_s + 0.5 * LET_GO_S, **dict.fromkeys(grip, 0.0)})
    found.change(0.0, LET_GO_S)
    found.wait(source.uniform(0.2, 2.0))
    found.grips.append({"at_s": found.now_s, **grip})


def _sine(mean_n: float, swing_n: float, frequency_hz: float, duration_s: float) -> Movement:
    found = Movement()
    found.change(mean_n, _ARRIVAL_S)
    per_s = frequency_hz * _PER_TURN
    for at in range(math.ceil(duration_s * per_s) + 1):
        if at % (_PER_TURN // 2) == _PER_TURN // 4 or at == 0:  # a turn of the force: from here it eases, or presses
            eases = math.cos(math.tau * (at + 0.5) / _PER_TURN) > 0.0
            found.phases.append((_ARRIVAL_S + at / per_s, OUT if eases else IN))
        if at > 0:
            found.points.append((_ARRIVAL_S + at / per_s, mean_n + swing_n * math.sin(math.tau * at / _PER_TURN)))
    return found


def _hold(source: Random, duration_s: float) -> Movement:
    """1-5 N, and what no hand can help: 0.1 N rms below 7 Hz."""
    found = Movement()
    mean_n = -source.uniform(1.0, 5.0)
    found.change(mean_n, _ARRIVAL_S)
    found.phases.append((_ARRIVAL_S, HOLD))
    waves = [(source.uniform(0.5, 7.0), source.uniform(0.0, math.tau)) for _ in range(6)]
    each_n = _DRIFT_N * math.sqrt(2.0 / len(waves))
    for at in range(1, math.ceil(duration_s * 100.0) + 1):
        drift_n = sum(each_n * math.sin(math.tau * hz * at / 100.0 + phase) for hz, phase in waves)
        found.points.append((_ARRIVAL_S + at / 100.0, mean_n + min(1.0, at / 20.0) * drift_n))
    return found


def options_of(found: Movement) -> dict[str, Any]:
    """The force as `device.options.hand.force`."""
    return {"profile": "recorded", "points": [(_round(time_s), _round(newton)) for time_s, newton in found.points]}


def _round(value: float) -> float:
    """To a micro-unit: as a file shows it."""
    return round(value, 6)
