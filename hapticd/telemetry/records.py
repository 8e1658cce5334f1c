"""What a daemon publishes, a class a topic: a key of the message is a field here.

The whole wire stands in one module, to be read beside docs/telemetry.md.
"""

from __future__ import annotations

import bisect
import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self, TypeAlias

from hapticd.telemetry.wire import SCHEMA, Topic


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
        scene_work_j: work that changes of objects did on their springs, and clients on what they drive [J]; with this
            taken off, `energy_j` is what is stored and dissipated less what was generated.
        friction_j: energy that slipping on objects took, a part of what is dissipated [J].
        friction_energy_j: in the springs along the surfaces of objects now, a part of what is stored [J].
        invalid: a value was not finite and stands here as 0.
    """

    topic: ClassVar[Topic] = Topic.ENERGY

    timestamp: float
    seq: int
    energy_j: float
    spring_energy_j: float
    dissipated_j: float
    generated_j: float
    scene_work_j: float = 0.0
    friction_j: float = 0.0
    friction_energy_j: float = 0.0
    invalid: bool = False


@dataclass(frozen=True, slots=True)
class Damping:
    """One tick: what the law did, one element a wall, then one an object, then one a coupling and a force.

    Attributes:
        timestamp: seconds since the epoch at the tick's deadline [s].
        seq: tick number.
        damping_n_s_per_m: damping of the law [N s/m].
        in_contact: whether the device was inside the wall or object, or the coupling or force was in force.
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
class Touch:
    """One tick: an object that was touched, or a coupling or force that was in force. A tick has one for each of them.

    Attributes:
        timestamp: seconds since the epoch at the tick's deadline [s].
        seq: tick number.
        force_n: force that it applied to the device, one element an axis [N].
        object: index of the object; `Status.object_name` has its name. -1: a coupling or a force, which has of what
            follows the last three only.
        proxy_m: the point on its surface that pulled the device back [m].
        normal: from the device to the surface, outward, a unit vector.
        depth_m: how far that was [m].
        sliding: whether friction slipped.
        carrier: of the objects that overlap and are one solid, the one that carried the force: `object` is the first of
            them. -1 from a daemon that does not tell.
        inside: those of them that the device was in.
        remote: index of what a client drove; `Status.remote_name` has its name. -1: no client drives it.
        remote_seq: the client's own number of the message that was in force; -1: none was.
        target_m: where the followed target, or the origin of the object, was; of a force 0 [m].
        invalid: a value was not finite and stands here as 0.
    """

    topic: ClassVar[Topic] = Topic.CONTACT

    timestamp: float
    seq: int
    force_n: tuple[float, ...]
    object: int = -1
    proxy_m: tuple[float, ...] = ()
    normal: tuple[float, ...] = ()
    depth_m: float = 0.0
    sliding: bool = False
    carrier: int = -1
    inside: tuple[int, ...] = ()
    remote: int = -1
    remote_seq: int = -1
    target_m: tuple[float, ...] = ()
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
        dt_s: time since the sample before, on the device's clock where it has one; 0 where it had nothing new [s].
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
    """One completed cycle of energy exchange with a wall or an object.

    Attributes:
        timestamp: seconds since the epoch at its end [s].
        seq: tick number of its end.
        contact: index of the wall; objects count behind the walls.
        cycle: number of the cycle there.
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
    """Buttons, gripper and wrist; what the device does not have is None or empty.

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
    """One event: a code, a text, and fields of its own.

    Attributes:
        timestamp: seconds since the epoch at its tick [s].
        seq: tick number.
        code: `hapticd.tick.event.EventCode`; a newer daemon may know more of them.
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
    """Ticks that did not arrive; it comes before the first record after them.

    Attributes:
        topic: of those ticks.
        after: last tick before the gap.
        seq: first tick after it.
        missing: ticks in between; 0 when the daemon started anew and counts from the beginning, perhaps past `after`.
    """

    topic: Topic
    after: int
    seq: int
    missing: int


LATE_EDGES_US = (10, 20, 40, 80, 160, 320, 640, 1280, 2560, 5120, 10240)
"""Edges of the histogram of late ticks [us].

