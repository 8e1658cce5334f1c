"""A real device, so it says, that does what a file tells it to do wrong, and keeps a witness of its force.

Copied beside a *.dist-info by `tests.faults.rig`, so that a configuration finds it as it finds anybody's driver.
"""

from __future__ import annotations

import dataclasses
import math
import mmap
import struct
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from hapticd.device import DeviceInfo, Sample
from hapticd.errors import DeviceDisconnectedError, DeviceFaultError, DeviceNotFoundError
from hapticd.simulation.options import SimulationOptions
from hapticd_drivers.loopback import Loopback

WITNESS = struct.Struct("<dqqdqq")
"""Force now [N], when the fault began and when the force was gone [ns], largest force and writes since, opened."""

HANG_S = 30.0
ABSENT = ("unplugged", "oserror", "hang-close")
SILENT = ("clings", "hang-disable")
"""Lost for the loop, which cannot let go of it either; another process can."""


class FaultyOptions(SimulationOptions):
    """[device.options]."""

    order: str
    witness: str


class Faulty(Loopback):
    """The loopback device with a mind of its own."""

    Options: ClassVar[type[SimulationOptions]] = FaultyOptions

    def _open(self) -> DeviceInfo:
        assert isinstance(self.options, FaultyOptions)
        self._order_file = Path(self.options.order)
        self._order_ns = 0
        self._order = ""
        self._slept = False
        with Path(self.options.witness).open("r+b") as file:
            self._witness = mmap.mmap(file.fileno(), WITNESS.size)
        order = self._told()
        self._keep(opened=self._field(5) + 1)
        if order in ABSENT:
            raise DeviceNotFoundError("faulty: nothing is plugged in")
        if order == "hang-open":
            time.sleep(HANG_S)
        info = super()._open()
        return dataclasses.replace(
            info,
            model="faulty",
            serial="2" if order == "swapped" else "1",
            simulated=False,
            max_force_n=12.0,
            workspace_m=((-0.1, 0.1),),
            host_silence_ms=20.0,
        )

    def _read(self) -> Sample:
        order = self._told()
        if order == "hang-read":
            time.sleep(HANG_S)
        if order in ("unplugged", "hang-close", *SILENT):
            raise DeviceDisconnectedError("faulty: unplugged")
        if order == "oserror":
            raise OSError(5, "Input/output error")
        if order == "fault":
            raise DeviceFaultError("faulty: the amplifier is too hot")
        if order.startswith("slow") and not self._slept:
            self._slept = True
            time.sleep(float(order.split()[1]) * 1e-3)
        if order == "frozen":
            return self._sample
        sample = super()._read()
        match order:
            case "nan":
                sample.position_m[0] = math.nan
            case "far":
                sample.position_m[0] = 3.0
            case "jump":
                sample.position_m[0] -= 3e-3
            case "garbage":
                sample.position_m[0] = "here"  # type: ignore[call-overload]  # somebody's own driver
        return sample

    def _write(self, force_n: Sequence[float]) -> None:
        # What is told since this tick's read begins with the next one: this force knows nothing of it.
        if self._order == "hang-write":
            time.sleep(HANG_S)
        if self._order == "no-write":
            raise DeviceDisconnectedError("faulty: unplugged while it was written to")
        super()._write(force_n)
        self._applied(force_n[0], 1)

    def _disable(self) -> None:
        if self._order == "keeps":  # from every process, the helper included
            raise OSError(5, "Input/output error")
        if self._order in SILENT and Path(sys.argv[0]).stem == "process":
            time.sleep(HANG_S * (self._order == "hang-disable"))
            raise OSError(5, "Input/output error")
        super()._disable()
        self._applied(0.0, 0)
        if self._order == "hang-close":
            time.sleep(0.3)

    def _applied(self, newton: float, writes: int) -> None:
        _, began_ns, gone_ns, peak_n, written, opened = WITNESS.unpack(self._witness)
        if began_ns and not gone_ns:
            peak_n = max(peak_n, abs(newton))
            written += writes
            if newton == 0.0:
                gone_ns = time.monotonic_ns()
        self._witness[:] = WITNESS.pack(newton, began_ns, gone_ns, peak_n, written, opened)

    def _told(self) -> str:
        """The order in force; looks at the file only when it has changed."""
        try:
            changed_ns = self._order_file.stat().st_mtime_ns
        except FileNotFoundError:
            self._order_ns, self._order = 0, ""
            return ""
        if changed_ns != self._order_ns:
            self._order_ns = changed_ns
            self._order = self._order_file.read_text()
            self._slept = False
            if not self._field(1):
                self._keep(began_ns=time.monotonic_ns())
        return self._order

    def _field(self, index: int) -> int:
        value: int = WITNESS.unpack(self._witness)[index]
        return value

    def _keep(self, began_ns: int | None = None, opened: int | None = None) -> None:
        fields = list(WITNESS.unpack(self._witness))
        fields[1] = fields[1] if began_ns is None else began_ns
        fields[5] = fields[5] if opened is None else opened
        self._witness[:] = WITNESS.pack(*fields)
