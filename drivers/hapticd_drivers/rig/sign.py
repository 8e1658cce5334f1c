"""Whether the motors of a device are known to push the right way."""

from __future__ import annotations

from hapticd.errors import DeviceFaultError, DriverStateError
from hapticd_drivers.rig import motion


class Sign:
    """What is known of it; a wall pulls where a motor pushes the wrong way.

    Args:
        name: of the driver, which errors begin with.
        checked: the configuration says that a calibration has passed.

    Attributes:
        checked: a calibration has passed, or the configuration says so, and none has shown otherwise since.
    """

    def __init__(self, name: str, checked: bool) -> None:
        self.checked = checked
        self._name = name

    def demand(self) -> None:
        """Refuse to let forces through as long as it is not known.

        Raises:
            DriverStateError: says how to find out.
        """
        if not self.checked:
            raise DriverStateError(
                f"{self._name}: it has not been checked that the motors push the right way: clear the workspace, then "
                "`hapticd calibrate`, which moves the arm; once it has passed, device.options.sign_checked = true "
                "says so for good"
            )

    def check(self, drive: motion.Drive) -> None:
        """Nudge the handle along one axis.

        Raises:
            DeviceFaultError: the motor is reversed, does not move the handle, or something else moves it.
        """
        try:
            motion.check_sign(drive)
        except DeviceFaultError:
            self.checked = False
            raise
