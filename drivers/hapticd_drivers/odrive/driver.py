"""Driver `odrive`: one to three motors behind ODrives."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from hapticd.device import Diagnosis, FoundDevice
from hapticd.errors import DeviceNotFoundError
from hapticd_drivers.motors import slcan
from hapticd_drivers.motors.adapters import found_interface, found_port
from hapticd_drivers.motors.ascii_link import AsciiLink
from hapticd_drivers.motors.crew import Crew
from hapticd_drivers.motors.driver import MotorDriver
from hapticd_drivers.motors.link import AUTO, BusLink, can_interfaces, only
from hapticd_drivers.motors.options import MotorOptions
from hapticd_drivers.motors.socketcan import open_can
from hapticd_drivers.odrive.cansimple import MOST_ADDRESS
from hapticd_drivers.odrive.crew import OdriveCrew

UP = "sudo ip link set {} up type can bitrate {} restart-ms 1000"
"""The line for a shell that brings an interface up."""

LEAST_TICKS = 4.0
"""Periods that a watchdog has to last: a late tick is no reason to let go."""

STATE_BITS = 135
TORQUE_BITS = 100
"""Longest frames of a state and of a torque on the bus, stuffing included [bit]."""


class OdriveOptions(MotorOptions):
    """Which ODrives, how fast their bus is, and when they let go by themselves."""

    bitrate: Literal[250_000, 500_000, 1_000_000] = Field(
        1_000_000, description="of the bus, as the ODrives are set up: can.config.baud_rate [bit/s]"
    )
    watchdog_ms: float | None = Field(
        None,
        ge=1.0,
        le=1000.0,
        description="watchdog of the ODrives, as set up: axis0.config.watchdog_timeout [ms]; a calibration tries it; "
        "unset: they have none, and device.accept_no_watchdog has to say that this is known",
    )


class Odrive(MotorDriver[OdriveOptions]):
    """One to three motors behind ODrives."""

    Options = OdriveOptions
    NAME = "odrive"
    ABSENT = "plug the adapter in and bring its CAN interface up (docs/odrive.md)"

    @classmethod
    def check(cls, options: OdriveOptions, period_s: float) -> None:
        """Refuse axes that cannot be, a watchdog that this rate would trip, and more than the bus carries.

        Args:
            options: as the configuration gives them.
            period_s: time between ticks [s].

        Raises:
            ValueError: says which key.
        """
        super().check(options, period_s)
        for index, axis in enumerate(options.axes):
            if axis.id > MOST_ADDRESS:
                raise ValueError(f"device.options.axes[{index}].id = {axis.id}: a node_id is 0 to {MOST_ADDRESS}")
        if options.watchdog_ms is not None and options.watchdog_ms < LEAST_TICKS * 1e3 * period_s:
            raise ValueError(
                f"device.options.watchdog_ms = {options.watchdog_ms:g}: at least {LEAST_TICKS * 1e3 * period_s:g}, "
                f"{LEAST_TICKS:g} ticks at this loop.rate_hz"
            )
        needed = len(options.axes) * (STATE_BITS * 1e3 + TORQUE_BITS / period_s)
        if needed > options.bitrate:
            raise ValueError(
                f"device.options.bitrate = {options.bitrate}: {len(options.axes)} motors need up to {needed:.0f} bit/s "
                "at this loop.rate_hz"
            )

    @classmethod
    def find(cls, options: OdriveOptions | None = None) -> list[FoundDevice]:
        """Every CAN interface that ODrives may be behind, or the serial port that is named; none is opened.

        Args:
            options: which one is meant; None: any.
        """
        wanted = AUTO if options is None else options.channel
        bitrate = 1_000_000 if options is None else options.bitrate
        if wanted.startswith("/") and Path(wanted).exists():
            return [found_port("slcan adapter", wanted)]
        return [
            found_interface(name, UP.format(name, bitrate), fd=False)
            for name in can_interfaces()
            if wanted in (AUTO, name)
        ]

    @classmethod
    def diagnose(cls, options: OdriveOptions | None = None) -> list[Diagnosis]:
        """Whether it is clear which interface is meant; opens none.

        Args:
            options: those of the configuration.
        """
        there = can_interfaces()
        if options is None or options.channel != AUTO or len(there) < 2:
            return []
        try:
            only(cls.NAME, there, "CAN interface")
        except DeviceNotFoundError as error:
            mend = "# in the configuration, [device.options]: channel = ...; hapticd devices odrive lists them"
            return [Diagnosis("problem", str(error).removeprefix("odrive: "), (mend,))]
        return []

    def _connect(self) -> BusLink:
        options = self.options
        channel = only(self.NAME, can_interfaces(), "CAN interface") if options.channel == AUTO else options.channel
        if channel.startswith("/"):
            return AsciiLink(self.NAME, channel, slcan.dialect(options.bitrate))
        return open_can(self.NAME, channel, False, UP.format(channel, options.bitrate))

    def _gather(self, link: BusLink) -> Crew:
        options = self.options
        watchdog_s = None if options.watchdog_ms is None else 1e-3 * options.watchdog_ms
        return OdriveCrew(link, self, self.NAME, [axis.id for axis in options.axes], watchdog_s)

    @property
    def _host_silence_ms(self) -> float | None:
        return self.options.watchdog_ms
