"""The state of a device at one moment."""

from __future__ import annotations


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
