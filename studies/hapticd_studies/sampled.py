"""A linear plant between its samples, any delay included, and where a sampled wall before it stops being stable.

z(n+1) = A z(n) + b F(n-d) + c F(n-d-1),     x = z[0],     F(n) = -K x(n) - B (x(n) - x(n-1)) / T
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm
from scipy.optimize import brentq

from hapticd.simulation.options import Flexible
from hapticd.simulation.plant.coefficients import two_masses

Array = npt.NDArray[np.float64]

_ANGLES = 2500
_CLOSE = 1e-9  # a root this near to the circle is on it


@dataclass(frozen=True, eq=False)
class Sampled:
    """A plant from sample to sample.

    Attributes:
        walk: A.
        newest, before: b and c.
        delay_samples: d.
    """

    walk: Array
    newest: Array
    before: Array
    delay_samples: int

    def grows(self, stiffness_n_per_m: float, damping_n_s_per_m: float, period_s: float) -> float:
        """By how much the loop grows from one sample to the next, at most."""
        return float(np.abs(np.linalg.eigvals(self._closed(stiffness_n_per_m, damping_n_s_per_m, period_s))).max())

    def limit(self, damping_n_s_per_m: float, period_s: float) -> float:
        """The softest spring that makes the loop unstable [N/m]; 0: a softer one would too; infinite: none does."""
        rate = damping_n_s_per_m / period_s

        def closing(theta: Array) -> npt.NDArray[np.complex128]:
            z = np.exp(1j * np.atleast_1d(theta))
            one = np.eye(len(self.walk))[None]
            push = self.newest[None, :] + self.before[None, :] / z[:, None]
            moved = np.linalg.solve(z[:, None, None] * one - self.walk[None], push[:, :, None])[:, 0, 0]
            return np.asarray(-(z**self.delay_samples) / moved - rate * (1.0 - 1.0 / z))

        def turned(theta: float) -> float:
            return float(closing(np.array([theta]))[0].imag)

        angles = np.unique([*np.geomspace(1e-5, np.pi, _ANGLES), *np.linspace(1e-3, np.pi, _ANGLES)])[:-1]
        imaginary = closing(angles).imag
        crossings = [float(closing(np.array([np.pi]))[0].real)]
        for at in np.flatnonzero(np.sign(imaginary[:-1]) != np.sign(imaginary[1:])):
            theta = brentq(turned, float(angles[at]), float(angles[at + 1]), xtol=1e-15, rtol=1e-14)
            crossings.append(float(closing(np.array([theta]))[0].real))
        above = sorted(stiffness for stiffness in crossings if stiffness > 0.0)
        for stiffness in above:  # a resonance is not crossed where its pole and its zero meet
            if self.grows(stiffness * 1.0001, damping_n_s_per_m, period_s) > 1.0 + _CLOSE:
                first = stiffness
                break
        else:
            return np.inf if self.grows(1.0, damping_n_s_per_m, period_s) < 1.0 else 0.0
        return first if self.grows(0.5 * first, damping_n_s_per_m, period_s) < 1.0 else 0.0

    def _closed(self, stiffness_n_per_m: float, damping_n_s_per_m: float, period_s: float) -> Array:
        """The loop over z, the position before, and the forces on their way, newest first."""
        count, waiting = len(self.walk), self.delay_samples + 1
        closed = np.zeros((count + 1 + waiting,) * 2)
        force = np.zeros(len(closed))
        force[0] = -stiffness_n_per_m - damping_n_s_per_m / period_s
        force[count] = damping_n_s_per_m / period_s
        closed[:count, :count] = self.walk
        if self.delay_samples == 0:
            closed[:count] += np.outer(self.newest, force)
        else:
            closed[:count, count + self.delay_samples] += self.newest
        closed[:count, count + 1 + self.delay_samples] += self.before
        closed[count, 0] = 1.0
        closed[count + 1] = force
        closed[count + 2 :, count + 1 : -1] = np.eye(waiting - 1)
        return closed


def late_plant(
    mass_kg: float, decay_per_s: float, stiffness_per_s2: float, period_s: float, late_s: float, delay_samples: int
) -> Sampled:
    """A rigid device whose force comes `late_s` after its sample, and whole samples later."""
    equation = np.array([[0.0, 1.0], [-stiffness_per_s2, -decay_per_s]])
    return _sampled(equation, np.array([0.0, 1.0 / mass_kg]), period_s, late_s, delay_samples)


def flexible_plant(
    flexible: Flexible, values: Mapping[str, float], period_s: float, late_s: float, delay_samples: int
) -> Sampled:
    """A flexible device; `values` by the names of `Change`."""
    equation, inputs = two_masses(flexible, values).equation()
    return _sampled(np.array(equation), np.array(inputs)[:, 0], period_s, late_s, delay_samples)


def _sampled(equation: Array, push: Array, period_s: float, late_s: float, delay_samples: int) -> Sampled:
    rest, newest = _held(equation, push, period_s - late_s)
    _, early = _held(equation, push, late_s)
    walk, _ = _held(equation, push, period_s)
    return Sampled(walk, newest, rest @ early, delay_samples)


def _held(equation: Array, push: Array, time_s: float) -> tuple[Array, Array]:
    """exp(A t), and what a constant force of 1 does in t."""
    count = len(equation)
    whole = np.zeros((count + 1, count + 1))
    whole[:count, :count], whole[:count, count] = equation * time_s, push * time_s
    found = expm(whole)
    return found[:count, :count], found[:count, count]
