"""Devices that only a study wants: stepped by an adaptive integrator that stops at events, or in single precision."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from scipy.integrate import solve_ivp

from hapticd.simulation.compiler.specialise import specialise
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd.simulation.plant import PlantParams, PlantState, move, sense, terms

_ABSOLUTE = 1e-3
"""Absolute tolerance as a share of the relative one, per metre and metre a second: the motions are millimetres."""

_NUDGE = 1e-7
"""How far off a standstill an integration starts again, as a share of what is left, lest the event fires at once."""


class AdaptiveDevice(SimulatedDevice):
    """The same device, its mechanics left to SciPy; a standstill under Coulomb friction is an event.

    A sampled wall changes its force at samples only and needs no event; friction does.

    Args:
        options: the model.
        period_s: time between samples [s].
        method: SciPy's name of the integrator.
        relative: its relative tolerance.
    """

    def __init__(
        self, options: SimulationOptions, period_s: float, method: Literal["DOP853", "Radau"], relative: float
    ) -> None:
        super().__init__(options.model_copy(update={"integrator": "rk4", "substeps": 1}), period_s)
        self._method = method
        self._relative = relative
        # In the place of the step in sub-steps, whose switch the integrator above has put on.
        self._move = specialise(move, terms(self.options), {"stepped": self._integrate})

    def _integrate(self, state: PlantState, params: PlantParams, force_n: float) -> None:
        """One period under a force that is held [N]."""
        x, v, t = state.x_m, state.v_m_per_s, 0.0
        while t < params.period_s:
            net_n = force_n - params.spring_n_per_m * x
            if v == 0.0 and -params.coulomb_n <= net_n <= params.coulomb_n and params.coulomb_n > 0.0:
                break
            way = float(np.sign(v) if v != 0.0 else np.sign(net_n))
            drive = (force_n - way * params.coulomb_n) / params.mass_kg
            if v == 0.0 and params.coulomb_n > 0.0:
                nudge_s = _NUDGE * (params.period_s - t)
                v = (drive - params.stiffness_per_s2 * x) * nudge_s
                x += 0.5 * v * nudge_s
                t += nudge_s

            def motion(_: float, at: np.ndarray, drive: float = drive) -> list[float]:
                return [at[1], drive - params.stiffness_per_s2 * at[0] - params.decay_per_s * at[1]]

            def standstill(_: float, at: np.ndarray, way: float = way) -> float:
                return way * float(at[1])

            vars(standstill).update(terminal=True, direction=-1.0)
            answer = solve_ivp(
                motion,
                (t, params.period_s),
                (x, v),
                self._method,
                rtol=self._relative,
                atol=_ABSOLUTE * self._relative,
                events=standstill if params.coulomb_n > 0.0 else None,
            )
            t, x, v = float(answer.t[-1]), float(answer.y[0, -1]), float(answer.y[1, -1])
            if answer.status == 1:
                v = 0.0
        state.x_m, state.v_m_per_s = x, v


class SingleDevice(SimulatedDevice):
    """The same device with its mechanics in single precision; its sensor and the loop stay in double."""

    def __init__(self, options: SimulationOptions, period_s: float) -> None:
        super().__init__(options, period_s)
        for params in [self.params, *(coming for _, coming in self._coming)]:
            _to_single(params)
        _to_single(self.state)
        self._sensor = PlantParams()
        self._sensor.resolution_m, self._sensor.noise_m = options.resolution_m, options.noise_m * math.sqrt(3.0)
        self._double = specialise(sense, terms(options))
        self._sense = self._sense_in_double

    def _sense_in_double(self, state: PlantState, params: PlantParams) -> None:
        seen = PlantState()
        seen.x_m, seen.noise_a, seen.noise_b = float(state.x_m), state.noise_a, state.noise_b
        self._double(seen, self._sensor)
        state.measured_m, state.noise_a, state.noise_b = seen.measured_m, seen.noise_a, seen.noise_b

    @property
    def x_m(self) -> float:
        """True position [m]."""
        return float(self.state.x_m)

    @property
    def v_m_per_s(self) -> float:
        """True velocity [m/s]."""
        return float(self.state.v_m_per_s)


def _to_single(fields: PlantState | PlantParams) -> None:
    """The real numbers of the mechanics in single precision; what is written to them later follows from these."""
    for name in type(fields).__slots__:
        value = getattr(fields, name)
        if isinstance(value, float) and name != "measured_m":
            setattr(fields, name, np.float32(value))
