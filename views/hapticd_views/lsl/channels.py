"""The channels of the stream of ticks: one a number, with its name and unit."""

from __future__ import annotations

from dataclasses import dataclass

from hapticd.telemetry.records import Damping, Energy, Position, Status, Timing

_AXIS_BY_AXIS = (
    ("position_m", "m", "Position"),
    ("velocity_m_per_s", "m/s", "Velocity"),
    ("force_n", "N", "Force"),
    ("force_requested_n", "N", "Force"),
)


@dataclass(frozen=True, slots=True)
class Layout:
    """What a tick consists of, and how many come a second; a stream can change neither while it lives.

    Attributes:
        axes: of the device, by name.
        walls: how many there are.
        rate_hz: ticks a second that are published [Hz].
    """

    axes: tuple[str, ...]
    walls: int
    rate_hz: float

    @classmethod
    def of(cls, tick: JoinedTick, status: Status) -> Layout:
        """The layout of a tick; an axis that the status does not name has its number for a name."""
        count = len(tick.position.position_m)
        axes = status.axes if len(status.axes) == count else tuple(str(at) for at in range(count))
        return cls(axes, len(tick.damping.damping_n_s_per_m), status.rate_hz / max(1, status.every_ticks))

    @property
    def channels(self) -> tuple[tuple[str, str, str], ...]:
        """Name, unit and LSL type of each channel: names are the keys of docs/telemetry.md, and which axis or wall."""
        named = [("seq", "ticks", "Count")]
        for key, unit, kind in _AXIS_BY_AXIS:
            named += [(f"{key}_{axis}", unit, kind) for axis in self.axes]
        named += [(key, "J", "Energy") for key in ("energy_j", "spring_energy_j", "dissipated_j", "generated_j")]
        named += [(f"damping_n_s_per_m_{wall}", "N s/m", "Damping") for wall in range(self.walls)]
        named += [(f"in_contact_{wall}", "", "Flag") for wall in range(self.walls)]
        return (*named, ("late_us", "us", "Time"))


@dataclass(frozen=True, slots=True)
class JoinedTick:
    """The four messages of one tick.

    Attributes:
        position, energy, damping, timing: of the same `seq`.
    """

    position: Position
    energy: Energy
    damping: Damping
    timing: Timing

    @property
    def sample(self) -> list[float]:
        """A value a channel, in the order of `Layout.channels`."""
        position, energy = self.position, self.energy
        return [
            float(position.seq),
            *position.position_m,
            *position.velocity_m_per_s,
            *position.force_n,
            *position.force_requested_n,
            energy.energy_j,
            energy.spring_energy_j,
            energy.dissipated_j,
            energy.generated_j,
            *self.damping.damping_n_s_per_m,
            *map(float, self.damping.in_contact),
            self.timing.late_us,
        ]

    @property
    def time_s(self) -> float:
        """When the tick was due, on LSL's clock, which is CLOCK_MONOTONIC [s]."""
        return self.timing.deadline_ns * 1e-9
