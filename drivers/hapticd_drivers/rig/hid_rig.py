"""Driver `hid-rig`: a rig that speaks in raw HID reports, through hidapi (docs/hid-rig.md)."""

from __future__ import annotations

from hapticd.device import Diagnosis, FoundDevice
from hapticd_drivers.rig import hid_rig_discovery as discovery
from hapticd_drivers.rig.driver import RigDriver
from hapticd_drivers.rig.hid_rig_link import HidLink
from hapticd_drivers.rig.hid_rig_options import HidRigOptions
from hapticd_drivers.rig.link import Link


class HidRig(RigDriver[HidRigOptions]):
    """A rig on USB, as a Teensy with the RawHID interface makes one."""

    Options = HidRigOptions
    NAME = "hid-rig"
    ABSENT = "plug the rig in; lsusb shows 16c0:0486, or the numbers of device.options"

    @classmethod
    def find(cls, options: HidRigOptions | None = None) -> list[FoundDevice]:
        """Every rig that is there, whether it can be used or not; each is opened for a moment, and hears nothing.

        Args:
            options: which numbers to look for.
        """
        return discovery.find_devices(options or HidRigOptions())

    @classmethod
    def diagnose(cls, options: HidRigOptions | None = None) -> list[Diagnosis]:
        """Which of hidapi's backends is taken here, and whether it is there; opens nothing.

        Args:
            options: those of the configuration.
        """
        return discovery.diagnose(options or HidRigOptions())

    def _connect(self) -> Link:
        return HidLink(discovery.open_device(self.options))
