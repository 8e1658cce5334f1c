"""A device against a wall in a few lines: exact zero-order hold, quantiser, force limit, one sample of delay.

It is not the simulator of the daemon, so that a law is judged twice, by two plants written apart. `drive` runs
interpreted on plain objects and compiled on records (`machine.py`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

from hapticd.law import LawParams, LawSnapshot, LawTick, fresh_state, plain_object, scalar_params


@dataclass(frozen=True)
class Device:
    """A device, the wall before it and the hand on it; the Omega.7-like model unless told otherwise."""

    mass_kg: float = 0.25
    viscous_n_s_per_m: float = 4.4
    resolution_m: float = 1e-5
    limit_n: float = 12.0
    delay_samples: int = 0
    period_s: float = 1e-3
    stiffness_n_per_m: float = 12000.0
    wall_damping_n_s_per_m: float = 0.0
    hand_n: float = -3.0
    x_m: float = 0.0


PAPER = Device(mass_kg=0.5, viscous_n_s_per_m=0.0, resolution_m=0.0, limit_n=0.0, stiffness_n_per_m=3000.0, hand_n=-5.0)
"""The simulations of the paper: no damping, continuous position; their hand force is ours."""


@dataclass(frozen=True)
class Rest:
    """How the device lay at the end of a run."""

    peak_to_peak_m: float
    off_m: float
    allowed_m: float
    depth_m: float

    @property
    def still(self) -> bool:
        return self.peak_to_peak_m < 0.05e-3

    @property
    def held(self) -> bool:
        """Still and in the right place: a wall that holds still a millimetre too deep is no wall."""
        return self.still and self.off_m <= self.allowed_m


@dataclass(frozen=True)
class Exit:
    """How a device left the wall after the hand had let go."""

    pull_n: float  # largest force that held it back
    speed_m_per_s: float  # 0 when it was still in the wall after a second


class Rig:
    """A law on a device.

    Args:
        law: the law's module.
        device: plant, wall and hand.
        params: the law's parameters; its defaults when left out.
        drive: the loop; `machine.drive` runs the same one compiled.
    """

    def __init__(
        self,
        law: ModuleType,
        device: Device,
        params: LawParams | None = None,
        drive: Callable[..., None] | None = None,
    ) -> None:
        self.law = law
        self.device = device
        self.state: Any = fresh_state(law)
        self.params = plain_object("Params", scalar_params(params if params is not None else law.Params()))
        self.tick = LawTick(device.resolution_m)
        self.tick.dt_s = device.period_s
        self.plant = plain_object("Plant", _plant(device))
        self.ran_s = 0.0
        self._drive = drive or _drive_interpreted
        law.start(self.state, self.params, LawSnapshot(x_m=device.x_m))

    def run(self, seconds: float) -> Rest:
        """Go on for some time; the verdict is about its last half second."""
        ticks = round(seconds / self.device.period_s)
        last = min(ticks, round(0.5 / self.device.period_s))
        self._drive(self, ticks - last)
        self.plant.low_m, self.plant.high_m, self.plant.sum_m = math.inf, -math.inf, 0.0
        self._drive(self, last)
        plant = self.plant
        depth_m = -plant.hand_n / plant.stiffness_n_per_m
        off_m = abs(plant.sum_m / last + depth_m)
        return Rest(
            plant.high_m - plant.low_m, off_m, max(0.1 * depth_m, 3.0 * self.device.resolution_m), -plant.sum_m / last
        )

    def let_go(self) -> Exit:
        """Take the hand away and wait until the device is out of the wall."""
        self.change(hand_n=0.0)
        pull_n = 0.0
        for _ in range(round(1.0 / self.device.period_s)):
            self._drive(self, 1)
            pull_n = max(pull_n, -self.tick.applied_n)
            if self.plant.x_m >= 0.0:
                return Exit(pull_n, self.plant.v_m_per_s)
        return Exit(pull_n, 0.0)

    def change(self, viscous_n_s_per_m: float | None = None, **fields: float) -> None:
        """Another damping of the device, wall or hand from here on."""
        if viscous_n_s_per_m is not None:
            fields |= _motion(self.device.mass_kg, viscous_n_s_per_m, self.device.period_s)
        for name, value in fields.items():
            setattr(self.plant, name, value)


DROPS_M = tuple(i * 0.4e-3 for i in range(21))
"""Heights from which a device is let fall onto the wall: what comes of one start is chance."""


def rests(law: ModuleType, device: Device, params: LawParams | None = None, drive: Any = None) -> list[Rest]:
    """How the device lies after four seconds, from every height."""
    return [Rig(law, replace(device, x_m=drop_m), params, drive).run(4.0) for drop_m in DROPS_M]


def held(law: ModuleType, device: Device, params: LawParams | None = None, seconds: float = 6.0) -> bool:
    """Whether a law holds a device still and in place."""
    return Rig(law, device, params).run(seconds).held


def drive(step: Any, state: Any, params: Any, tick: Any, plant: Any, ticks: int) -> None:
    """So many ticks: sample, wall, law, limit, delay, one exact step of the plant."""
    for _ in range(ticks):
        measured_m = plant.x_m
        if plant.resolution_m > 0.0:
            measured_m = math.floor(plant.x_m / plant.resolution_m + 0.5) * plant.resolution_m
        tick.x_m = measured_m
        tick.moved_m = measured_m - plant.measured_m
        tick.velocity_m_per_s = tick.moved_m / tick.dt_s
        tick.in_contact = measured_m < 0.0
        tick.spring_n = tick.contact_n = 0.0
        if measured_m < 0.0:
            tick.spring_n = -plant.stiffness_n_per_m * measured_m
            tick.contact_n = tick.spring_n - plant.damping_n_s_per_m * tick.velocity_m_per_s
        force_n = step(state, params, tick)
        if measured_m >= 0.0:
            force_n = 0.0
        contact_n = tick.contact_n
        if plant.limit_n > 0.0:
            force_n = max(-plant.limit_n, min(plant.limit_n, force_n))
            contact_n = max(-plant.limit_n, min(plant.limit_n, contact_n))
        tick.applied_n = force_n
        tick.applied_contact_n = contact_n
        acting_n = force_n
        if plant.late:
            acting_n = plant.last_n
        plant.last_n = force_n
        plant.measured_m = measured_m
        plant.low_m = min(plant.low_m, plant.x_m)
        plant.high_m = max(plant.high_m, plant.x_m)
        plant.sum_m += plant.x_m
        total_n = acting_n + plant.hand_n
        plant.x_m += plant.x_per_v * plant.v_m_per_s + plant.x_per_n * total_n
        plant.v_m_per_s = plant.v_per_v * plant.v_m_per_s + plant.v_per_n * total_n


def _drive_interpreted(rig: Rig, ticks: int) -> None:
    drive(rig.law.step, rig.state, rig.params, rig.tick, rig.plant, ticks)


def _plant(device: Device) -> dict[str, Any]:
    return {
        "x_m": device.x_m,
        "v_m_per_s": 0.0,
        "measured_m": device.x_m,
        "last_n": 0.0,
        "low_m": 0.0,
        "high_m": 0.0,
        "sum_m": 0.0,
        "hand_n": device.hand_n,
        "stiffness_n_per_m": device.stiffness_n_per_m,
        "damping_n_s_per_m": device.wall_damping_n_s_per_m,
        "resolution_m": device.resolution_m,
        "limit_n": device.limit_n,
        "late": device.delay_samples == 1,
        **_motion(device.mass_kg, device.viscous_n_s_per_m, device.period_s),
    }


def _motion(mass_kg: float, viscous_n_s_per_m: float, period_s: float) -> dict[str, float]:
    """One exact step of m a + b v = F with F held."""
    beta = viscous_n_s_per_m * period_s / mass_kg
    if abs(beta) < 1e-3:  # the closed form cancels here
        lost = 1.0 - beta / 2.0 + beta**2 / 6.0 - beta**3 / 24.0
        fell = 0.5 - beta / 6.0 + beta**2 / 24.0 - beta**3 / 120.0
    else:
        lost = -math.expm1(-beta) / beta
        fell = (1.0 - lost) / beta
    return {
        "x_per_v": period_s * lost,
        "x_per_n": period_s**2 / mass_kg * fell,
        "v_per_v": math.exp(-beta),
        "v_per_n": period_s / mass_kg * lost,
    }
