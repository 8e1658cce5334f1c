"""[device.options] of driver hid-rig."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from hapticd_drivers.rig.options import RigOptions


class HidRigOptions(RigOptions):
    """Which device; the numbers are those of a Teensy with the RawHID interface unless others are given."""

    vendor_id: int = Field(0x16C0, ge=0, le=0xFFFF, description="USB vendor, such as 0x16c0")
    product_id: int = Field(0x0486, ge=0, le=0xFFFF, description="USB product, such as 0x0486")
    serial: str | None = Field(
        None, min_length=1, description="USB serial number, needed where several are plugged in; unset: the only one"
    )
    usage_page: int = Field(0xFFAB, ge=1, le=0xFFFF, description="usage page of its reports, such as 0xffab")
    usage: int = Field(0x0200, ge=0, le=0xFFFF, description="usage of its reports, such as 0x0200")
    backend: Literal["auto", "hidraw", "libusb"] = Field(
        "auto", description="hidapi's way to the device; auto: hidraw, and libusb on a kernel without it"
    )
