"""One period in sub-steps: the integrators that textbooks give, to be measured against the closed form.

    x' = v        v' = a(x, v) = (F - k x - b v - f_c sign(v)) / m        F held over the period

On a wall that is sampled each of them is a device of its own. With no friction and h = T / n, a wall K and a mass show
the leak (K T / 2) (1 + 1/n) under explicit Euler and (K T / 2) (1 - 1/n) under semi-implicit Euler: at one sub-step
twice the leak of the sampled wall, and none at all. Verlet is exact there, since F is constant.
"""

from __future__ import annotations

from hapticd.simulation.plant.state import PlantParams, PlantState

# Terms of the model and integrators, as those of `step`.
SPRING: bool = True
FRICTION: bool = True
EXPLICIT: bool = True
SEMI_IMPLICIT: bool = True
VERLET: bool = True
RK4: bool = True

METHODS = ("exact", "explicit-euler", "semi-implicit-euler", "velocity-verlet", "rk4")
"""Integrators, in the order of the numbers below; `exact` is the closed form of `step`."""

METHOD_EXACT, METHOD_EXPLICIT, METHOD_SEMI_IMPLICIT, METHOD_VERLET, METHOD_RK4 = range(5)


def stepped(state: PlantState, params: PlantParams, force_n: float) -> None:
    """Advance by one period in `params.substeps` steps.

    Friction is constant over a sub-step and never turns the device around: what would cross standstill stays there,
    so that the dead band is not jumped over.
    """
    h = params.substep_s
    for _ in range(params.substeps):
        x = state.x_m
        v = state.v_m_per_s
        drive = force_n / params.mass_kg
        if FRICTION:
            outward = v > 0.0
            if params.coulomb_n > 0.0:
                if v == 0.0:
                    net_n = force_n - params.spring_n_per_m * x
                    if -params.coulomb_n <= net_n <= params.coulomb_n:
                        return
                    outward = net_n > 0.0
                if outward:
                    drive = (force_n - params.coulomb_n) / params.mass_kg
                else:
                    drive = (force_n + params.coulomb_n) / params.mass_kg
        if EXPLICIT and params.method == METHOD_EXPLICIT:
            state.v_m_per_s = v + h * acceleration(params, x, v, drive)
            state.x_m = x + h * v
        if SEMI_IMPLICIT and params.method == METHOD_SEMI_IMPLICIT:
            state.v_m_per_s = v + h * acceleration(params, x, v, drive)
            state.x_m = x + h * state.v_m_per_s
        if VERLET and params.method == METHOD_VERLET:
            before = acceleration(params, x, v, drive)
            state.x_m = x + h * (v + 0.5 * h * before)
            after = acceleration(params, state.x_m, v + h * before, drive)
            state.v_m_per_s = v + 0.5 * h * (before + after)
        if RK4 and params.method == METHOD_RK4:
            half = 0.5 * h
            first = acceleration(params, x, v, drive)
            v_second = v + half * first
            second = acceleration(params, x + half * v, v_second, drive)
            v_third = v + half * second
            third = acceleration(params, x + half * v_second, v_third, drive)
            v_fourth = v + h * third
            fourth = acceleration(params, x + h * v_third, v_fourth, drive)
            state.x_m = x + h / 6.0 * (v + 2.0 * v_second + 2.0 * v_third + v_fourth)
            state.v_m_per_s = v + h / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        if FRICTION and params.coulomb_n > 0.0 and (state.v_m_per_s > 0.0) != outward:
            state.v_m_per_s = 0.0


def acceleration(params: PlantParams, x_m: float, v_m_per_s: float, drive: float) -> float:
    """Of the device under a drive, force over mass, of known size [m/s^2]."""
    if SPRING:
        drive = drive - params.stiffness_per_s2 * x_m
    return drive - params.decay_per_s * v_m_per_s
