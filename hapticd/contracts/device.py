"""What is known of a device: that it is there, and what it declares of itself."""

from __future__ import annotations

from dataclasses import dataclass


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
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class FoundDevice:
    """A device that is there, as `Driver.find` lists it.

    Attributes:
        model: what it is.
        serial: its serial number; "" when it has none or could not be asked.
        where: where it is plugged in, for people; "" when nobody tells.
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
