"""The option that every driver with a trace has; `hapticd.trace` keeps it."""

from __future__ import annotations

from pydantic import Field

from hapticd.driver import DriverOptions
from hapticd.trace import MOST_ENTRIES


class TraceOptions(DriverOptions):
    """The keys of [device.options] that every driver with a trace has."""

    trace: int = Field(
        0,
        ge=0,
        le=MOST_ENTRIES,
        description="how many of the last messages or calls between hapticd and the device are kept, for fault records "
        "and reports; each costs microseconds; 0 = none",
    )
