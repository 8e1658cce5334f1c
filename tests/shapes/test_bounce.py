"""A mass thrown at a ball, tick by tick with the proxy, against an event integration of the same in continuous time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hapticd.shapes.solid import Placed, Proxy
from tests.shapes.walks import HERE, go, spring, stand

RADIUS_M = 0.02
STIFFNESS_N_PER_M = 12e3
MASS_KG = 0.25
START_M = (0.009, -0.004, 0.03)
SPEED_M_PER_S = (-0.05, 0.1, -0.8)
END_S = 0.06


def exact() -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Free flight to the surface, the spring inside, free flight: position at the end [m]."""

    def depth(_t: float, state: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
        return float(np.linalg.norm(state[:3])) - RADIUS_M

    depth.terminal = True  # type: ignore[attr-defined]  # SciPy reads it off the function
    state, now, inside = np.array([*START_M, *SPEED_M_PER_S]), 0.0, False
    events = 0
    while now < END_S:

        def rate(
            _t: float, z: np.ndarray[tuple[int, ...], np.dtype[np.float64]], inside: bool = inside
        ) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
            length = np.linalg.norm(z[:3])
            push = STIFFNESS_N_PER_M * (RADIUS_M - length) * z[:3] / length if inside else np.zeros(3)
            return np.concatenate([z[3:], push / MASS_KG])

        depth.direction = 1 if inside else -1  # type: ignore[attr-defined]  # and this
        done = solve_ivp(rate, (now, END_S), state, events=depth, rtol=1e-12, atol=1e-14)
        state, now = done.y[:, -1], float(done.t[-1])
        if done.status == 1:
            inside, events = not inside, events + 1
    assert events == 2  # it came, and it went
    return state[:3]


def stepped(period_s: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """The same with the force held over each period, which for a free mass is exact."""
    proxy = Proxy([Placed("sphere", HERE, radius_m=RADIUS_M)])
    p, v = list(START_M), list(SPEED_M_PER_S)
    stand(proxy, START_M)
    for _ in range(round(END_S / period_s)):
        go(proxy, (p[0], p[1], p[2]))
        for axis, stretch in enumerate(spring(proxy)):
            a = STIFFNESS_N_PER_M * stretch / MASS_KG
            p[axis] += v[axis] * period_s + 0.5 * a * period_s * period_s
            v[axis] += a * period_s
    return np.array(p)


def test_with_a_shorter_period_the_loop_goes_where_the_continuous_one_goes() -> None:
    """The hold's delay of half a period makes an error in proportion to it; nothing else is left."""
    end = exact()
    off = [stepped(period_s) - end for period_s in (4e-5, 2e-5, 1e-5)]
    assert np.linalg.norm(off[1]) / np.linalg.norm(off[0]) == pytest.approx(0.5, abs=0.01)
    assert np.linalg.norm(off[2]) / np.linalg.norm(off[1]) == pytest.approx(0.5, abs=0.01)
    # With the part in proportion to the period taken off: what 48 mm of way are off then.
    assert np.linalg.norm(2.0 * off[2] - off[1]) < 1e-7
