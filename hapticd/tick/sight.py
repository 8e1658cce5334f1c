"""Whether it is known where the device is, and the last force that is let out while it is not."""

from __future__ import annotations

from hapticd.tick.guard import BLIND_RAMP_S, let_out


class Sight:
    """What is known of the device's place between samples, for a device with some axes.

    Args:
        axes: how many.

    Attributes:
        blind: the last sample made no sense.
        calibrated: the device knew where it is when this was last looked at, which is while it is disarmed.
        gain: what is left of the force that was applied when the device was last seen, 0 to 1.
    """

    __slots__ = ("_excused", "_from_n", "blind", "calibrated", "gain")

    def __init__(self, axes: int) -> None:
        self.blind = self.calibrated = True
        self.gain = 0.0
        self._excused = False
        self._from_n = [0.0] * axes

    def start(self, seen: bool, calibrated: bool) -> None:
        """Begin at a sample.

        Args:
            seen: it makes sense.
            calibrated: the device knows where it is.
        """
        self.blind = not seen
        self.calibrated = calibrated
        self._excused = not calibrated

    def is_fault(self, calibrated: bool) -> bool:
        """Whether it is a fault that a disarmed device is not seen now.

        One that is not calibrated does not know where it is, and that is none as long as it has no force.
        """
        return calibrated and (self._excused or not self.blind)

    def let_out(self, force_n: list[float], calibrated: bool, passed_s: float) -> None:
        """Let the last force out, in place: without a position there is no wall.

        Args:
            force_n: force applied by the tick before, one element an axis [N].
            calibrated: the device knows where it is.
            passed_s: time that this tick counts for [s].
        """
        self._excused = not calibrated
        if not self.blind:
            self.blind = True
            self.gain = 1.0
            self._from_n = list(force_n)
        self.gain = let_out(self.gain, BLIND_RAMP_S, passed_s)
        for axis, from_n in enumerate(self._from_n):
            force_n[axis] = self.gain * from_n
