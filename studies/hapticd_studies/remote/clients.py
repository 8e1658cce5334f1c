"""Other programs, as far as a coupling or a force sees them: a tool that is pressed on a table, and a felt wall."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

from hapticd.tick.remote.update import FORCE, POSITION, VELOCITY, Update

STEP_S = 1e-4
"""Steps within a client's own: its own mechanics are not what is tested [s]."""


class Seen(NamedTuple):
    """What a client knows of the device.

    Attributes:
        x_m: position [m].
        impulse_n_s: what its port has pushed the device with, in all [N s].
        span_s: from the state that it saw in its step before to this one; None: as long as its step [s].
    """

    x_m: float
    impulse_n_s: float
    span_s: float | None = None


class Client(ABC):
    """A program that steps now and then.

    Attributes:
        stiffness_n_per_m: what a hand should feel of it, pressing slowly [N/m].
    """

    stiffness_n_per_m: float

    @abstractmethod
    def step(self, passed_s: float, seen: Seen, update: Update) -> None:
        """Go on by one step, and say where to.

        Args:
            passed_s: since the step before [s].
            seen: the newest that is known of the device.
            update: what is sent; filled in.
        """


class Tool(Client):
    """A free body behind a coupling, which comes to lie on a table: the simulator of a peg, a probe, a hand.

    It gets the mean force between the two states that it saw, as `Remote.mean_force_n` gives it: where the state is one
    or two ticks old by chance, a force over the time of its own step would be wrong by as much.

    Args:
        mass_kg: of the body [kg].
        table_n_per_m: stiffness of the table, damped critically; its surface is at 0 [N/m].
        coupling_n_per_m: of the coupling, for what is felt in the end [N/m].
        last: it gets the force of the last tick instead of the mean, as is often done.
    """

    def __init__(self, mass_kg: float, table_n_per_m: float, coupling_n_per_m: float, last: bool = False) -> None:
        self.stiffness_n_per_m = 1.0 / (1.0 / table_n_per_m + 1.0 / coupling_n_per_m)
        self._mass_kg = mass_kg
        self._table_n_per_m = table_n_per_m
        self.table_n_s_per_m = 2.0 * (mass_kg * table_n_per_m) ** 0.5
        self._before_n_s = self._mean_n = 0.0
        self._x_m = self._v_m_per_s = 0.0

    def step(self, passed_s: float, seen: Seen, update: Update) -> None:
        """Move under the mean force."""
        span_s = passed_s if seen.span_s is None else seen.span_s
        if span_s > 0.0:
            self._mean_n = (seen.impulse_n_s - self._before_n_s) / span_s
            self._before_n_s = seen.impulse_n_s
        steps = max(1, round(passed_s / STEP_S))
        step_s = passed_s / steps
        for _ in range(steps):
            force_n = -self._mean_n
            if self._x_m < 0.0:
                force_n -= self._table_n_per_m * self._x_m + self.table_n_s_per_m * self._v_m_per_s
            self._v_m_per_s += force_n / self._mass_kg * step_s
            self._x_m += self._v_m_per_s * step_s
        update.said |= POSITION | VELOCITY
        update.position_m[0] = self._x_m
        update.velocity_m_per_s[0] = self._v_m_per_s


class FeltWall(Client):
    """A wall that is computed from the device's position and sent as a force; its surface is at 0.

    Args:
        stiffness_n_per_m: of the wall [N/m].
    """

    def __init__(self, stiffness_n_per_m: float) -> None:
        self.stiffness_n_per_m = stiffness_n_per_m

    def step(self, passed_s: float, seen: Seen, update: Update) -> None:
        """Push as the wall does."""
        update.said |= FORCE
        update.force_n[0] = self.stiffness_n_per_m * max(0.0, -seen.x_m)


class TamedWall(FeltWall):
    """The same behind what such programs are tuned with by hand until the buzz stops: filter, slew, clamp, a fifth."""

    CORNER_S = 0.05
    SLEW_N_PER_S = 40.0
    CLAMP_N = 10.0
    SHARE = 0.2

    def __init__(self, stiffness_n_per_m: float) -> None:
        super().__init__(stiffness_n_per_m)
        self._filtered_n = 0.0
        self._sent_n = 0.0

    def step(self, passed_s: float, seen: Seen, update: Update) -> None:
        """Push as what is left of the wall does."""
        super().step(passed_s, seen, update)
        wanted_n = update.force_n[0]
        self._filtered_n += (wanted_n - self._filtered_n) * min(1.0, passed_s / self.CORNER_S)
        most_n = self.SLEW_N_PER_S * passed_s
        wanted_n = self.SHARE * max(-self.CLAMP_N, min(self.CLAMP_N, self._filtered_n))
        self._sent_n += max(-most_n, min(most_n, wanted_n - self._sent_n))
        update.force_n[0] = self._sent_n
