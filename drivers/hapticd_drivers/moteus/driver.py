"""Driver `moteus`: one to three motors behind moteus controllers."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field
from serial.tools import list_ports

from hapticd.device import Diagnosis, FoundDevice
from hapticd.errors import DeviceNotFoundError
from hapticd_drivers.moteus.crew import MoteusCrew, MoteusMotor
from hapticd_drivers.motors.adapters import found_interface, found_port
from hapticd_drivers.motors.ascii_link import AsciiLink
from hapticd_drivers.motors.crew import Crew
from hapticd_drivers.motors.driver import MotorDriver
from hapticd_drivers.motors.fdcanusb import DIALECT, USB
from hapticd_drivers.motors.link import AUTO, BusLink, can_interfaces, only
from hapticd_drivers.motors.options import MotorOptions
from hapticd_drivers.motors.socketcan import open_can

LEAST_TICKS = 4.0
"""Periods that a watchdog has to last: a late tick is no reason to let go."""

UP = (
    "sudo ip link set {} up type can bitrate 1000000 dbitrate 5000000 sjw 10 dsjw 5 sample-point 0.666 "
    "dsample-point 0.666 restart-ms 1000 fd on"
)
"""The line for a shell that brings an interface up, as the maker gives it."""


class MoteusOptions(MotorOptions):
    """Which controllers, and when they let go by themselves."""

    watchdog_ms: float = Field(
        20.0, ge=1.0, le=1000.0, description="a controller that hears no command for this time lets go by itself [ms]"
    )
    brake: bool = Field(
        False, description="without force the windings are shorted, so that the handle brakes; otherwise it is free"
    )


class Moteus(MotorDriver[MoteusOptions]):
    """One to three motors behind moteus controllers."""

    Options = MoteusOptions
    NAME = "moteus"
    ABSENT = "plug the fdcanusb in, or bring the CAN interface up (docs/moteus.md)"

    @classmethod
    def check(cls, options: MoteusOptions, period_s: float) -> None:
        """Refuse axes that cannot be, and a watchdog that this rate would trip.

        Args:
            options: as the configuration gives them.
            period_s: time between ticks [s].

        Raises:
            ValueError: says which key.
        """
        super().check(options, period_s)
        for index, axis in enumerate(options.axes):
            if not axis.id:
                raise ValueError(f"device.options.axes[{index}].id = 0: a controller's address is 1 to 127")
        if options.watchdog_ms < LEAST_TICKS * 1e3 * period_s:
            raise ValueError(
                f"device.options.watchdog_ms = {options.watchdog_ms:g}: at least {LEAST_TICKS * 1e3 * period_s:g}, "
                f"{LEAST_TICKS:g} ticks at this loop.rate_hz"
            )

    @classmethod
    def find(cls, options: MoteusOptions | None = None) -> list[FoundDevice]:
        """Every adapter that moteus controllers may be behind; none is opened.

        Args:
            options: which one is meant; None: any.
        """
        wanted = AUTO if options is None else options.channel
        adapters = _adapters()
        if wanted.startswith("/") and Path(wanted).exists() and wanted not in dict(adapters):
            return [found_port("fdcanusb", wanted)]  # by another name, as those of /dev/serial/by-id
        return [
            *(found_port("fdcanusb", path, serial) for path, serial in adapters if wanted in (AUTO, path)),
            *(found_interface(name, UP.format(name), fd=True) for name in can_interfaces() if wanted in (AUTO, name)),
        ]

    @classmethod
    def diagnose(cls, options: MoteusOptions | None = None) -> list[Diagnosis]:
        """Whether it is clear which adapter is meant; opens none.

        Args:
            options: those of the configuration.
        """
        if options is None or options.channel != AUTO:
            return []
        try:
            _channel()
        except DeviceNotFoundError as error:
            if _adapters() or can_interfaces():  # else there is just no adapter
                mend = "# in the configuration, [device.options]: channel = ...; hapticd devices moteus lists them"
                return [Diagnosis("problem", str(error).removeprefix("moteus: "), (mend,))]
        return []

    def _connect(self) -> BusLink:
        channel = _channel() if self.options.channel == AUTO else self.options.channel
        if channel.startswith("/"):
            return AsciiLink(self.NAME, channel, DIALECT)
        return open_can(self.NAME, channel, True, UP.format(channel))

    def _gather(self, link: BusLink) -> Crew:
        options = self.options
        motors = [MoteusMotor(drum) for drum in self._drums]
        return MoteusCrew(link, self, self.NAME, motors, 1e-3 * options.watchdog_ms, options.brake)

    @property
    def _host_silence_ms(self) -> float:
        return self.options.watchdog_ms


def _adapters() -> list[tuple[str, str]]:
    """Path and serial number of every port on USB that is an fdcanusb."""
    return [
        (port.device, port.serial_number or "")
        for port in sorted(list_ports.comports())
        if port.vid is not None
        and (usb := f"{port.vid:04x}:{port.pid:04x}") in USB
        and (usb != USB[0] or "fdcanusb" in (port.product or ""))
    ]


def _channel() -> str:
    adapters = [path for path, _ in _adapters()]
    return only("moteus", adapters or can_interfaces(), "fdcanusb and no CAN interface")
