"""What is known of a device: that it is there, and what it declares of itself."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

MOST_METRICS = 64
"""Most metrics that a driver may keep."""


@dataclass(frozen=True, slots=True)
class Metric:
    """A number that a driver keeps; it is 0 when the driver is made.

    Attributes:
        name: its key in `hapticd/status`, with the unit where it has one: `lost_frames`, `echo_us`.
        meaning: what it counts or measures, for people.
        warns: it only ever grows, and that it grew is worth a warning.
    """

    name: str
    meaning: str
    warns: bool = False


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """One thing that is so.

    Attributes:
        mark: `ok`; `advice`, it works but could be better; `problem`, no device can be used.
        text: what is so, in one line.
        mend: lines for a shell that mend it, as they stand; one that no command can mend is a comment, `# ...`.
    """

    mark: Literal["ok", "advice", "problem"]
    text: str
    mend: tuple[str, ...] = ()


class Sample:
    """The newest state of a device; one object, filled anew at each read.

    Attributes:
        position_m: position of each axis [m].
        velocity_m_per_s: the device's own velocity of each axis [m/s]; zeros unless `has_velocity`.
        time_ns: device time [ns]; -1 without a clock.
        sequence: device count; -1 without one.
        buttons: bit i is button i.
        gripper_m: opening [m]; 0 without one.
        orientation: rotation matrix, row by row (9 elements); identity without a wrist.
        calibrated: False while the device does not know where it is. Its positions are nothing to rely on then, and a
            driver refuses to enable it.
    """

    __slots__ = (
        *("buttons", "calibrated", "gripper_m", "orientation", "position_m", "sequence", "time_ns"),
        "velocity_m_per_s",
    )

    def __init__(self, axes: int) -> None:
        self.position_m = [0.0] * axes
        self.velocity_m_per_s = [0.0] * axes
        self.time_ns = -1
        self.sequence = -1
        self.buttons = 0
        self.gripper_m = 0.0
        self.orientation = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
        self.calibrated = True

    def __repr__(self) -> str:
        return f"Sample({', '.join(f'{name}={getattr(self, name)!r}' for name in self.__slots__)})"


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """What a device declares of itself once it is open.

    Attributes:
        model: what it is, for people.
        serial: serial number, "" when it has none.
        axes: name of each translation axis in the order of positions and forces; a device with a single axis has it
            wherever the scene puts the wall.
        max_force_n: largest force that may be commanded, magnitude over all axes [N]; `inf` only when simulated.
        resolution_m: smallest step that the position can show [m]; 0 when continuous.
        workspace_m: lowest and highest position of each axis [m].
        nominal_rate_hz: rate the device is made for [Hz].
        safe_damping_n_s_per_m: digital damping that is stable on this device at its nominal rate, for the fallback.
        host_silence_ms: after how long without the host the device drops its force by itself [ms]; None: never.
        simulated: no hand can be hurt: arms itself, and the simulation safety profile is allowed.
        buttons: number of buttons.
        has_gripper, has_orientation, has_velocity: whether samples carry them.
        has_clock: samples carry the device's own time.
        has_sequence: samples carry the device's own count.
        start_m: where a simulated device with three axes starts, in the scene [m]; empty for any other.
        notes: what the user should know while it is used, a line each, such as what slows it down and how to end that.
    """

    model: str
    serial: str
    axes: tuple[str, ...]
    max_force_n: float
    resolution_m: float
    workspace_m: tuple[tuple[float, float], ...]
    nominal_rate_hz: float
    safe_damping_n_s_per_m: float
    host_silence_ms: float | None
    simulated: bool = False
    buttons: int = 0
    has_gripper: bool = False
    has_orientation: bool = False
    has_velocity: bool = False
    has_clock: bool = False
    has_sequence: bool = False
    start_m: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def flaw(self) -> str:
        """What no device can be, as `key = value: what is allowed`; "" when nothing is wrong."""
        axes, spans = self.axes, self.workspace_m
        found = len(spans) == len(axes) and all(-math.inf < low < high < math.inf for low, high in spans)
        largest_n = math.inf if self.simulated else math.nextafter(math.inf, 0.0)
        allowed = (
            ("axes", 0 < len(set(axes)) == len(axes), "must be one name an axis"),
            ("max_force_n", 0.0 < self.max_force_n <= largest_n, "must be more than 0 N, infinite only when simulated"),
            ("resolution_m", 0.0 <= self.resolution_m < math.inf, "must be 0 m or more"),
            ("workspace_m", found, "must be a lowest and a highest position for each axis"),
            ("nominal_rate_hz", 0.0 < self.nominal_rate_hz < math.inf, "must be more than 0 Hz"),
            ("safe_damping_n_s_per_m", 0.0 <= self.safe_damping_n_s_per_m < math.inf, "must be 0 N s/m or more"),
            ("host_silence_ms", self.host_silence_ms is None or self.host_silence_ms >= 0.0, "must be 0 ms or more"),
        )
        return next((f"{key} = {getattr(self, key)}: {words}" for key, good, words in allowed if not good), "")


@dataclass(frozen=True, slots=True)
class FoundDevice:
    """A device that is there, as `Driver.find` lists it.

    Attributes:
        model: what it is.
        serial: its serial number; "" when it has none or could not be asked.
        where: where it is plugged in, for people; "" when that is not known.
        problem: why it cannot be used now; "" when it can.
        note: what is to be known before it is used; "" when there is nothing.
        mend: lines for a shell that end the problem, as they stand; one that no command can mend is a comment, `# ...`.
    """

    model: str
    serial: str
    where: str = ""
    problem: str = ""
    note: str = ""
    mend: tuple[str, ...] = ()
