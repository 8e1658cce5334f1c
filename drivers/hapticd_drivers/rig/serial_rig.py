"""Driver `serial-rig`: a rig on a serial line, with the firmware in drivers/firmware/serial-rig or one like it."""

from __future__ import annotations

import os
from pathlib import Path

from pydantic import Field

from hapticd.device import Diagnosis, FoundDevice
from hapticd.errors import ConfigError, DeviceNotFoundError
from hapticd_drivers.rig import serial_adapters, serial_ports
from hapticd_drivers.rig.driver import RigDriver
from hapticd_drivers.rig.link import Link
from hapticd_drivers.rig.messages import Identity
from hapticd_drivers.rig.options import RigOptions
from hapticd_drivers.rig.serial_link import SerialLink

BITS_A_BYTE = 10
"""On the line: start, eight of data, stop."""

SAY_WHICH = "# in the configuration, [device.options]: port = ...; hapticd devices serial-rig lists them"
"""What to do where it is not clear which port is meant."""

_STATE_BYTES = 18, 8  # on the line, and for each axis


class SerialRigOptions(RigOptions):
    """Which port, and how fast."""

    port: str = Field(
        serial_ports.AUTO,
        pattern=f"^({serial_ports.PATTERN})$",
        description='"/dev/ttyUSB0", "usb:0403:6001", "usb:0403:6001:SERIAL", or "auto": the only one on USB',
    )
    baud: int = Field(
        1_000_000, ge=1200, le=12_000_000, description="bits a second; of no meaning to a board that is USB itself"
    )
    low_latency: bool = Field(True, description="ask the kernel and the adapter not to keep bytes back")


class SerialRig(RigDriver[SerialRigOptions]):
    """A rig of one to three axes on a serial line, by the rig protocol."""

    Options = SerialRigOptions
    NAME = "serial-rig"
    ABSENT = "plug the rig in; ls /dev/serial/by-id shows its port"

    @classmethod
    def find(cls, options: SerialRigOptions | None = None) -> list[FoundDevice]:
        """Every serial port on USB that may be a rig; none is opened, since that resets many a board.

        Args:
            options: which port is meant; None: any.
        """
        wanted = serial_ports.AUTO if options is None else options.port
        named = [serial_ports.Port(wanted)] if wanted.startswith("/") and Path(wanted).exists() else []
        ports = named or [port for port in serial_ports.usb_ports() if serial_ports.fits(port, wanted)]
        return [
            FoundDevice(
                port.name,
                port.serial,
                port.path,
                problem="" if allowed else "this user may not open it",
                note="whether it is a rig shows when it is opened",
                mend=() if allowed else ("sudo usermod -aG dialout $USER  # then log in again",),
            )
            for port in ports
            for allowed in [os.access(port.path, os.R_OK | os.W_OK)]
        ]

    @classmethod
    def diagnose(cls, options: SerialRigOptions | None = None) -> list[Diagnosis]:
        """Whether it is clear which of the ports is meant, and whether an adapter lacks its port; opens none.

        Args:
            options: those of the configuration.
        """
        wanted = serial_ports.AUTO if options is None else options.port
        try:
            serial_ports.choose(wanted)
        except DeviceNotFoundError as error:
            there = serial_ports.usb_ports()
            lacking = serial_adapters.without_port(port.usb for port in there)
            if there:  # else there is just no rig
                return [Diagnosis("problem", str(error).removeprefix("serial-rig: "), (SAY_WHICH,)), *lacking]
            return lacking
        return []

    def _connect(self) -> Link:
        options = self.options
        return SerialLink(serial_ports.choose(options.port), options.baud, options.low_latency)

    def _check_link(self, identity: Identity) -> None:
        base, each = _STATE_BYTES
        bits = BITS_A_BYTE * (base + each * identity.axes)
        if bits > self.options.baud * self.period_s:
            raise ConfigError(
                f"device.options.baud = {self.options.baud}: a state takes {1e3 * bits / self.options.baud:.2g} ms on "
                f"the line, and a tick is {1e3 * self.period_s:g} ms: at least {bits / self.period_s:.0f} baud, or a "
                "lower loop.rate_hz"
            )