Bin 0 counts ticks less than 10 us late, bin i those from edge i-1 to below edge i, the last one those of
10.24 ms and more.
"""

LATE_US = 160
"""Ticks that started this late or later are called late [us]; an edge of the histogram."""


def late_ticks(histogram: Sequence[int]) -> int:
    """Ticks that were at least `LATE_US` late.

    Args:
        histogram: bins of `LATE_EDGES_US`; it may be empty.
    """
    return sum(histogram[LATE_EDGES_US.index(LATE_US) + 1 :])


class LateHistogram:
    """Counts how late ticks were.

    Attributes:
        counts: one a bin, one more than there are edges.
        sum_us: all ticks together [us].
        max_us: the latest tick [us].
    """

    __slots__ = ("counts", "max_us", "sum_us")

    def __init__(self) -> None:
        self.counts = [0] * (len(LATE_EDGES_US) + 1)
        self.sum_us = 0.0
        self.max_us = 0.0

    def add(self, late_us: float) -> None:
        """Count one tick."""
        self.counts[bisect.bisect_right(LATE_EDGES_US, late_us)] += 1
        self.sum_us += late_us
        if late_us > self.max_us:
            self.max_us = late_us


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """State of the daemon, once a second and at every change. Counts run since the daemon started.

    Attributes:
        timestamp: when it was said [s since the epoch]; the publisher fills it in.
        seq: last tick published, -1 before the first; the publisher fills it in.
        schema: version of the wire contract; the publisher fills it in.
        every_ticks: one tick in this many is published; the publisher fills it in.
        version: of hapticd.
        instance: name of the daemon's instance.
        started_timestamp: when the daemon started [s since the epoch].
        rate_hz: ticks a second that the loop is set to [Hz].
        measured_rate_hz: ticks a second that it ran lately [Hz]; 0 while unknown.
        ticks: ticks that it ran.
        overruns: deadlines that it skipped.
        late_histogram: ticks by how late they were, bins of `LATE_EDGES_US`.
        late_sum_us: all that they were late, together [us].
        late_max_us: the latest of them [us].
        busy_max_us: the longest tick body [us].
        ring_drops: ticks that the supervisor was too slow to fetch.
        event_drops: events that it was too slow to fetch.
        requests_refused: requests on the control socket that were not done.
        armed: forces are let through.
        fallback: the law failed, damping stands in for it.
        releasing: the force is being ramped out.
        latched: stopped by a fault until cleared.
        law: name of the running law.
        law_index: its activation, counted up at each switch.
        driver: name of the driver.
        device: what the device is.
        serial: its serial number, "" without one.
        simulated: no real device.
        calibrated: the device knows where it is; until then its positions are nothing to rely on, and it takes no
            force.
        device_metrics: numbers that its driver keeps, such as frames lost, since it was opened.
        accuracy: the model that a simulated device got for the accuracy asked for, and why; "" when none was asked for.
        axes: names of its axes, in the order of positions and forces.
        origin_m: where the device places the point that positions count from, an axis each [m]; 0 until tared.
        max_force_n: largest force that the guard lets through [N]; 0 when there is no limit.
        wall_axis: axis of each wall, in scene order.
        wall_position_m: where each wall is on its axis [m].
        wall_stiffness_n_per_m: its stiffness now, with the changes over time that the file names [N/m].
        object_name: name of each object, in scene order.
        object_shape: its shape.
        object_position_m: where it is, three numbers an object [m].
        object_stiffness_n_per_m: its stiffness [N/m].
        remote_name: name of each object, coupling and force that clients may drive, in that order.
        remote_kind: `object`, `coupling` or `force`.
        remote_owner: the client that it belongs to now; "" when to none.
        remote_messages: messages of clients that were taken for it.
        remote_refused: messages that were refused: wrong in themselves, or of another client than its owner.
        remote_late: messages that were passed over: behind a newer one, older than `hold_s`, or of a client that had
            gone.
        remote_age_histogram: messages by how long after their sending a tick was done with them; bins of
            `hapticd.remote.delays.DELAY_EDGES_MS`, one name after the other.
        remote_round_trip_histogram: messages by how long after the tick that they answer they were in force; the same
            bins.
        remote_strays: messages that made no sense or named nothing that the scene has.
        config_file: the file that is in force.
        config_hash: of its content.
        realtime: scheduling and memory are as the loop needs them.
        warnings: what stands and should be known, a line each, for example "not real-time: ...".
        device_lost_timestamp: since when the device is gone and looked for [s since the epoch]; 0 while it is there.
        next_try_timestamp: when it is looked for again [s since the epoch]; 0 while it is there.
        fault_code: of the last fault since the daemon started; 0 when there was none.
        fault_text: what there was to say about it.
        fault_timestamp: when it happened [s since the epoch]; 0 when there was none.
        faults: how many there were.
        fault_records: fault records written since the daemon started.
    """

    topic: ClassVar[Topic] = Topic.STATUS

    timestamp: float = 0.0
    seq: int = -1
    schema: int = SCHEMA
    every_ticks: int = 1
    version: str = ""
    instance: str = ""
    started_timestamp: float = 0.0
    rate_hz: float = 0.0
    measured_rate_hz: float = 0.0
    ticks: int = 0
    overruns: int = 0
    late_histogram: tuple[int, ...] = ()
    late_sum_us: float = 0.0
    late_max_us: float = 0.0
    busy_max_us: float = 0.0
    ring_drops: int = 0
    event_drops: int = 0
    requests_refused: int = 0
    armed: bool = False
    fallback: bool = False
    releasing: bool = False
    latched: bool = False
    law: str = ""
    law_index: int = 0
    driver: str = ""
    device: str = ""
    serial: str = ""
    simulated: bool = False
    calibrated: bool = True
    device_metrics: dict[str, float] = field(default_factory=dict)
    accuracy: str = ""
    axes: tuple[str, ...] = ()
    origin_m: tuple[float, ...] = ()
    max_force_n: float = 0.0
    wall_axis: tuple[str, ...] = ()
    wall_position_m: tuple[float, ...] = ()
    wall_stiffness_n_per_m: tuple[float, ...] = ()
    object_name: tuple[str, ...] = ()
    object_shape: tuple[str, ...] = ()
    object_position_m: tuple[float, ...] = ()
    object_stiffness_n_per_m: tuple[float, ...] = ()
    remote_name: tuple[str, ...] = ()
    remote_kind: tuple[str, ...] = ()
    remote_owner: tuple[str, ...] = ()
    remote_messages: tuple[int, ...] = ()
    remote_refused: tuple[int, ...] = ()
    remote_late: tuple[int, ...] = ()
    remote_age_histogram: tuple[int, ...] = ()
    remote_round_trip_histogram: tuple[int, ...] = ()
    remote_strays: int = 0
    config_file: str = ""
    config_hash: str = ""
    realtime: bool = False
    warnings: tuple[str, ...] = ()
    device_lost_timestamp: float = 0.0
    next_try_timestamp: float = 0.0
    fault_code: int = 0
    fault_text: str = ""
    fault_timestamp: float = 0.0
    faults: int = 0
    fault_records: int = 0

    @classmethod
    def of(cls, said: Mapping[str, Any]) -> Self:
        """The status in an answer; a daemon of another version says more, or less."""
        known = {each.name for each in dataclasses.fields(cls)}
        return cls(**{key: value for key, value in said.items() if key in known})

    def as_map(self) -> dict[str, Any]:
        """Keys and values, for `Publisher.status`."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}


Tick: TypeAlias = Position | Energy | Damping | Timing
Sent: TypeAlias = Tick | Touch | Cycle | Input | Event | Status
Record: TypeAlias = Sent | Gap
