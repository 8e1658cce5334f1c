"""What a daemon publishes, a class a topic: a key of the message is a field here."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, TypeAlias

from hapticd.telemetry.status import Status
from hapticd.telemetry.wire import Topic


@dataclass(frozen=True, slots=True)
class Position:
    """One tick: where the device was and what pushed it, one element an axis.

    Attributes:
        timestamp: seconds since the epoch at the tick's deadline [s].
        seq: tick number.
        position_m: position [m].
        velocity_m_per_s: estimated velocity [m/s].
        force_n: force applied to the device [N].
        force_requested_n: force asked for before the guard [N].
        invalid: a value was not finite and stands here as 0.
    """

    topic: ClassVar[Topic] = Topic.POSITION

    timestamp: float
    seq: int
    position_m: tuple[float, ...]
    velocity_m_per_s: tuple[float, ...]
    force_n: tuple[float, ...]
    force_requested_n: tuple[float, ...]
    invalid: bool = False


@dataclass(frozen=True, slots=True)
class Energy:
    """One tick: the energy ledger of all contacts.

    Attributes:
        timestamp: seconds since the epoch at the tick's deadline [s].
        seq: tick number.
        energy_j: energy into the virtual environment, with the applied force [J].
        spring_energy_j: stored in its springs [J].
        dissipated_j: taken by wall damping and law [J].
        generated_j: made by sampling and hold [J].
        invalid: a value was not finite and stands here as 0.
    """

    topic: ClassVar[Topic] = Topic.ENERGY

    timestamp: float
    seq: int
    energy_j: float
    spring_energy_j: float
    dissipated_j: float
    generated_j: float
    invalid: bool = False


@dataclass(frozen=True, slots=True)
class Damping:
    """One tick: what the law did, one element a wall.

    Attributes:
        timestamp: seconds since the epoch at the tick's deadline [s].
        seq: tick number.
        damping_n_s_per_m: damping of the law [N s/m].
        in_contact: whether the device was inside the wall.
        felt_mass_kg: mass that the law has identified [kg]; 0 while unknown.
        invalid: a value was not finite and stands here as 0.
    """

    topic: ClassVar[Topic] = Topic.DAMPING

    timestamp: float
    seq: int
    damping_n_s_per_m: tuple[float, ...]
    in_contact: tuple[bool, ...]
    felt_mass_kg: tuple[float, ...]
    invalid: bool = False


@dataclass(frozen=True, slots=True)
class Timing:
    """One tick: how punctual it was.

    Attributes:
        timestamp: seconds since the epoch at the tick's deadline [s].
        seq: tick number.
        deadline_ns: when it was due [ns of CLOCK_MONOTONIC].
        late_us: how late it started [us].
        busy_us: how long its body took [us].
        dt_s: time since the tick before, on the device's clock where it has one [s].
        invalid: a value was not finite and stands here as 0.
    """

    topic: ClassVar[Topic] = Topic.TIMING

    timestamp: float
    seq: int
    deadline_ns: int
    late_us: float
    busy_us: float
    dt_s: float
    invalid: bool = False


@dataclass(frozen=True, slots=True)
class Cycle:
    """One completed cycle of energy exchange with a wall.

    Attributes:
        timestamp: seconds since the epoch at its end [s].
        seq: tick number of its end.
        contact: index of the wall.
        cycle: number of the cycle at this wall.
        energy_j: energy at its end [J].
        generated_j: energy that it generated [J].
        damping_n_s_per_m: damping of the law when it ended [N s/m].
        duration_s: how long it took [s].
        invalid: a value was not finite and stands here as 0.
    """

    topic: ClassVar[Topic] = Topic.CYCLE

    timestamp: float
    seq: int
    contact: int
    cycle: int
    energy_j: float
    generated_j: float
    damping_n_s_per_m: float
    duration_s: float
    invalid: bool = False


@dataclass(frozen=True, slots=True)
class Input:
    """Buttons, gripper and wrist; what the device has not is None or empty.

    Attributes:
        timestamp: seconds since the epoch at the tick's deadline [s].
        seq: tick number.
        buttons: bit i is button i.
        gripper_m: opening [m].
        orientation: rotation matrix row by row.
        invalid: a value was not finite and stands here as 0.
    """

    topic: ClassVar[Topic] = Topic.INPUT

    timestamp: float
    seq: int
    buttons: int | None = None
    gripper_m: float | None = None
    orientation: tuple[float, ...] = ()
    invalid: bool = False


@dataclass(frozen=True, slots=True)
class Event:
    """Something happened.

    Attributes:
        timestamp: seconds since the epoch at its tick [s].
        seq: tick number.
        code: `hapticd.contracts.event.EventCode`; a newer daemon may know more of them.
        text: one line for people.
        fields: numbers and names that belong to it.
    """

    topic: ClassVar[Topic] = Topic.EVENT

    timestamp: float
    seq: int
    code: int
    text: str
    fields: dict[str, float | int | str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Gap:
    """Ticks that did not arrive, told before the first record after them.

    Attributes:
        topic: of those ticks.
        after: last tick before the gap.
        seq: first tick after it.
        missing: ticks in between; 0 when the daemon started anew and counts from the beginning.
    """

    topic: Topic
    after: int
    seq: int
    missing: int


Tick: TypeAlias = Position | Energy | Damping | Timing
Sent: TypeAlias = Tick | Cycle | Input | Event | Status
Record: TypeAlias = Sent | Gap
