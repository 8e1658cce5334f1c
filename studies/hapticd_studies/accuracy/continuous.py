"""A wall that is felt at all times and not at samples: there contact is an event, and integrators lose their order.

    m x'' + b x' = F - K x  inside (x < 0),   = F  outside          F: the hand, constant

The truth is piecewise linear: closed forms between crossings, and each crossing found to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from hapticd.config.loading import LoadedConfig
from hapticd.offline.outcome import pressing_n
from hapticd.offline.rehearsal import simulation_options
from hapticd.simulation.plant import flow

STEPS_S = (1e-3, 1e-4, 1e-5)
TOLERANCES = (1e-6, 1e-9, 1e-12)
_NUDGE_S = 1e-10
_PIECES = 200
"""Pieces of a swing that are looked at for a crossing."""


@dataclass(frozen=True, slots=True)
class Bounce:
    """One motion.

    Attributes:
        mass_kg, viscous_n_s_per_m, stiffness_n_per_m: m, b, K.
        force_n: of the hand, negative presses.
        start_m: where it starts from rest, > 0 outside [m].
        duration_s: how long it is followed [s].
    """

    mass_kg: float = 0.5
    viscous_n_s_per_m: float = 0.0
    stiffness_n_per_m: float = 3000.0
    force_n: float = -5.0
    start_m: float = 0.005
    duration_s: float = 0.5


@dataclass(frozen=True, slots=True)
class BounceRow:
    """One way to compute it.

    Attributes:
        name: of the method.
        error_m: of the position at the end [m].
        evaluations: of the acceleration.
    """

    name: str
    error_m: float
    evaluations: int


def stiff(loaded: LoadedConfig) -> bool:
    """Whether a configuration has a wall to bounce on."""
    walls = loaded.config.scene.walls
    return bool(walls) and walls[0].stiffness_n_per_m > 0.0


def bounce_of(loaded: LoadedConfig) -> Bounce:
    """The device of a configuration on its first wall, dropped from 5 mm."""
    options = simulation_options(loaded)
    press_n = pressing_n(options)
    return Bounce(
        mass_kg=options.mass_kg + options.hand.mass_kg,
        viscous_n_s_per_m=max(0.0, options.viscous_n_s_per_m) + options.hand.damping_n_s_per_m,
        stiffness_n_per_m=loaded.config.scene.walls[0].stiffness_n_per_m,
        force_n=-press_n if press_n > 0.0 else -3.0,
    )


def truth(bounce: Bounce) -> tuple[float, float]:
    """Position and velocity at the end [m], [m/s]."""
    x, v, left = bounce.start_m, 0.0, bounce.duration_s
    inside = x < 0.0 or (x == 0.0 and bounce.force_n < 0.0)
    while left > 0.0:
        x, v, spent = _until_crossing(bounce, x, v, left, inside)
        left -= spent
        inside = not inside
    return x, v


def measure_bounce(bounce: Bounce) -> list[BounceRow]:
    """Compute it in every way."""
    exact_m, _ = truth(bounce)
    rows = []
    for method in _FIXED:
        for step_s in STEPS_S:
            steps = round(bounce.duration_s / step_s)
            x = _stepped(bounce, method, steps)
            rows.append(BounceRow(f"{method}, {1e6 * step_s:g} us", abs(x - exact_m), steps * _FIXED[method]))
    for events in (False, True):
        for relative in TOLERANCES:
            x, evaluations = _adaptive(bounce, relative, events)
            name = f"DOP853 {relative:.0e}, {'stops at contact' if events else 'runs through contact'}"
            rows.append(BounceRow(name, abs(x - exact_m), evaluations))
    return rows


_FIXED = {"explicit-euler": 1, "semi-implicit-euler": 1, "velocity-verlet": 2, "rk4": 4}


def _pull(bounce: Bounce, x: float, v: float) -> float:
    wall_n = -bounce.stiffness_n_per_m * x if x < 0.0 else 0.0
    return (bounce.force_n + wall_n - bounce.viscous_n_s_per_m * v) / bounce.mass_kg


def _moved(bounce: Bounce, x: float, v: float, t: float, inside: bool) -> tuple[float, float]:
    stiffness = bounce.stiffness_n_per_m / bounce.mass_kg if inside else 0.0
    slope, swing, area = flow(bounce.viscous_n_s_per_m / bounce.mass_kg, stiffness, t)
    q = bounce.force_n / bounce.mass_kg - stiffness * x
    return x + swing * v + area * q, slope * v + swing * q


def _until_crossing(bounce: Bounce, x: float, v: float, left: float, inside: bool) -> tuple[float, float, float]:
    """To the next crossing of the surface, or to the end: position, velocity, time."""
    step = min(left, (bounce.mass_kg / bounce.stiffness_n_per_m) ** 0.5) / _PIECES
    t = 0.0
    while t < left:
        after = min(t + step, left)
        if (_moved(bounce, x, v, after, inside)[0] > 0.0) == inside:
            low, high = t, after
            for _ in range(200):
                middle = 0.5 * (low + high)
                if middle in (low, high):
                    break
                if (_moved(bounce, x, v, middle, inside)[0] > 0.0) == inside:
                    high = middle
                else:
                    low = middle
            return 0.0, _moved(bounce, x, v, high, inside)[1], high
        t = after
    return (*_moved(bounce, x, v, left, inside), left)


def _stepped(bounce: Bounce, method: str, steps: int) -> float:
    h = bounce.duration_s / steps
    x, v = bounce.start_m, 0.0
    for _ in range(steps):
        a = _pull(bounce, x, v)
        if method == "explicit-euler":
            x, v = x + h * v, v + h * a
        elif method == "semi-implicit-euler":
            v = v + h * a
            x = x + h * v
        elif method == "velocity-verlet":
            x = x + h * (v + 0.5 * h * a)
            v = v + 0.5 * h * (a + _pull(bounce, x, v + h * a))
        else:
            v2 = v + 0.5 * h * a
            a2 = _pull(bounce, x + 0.5 * h * v, v2)
            v3 = v + 0.5 * h * a2
            a3 = _pull(bounce, x + 0.5 * h * v2, v3)
            v4 = v + h * a3
            a4 = _pull(bounce, x + h * v3, v4)
            x, v = x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4), v + h / 6.0 * (a + 2.0 * a2 + 2.0 * a3 + a4)
    return x


def _adaptive(bounce: Bounce, relative: float, events: bool) -> tuple[float, int]:
    """Position at the end, and how often the acceleration was asked for.

    With events every crossing ends an integration, and the next one has the force of its side throughout. SciPy looks
    for crossings at the ends of steps only: contact that is lost and found again within one is not seen, and shows.
    """
    t, state, inside = 0.0, [bounce.start_m, 0.0], bounce.start_m < 0.0
    evaluations = 0
    while t < bounce.duration_s:

        def motion(_: float, at: Sequence[float], inside: bool = inside) -> list[float]:
            side_m = at[0] if not events else (at[0] if inside else 0.0)
            wall_n = -bounce.stiffness_n_per_m * side_m if events or side_m < 0.0 else 0.0
            return [at[1], (bounce.force_n + wall_n - bounce.viscous_n_s_per_m * at[1]) / bounce.mass_kg]

        def crossing(_: float, at: np.ndarray) -> float:
            return float(at[0])

        vars(crossing).update(terminal=True, direction=1.0 if inside else -1.0)
        answer = solve_ivp(
            motion,
            (t, bounce.duration_s),
            state,
            "DOP853",
            rtol=relative,
            atol=1e-3 * relative,
            events=crossing if events else None,
        )
        evaluations += int(answer.nfev)
        t, state = float(answer.t[-1]), [float(answer.y[0, -1]), float(answer.y[1, -1])]
        if answer.status == 1:
            inside = not inside
            # SciPy's events fire at once on the surface itself: go on a hair beside it, where nothing else happens.
            pull = (bounce.force_n - bounce.viscous_n_s_per_m * state[1]) / bounce.mass_kg
            state = [_NUDGE_S * (state[1] + 0.5 * _NUDGE_S * pull), state[1] + _NUDGE_S * pull]
            t += _NUDGE_S
    return state[0], evaluations
