"""One tick, without clocks or devices: sample in, force out. The daemon and every offline run share it.

    positions -> velocities -> contacts -> laws -> guard -> force; then the books
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

from hapticd.config.models import SceneConfig, VelocityConfig, WallConfig
from hapticd.contracts.driver import DeviceInfo, Sample
from hapticd.contracts.errors import ConfigError
from hapticd.contracts.event import EventCode
from hapticd.contracts.record import Flag
from hapticd.control import fallback
from hapticd.control.contact import Contact, RunningLaw
from hapticd.guard import BLIND_RAMP_S, Guard, Mode
from hapticd.scene import Wall
from hapticd.velocity import Estimator, make_estimator

FROZEN_TICKS = 20
"""Samples in a row with the same device time or count after which a device counts as frozen."""

MOST_N = 1e12
"""A law that asks for more is broken, whatever the limits are [N]."""

MOST_M_PER_S = 1e6
"""A velocity beyond this is not one [m/s]."""

MARGIN = 0.5
"""How far outside its declared workspace, as a share of its size, a device may claim to be."""


_MODE_FLAGS = (0, int(Flag.ARMED), int(Flag.RELEASING))  # in the order of guard.Mode
_LIMITED = int(Flag.LIMITED)
_LATCHED = int(Flag.LATCHED)
_FALLBACK = int(Flag.FALLBACK)


def compile_walls(walls: Iterable[WallConfig], info: DeviceInfo, period_s: float) -> list[Wall]:
    """Walls on the axes of a device.

    Raises:
        ConfigError: a wall on an axis that the device has not, or on two axes of a device that has one.
    """
    compiled = []
    placed = ""
    for index, config in enumerate(walls):
        if len(info.axes) == 1:
            placed = placed or config.axis
            if config.axis != placed:
                raise ConfigError(
                    f'scene.walls[{index}].axis = "{config.axis}": {info.model} has a single axis, and the first '
                    f'wall has put it on "{placed}"'
                )
            axis = 0
        elif config.axis in info.axes:
            axis = info.axes.index(config.axis)
        else:
            raise ConfigError(
                f'scene.walls[{index}].axis = "{config.axis}": {info.model} has only {", ".join(info.axes)}'
            )
        compiled.append(Wall(config, axis, period_s))
    return compiled


class ControlTick:
    """The state of the control loop between samples.

    Args:
        scene: the walls.
        velocity: how velocity is estimated.
        guard: force limits and arming.
        info: what the device declares.
        make_law: a fresh law, one a contact.
        period_s: nominal time between ticks [s].
        ramp_s: duration of every ramp [s].

    Attributes:
        contacts: one a wall, in scene order.
        force_n: force applied by the last tick, one element an axis [N].
        requested_n: what the laws asked for [N].
        position_m, velocity_m_per_s: as used by the last tick.
        dt_s: time between the last two samples [s].
        fault: code of a fault raised by the last tick, 0 when there was none; the loop takes and clears it.
        fault_text: what there is to say about it.

    Raises:
        ConfigError: the scene does not fit the device.
    """

    def __init__(
        self,
        scene: SceneConfig,
        velocity: VelocityConfig,
        guard: Guard,
        info: DeviceInfo,
        make_law: Callable[[], RunningLaw],
        period_s: float,
        ramp_s: float,
    ) -> None:
        axes = len(info.axes)
        self.info = info
        self.guard = guard
        self.period_s = period_s
        self.ramp_s = ramp_s
        self.make_law = make_law
        self.contacts = [
            Contact(wall, make_law(), info.resolution_m) for wall in compile_walls(scene.walls, info, period_s)
        ]
        self.leaving: list[tuple[Contact, float]] = []
        self.estimators: list[Estimator] = [make_estimator(velocity, info.resolution_m) for _ in range(axes)]
        self.force_n = [0.0] * axes
        self.requested_n = [0.0] * axes
        self.position_m = [0.0] * axes
        self.velocity_m_per_s = [0.0] * axes
        self.dt_s = period_s
        self.fallback = False
        self.fault = 0
        self.fault_text = ""
        self._axes = range(axes)
        self._bounds_m = [
            (low - MARGIN * (high - low), high + MARGIN * (high - low)) for low, high in info.workspace_m
        ]
        self._time_ns = -1
        self._sequence = -1
        self._frozen = 0
        self._blind_gain = 0.0
        self._blind_from_n: list[float] = []

    @property
    def ramp_ticks(self) -> int:
        """Ticks that a ramp takes."""
        return max(1, round(self.ramp_s / self.period_s))

    @property
    def flags(self) -> int:
        """State bits of the tick record."""
        guard = self.guard
        flags = _MODE_FLAGS[guard.mode]
        if guard.limited:
            flags |= _LIMITED
        if guard.latched:
            flags |= _LATCHED
        if self.fallback:
            flags |= _FALLBACK
        return flags

    def start(self, sample: Sample) -> None:
        """Begin at a sample, at rest and without force; one that makes no sense is a fault at the first step."""
        self._time_ns = sample.time_ns
        self._sequence = sample.sequence
        for axis in self._axes:
            self.position_m[axis] = position_m = sample.position_m[axis]
            self.estimators[axis].start(position_m)
        for contact in self.contacts:
            contact.start(self.position_m[contact.wall.axis])

    def arm(self) -> bool:
        """Let forces through; a wall that is already pressed comes in by a ramp. False while latched."""
        if self.guard.mode is Mode.ARMED:
            return True
        if not self.guard.arm():
            return False
        self.fallback = False
        self.switch_law(self.make_law)
        return True

    def switch_law(self, make_law: Callable[[], RunningLaw]) -> None:
        """Put a law on every wall, without a step in force."""
        self.make_law = make_law
        for contact in self.contacts:
            contact.switch_law(make_law(), self.ramp_ticks)

    def release(self, ramp_s: float | None = None) -> None:
        """Ramp the force to zero and stay disarmed."""
        self.guard.release(self.ramp_s if ramp_s is None else ramp_s)

    def fail(self, code: EventCode, text: str) -> None:
        """Stop because of a fault: ramp the force to zero and latch."""
        if not self.fault:
            self.fault = code
            self.fault_text = text
        self.guard.release(self.ramp_s, latch=True)

    def fail_law(self, code: EventCode, text: str) -> None:
        """Put the damping fallback in the place of every law, and stop."""
        if not self.fallback:
            self.fallback = True
            for contact in self.contacts:
                contact.switch_law(self._fallback_law(), self.ramp_ticks)
        self.fail(code, text)

    def switch_scene(self, scene: SceneConfig) -> None:
        """Put other walls in place, without a step in force.

        A wall that did not change keeps its clock, law and books; one that changed in place keeps law and books; one
        that is gone fades out.

        Raises:
            ConfigError: the scene does not fit the device; nothing has changed then.
        """
        walls = compile_walls(scene.walls, self.info, self.period_s)
        old = dict(enumerate(self.contacts))
        contacts = []
        for index, wall in enumerate(walls):
            contact = old.get(index)
            if contact is not None and contact.wall.config == wall.config:
                del old[index]
            elif contact is not None and contact.wall.same_place(wall):
                del old[index]
                contact.switch_wall(wall, self.ramp_ticks)
            else:
                contact = Contact(wall, self._fallback_law() if self.fallback else self.make_law(), self.info.resolution_m)
                contact.start(self.position_m[wall.axis])
                contact.blend(self.ramp_ticks)
            contacts.append(contact)
        for contact in old.values():
            contact.switch_law(self._fallback_law(), self.ramp_ticks)
            self.leaving.append((contact, 1.0))
        self.contacts = contacts

    def step(self, sample: Sample, clock_dt_s: float) -> list[float]:
        """One tick.

        Args:
            sample: the newest state of the device.
            clock_dt_s: time since the last tick on this computer's clock, for devices without one [s].

        Returns:
            The force to write, one element an axis [N]; the same list every time.
        """
        seen = self._see(sample, clock_dt_s)
        if not seen or self._blind_gain > 0.0:
            return self._step_blind(self.period_s)
        if self._blind_from_n:
            self._blind_from_n = []
        position_m = self.position_m
        velocity_m_per_s = self.velocity_m_per_s
        requested_n = self.requested_n
        force_n = self.force_n
        dt_s = self.dt_s
        for axis in self._axes:
            requested_n[axis] = force_n[axis] = 0.0
        for contact in self.contacts:
            axis = contact.wall.axis
            contact.observe(position_m[axis], velocity_m_per_s[axis], dt_s)
        self._act()
        for contact in self.contacts:
            outward = contact.wall.outward
            axis = contact.wall.axis
            force_n[axis] += outward * contact.force_n
            requested_n[axis] += outward * contact.requested_n
        if self.leaving:
            self._step_leaving(dt_s)
        share = self.guard.share(force_n, dt_s)
        for axis in self._axes:
            force_n[axis] *= share
        limit_n = self.guard.max_force_n
        for contact in self.contacts:
            contact.settle(share, limit_n)
        return force_n

    def _fallback_law(self) -> RunningLaw:
        params = fallback.Params(damping_n_s_per_m=self.info.safe_damping_n_s_per_m)
        return RunningLaw(fallback, params)

    def _see(self, sample: Sample, clock_dt_s: float) -> bool:
        """Take a sample in; False when it makes no sense."""
        if self.info.has_clock:
            dt_s = (sample.time_ns - self._time_ns) * 1e-9
            frozen = dt_s <= 0.0
            self._time_ns = sample.time_ns
        else:
            dt_s = clock_dt_s
            frozen = self.info.has_sequence and sample.sequence == self._sequence
            self._sequence = sample.sequence
        if frozen:
            self._frozen += 1
            if self._frozen == FROZEN_TICKS:
                self.fail(EventCode.DEVICE_FROZEN, f"the device repeated the same sample {FROZEN_TICKS} times")
        elif self._frozen:
            self._frozen = 0
        self.dt_s = dt_s if 0.0 < dt_s < 1.0 else self.period_s
        speed_squared = 0.0
        for axis in self._axes:
            position_m = sample.position_m[axis]
            low_m, high_m = self._bounds_m[axis]
            if not low_m <= position_m <= high_m:  # false for NaN as well
                return False
            velocity_m_per_s = self.estimators[axis].update(position_m, dt_s, sample.velocity_m_per_s[axis])
            if not -MOST_M_PER_S < velocity_m_per_s < MOST_M_PER_S:
                return False
            self.position_m[axis] = position_m
            self.velocity_m_per_s[axis] = velocity_m_per_s
            speed_squared += velocity_m_per_s * velocity_m_per_s
        limit = self.guard.max_speed_m_per_s
        if speed_squared > limit * limit and self.guard.mode is Mode.ARMED:
            self.fail(EventCode.OVER_SPEED, f"{math.sqrt(speed_squared):.3g} m/s is above the limit of {limit:g} m/s")
        return True

    def _act(self) -> None:
        """Ask every law; a law that raises or returns nonsense is replaced, and all are asked again."""
        try:
            for contact in self.contacts:
                force_n = contact.act()
                if not -MOST_N < force_n < MOST_N:  # false for NaN as well
                    raise ArithmeticError(f"returned {force_n}")
        except Exception as error:  # noqa: BLE001 - a law is anybody's code, and a hand is in the device
            name = contact.law.module.__name__
            self.fail_law(EventCode.LAW_FAILED, f"law {name}: {type(error).__name__}: {error}")
            for contact in self.contacts:
                contact.act()

    def _step_leaving(self, dt_s: float) -> None:
        """Let walls fade out that a new scene no longer has."""
        staying = []
        for contact, gain in self.leaving:
            left = gain - dt_s / self.ramp_s
            if left <= 0.0:
                continue
            axis = contact.wall.axis
            contact.observe(self.position_m[axis], self.velocity_m_per_s[axis], dt_s)
            self.force_n[axis] += contact.wall.outward * left * contact.act()
            contact.settle(left, self.guard.max_force_n)
            staying.append((contact, left))
        self.leaving = staying

    def _step_blind(self, dt_s: float) -> list[float]:
        """Let the last force out quickly: without a position there is no wall."""
        force_n = self.force_n
        if not self._blind_from_n:
            self.fail(EventCode.SAMPLE_IMPOSSIBLE, "the device reported a position that is not possible")
            self._blind_from_n = list(force_n)
            self._blind_gain = 1.0
            for contact in self.contacts:
                contact.lose_sight()
        self._blind_gain -= dt_s / BLIND_RAMP_S
        if self._blind_gain <= 0.0:
            self._blind_gain = 0.0
            self.guard.drop()
        for axis in self._axes:
            force_n[axis] = self._blind_gain * self._blind_from_n[axis]
            self.requested_n[axis] = 0.0
        return force_n
