"""Slow and certain answers to hold the model against: decimals with hundreds of digits, and SciPy with events."""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np
from scipy.integrate import solve_ivp


def flow(decay: float, stiffness: float, time: float) -> tuple[Decimal, Decimal, Decimal]:
    """S', S and IS of `hapticd.simulation.plant.flow`, from exponentials, sines and cosines."""
    with localcontext() as context:
        context.prec = 700
        a, w, t = Decimal(decay), Decimal(stiffness), Decimal(time)
        split = a * a / 4 - w
        envelope = (-a * t / 2).exp()
        if split == 0:
            swing = t * envelope
            slope = (1 - a * t / 2) * envelope
        elif split > 0:
            root = split.sqrt()
            slow, fast = -a / 2 + root, -a / 2 - root
            swing = ((slow * t).exp() - (fast * t).exp()) / (2 * root)
            slope = (slow * (slow * t).exp() - fast * (fast * t).exp()) / (2 * root)
        else:
            root = (-split).sqrt()
            sine, cosine = _sine_and_cosine(root * t)
            swing = envelope * sine / root
            slope = envelope * (cosine - a / (2 * root) * sine)
        if w != 0:
            area = (1 - slope - a * swing) / w
        elif a != 0:
            area = (t - swing) / a
        else:
            area = t * t / 2
        return slope, swing, area


def _sine_and_cosine(angle: Decimal) -> tuple[Decimal, Decimal]:
    sine = cosine = Decimal(0)
    term = Decimal(1)
    n = 0
    while abs(term) > Decimal(10) ** -300 or n < abs(angle):
        sign = 1 if n % 4 in (0, 1) else -1
        if n % 2 == 0:
            cosine += sign * term
        else:
            sine += sign * term
        n += 1
        term = term * angle / n
    return sine, cosine


def period_with_friction(
    x: float, v: float, *, mass: float, damping: float, spring: float, coulomb: float, force: float, period: float
) -> tuple[float, float]:
    """One period of m x'' + b x' + k x = F - f_c sign(x'), by an integrator that stops at each standstill."""
    t = 0.0
    while t < period:
        net = force - spring * x
        if v == 0.0 and abs(net) <= coulomb:
            return x, v
        way = np.sign(v) if v != 0.0 else np.sign(net)

        def motion(_: float, state: list[float], way: float = way) -> list[float]:
            return [state[1], (force - way * coulomb - damping * state[1] - spring * state[0]) / mass]

        def standstill(_: float, state: list[float], way: float = way) -> float:
            return float(way * state[1])

        standstill.terminal = True  # type: ignore[attr-defined]  # where scipy looks for it
        standstill.direction = -1.0  # type: ignore[attr-defined]  # the same
        nudge = 0.0
        if v == 0.0:  # step off the surface, where the event would fire at once
            nudge = 1e-7 * (period - t)
            acceleration = (net - way * coulomb) / mass
            v = acceleration * nudge
            x += 0.5 * acceleration * nudge * nudge
        answer = solve_ivp(
            motion,
            (t + nudge, period),
            [x, v],
            "DOP853",
            rtol=1e-13,
            atol=1e-18,
            events=standstill,
            max_step=period / 8,
        )
        x, v = float(answer.y[0, -1]), float(answer.y[1, -1])
        t = float(answer.t[-1])
        if answer.status == 1:
            v = 0.0
    return x, v
