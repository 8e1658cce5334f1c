"""[device], [controller] and [remote]: each names a plug-in and holds what is its own to check."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from hapticd.settings import Table


class DeviceConfig(Table):
    """[device]: which driver, and its own options."""

    driver: str = Field(
        "loopback", min_length=1, description="installed driver or importable module, see `hapticd devices`"
    )
    options: dict[str, Any] = Field(default_factory=dict, description="the driver's own options")
    accept_no_watchdog: bool = Field(
        False,
        description="run a real device that keeps its last force when this computer dies (docs/safety.md)",
    )


class ControllerConfig(Table):
    """[controller]: which law, and its own parameters."""

    law: str = Field(
        "ring-damping",
        min_length=1,
        description="installed law or importable module, see `hapticd controllers`",
    )
    params: dict[str, Any] = Field(default_factory=dict, description="the law's own parameters")


PORT_LAW = "late-cycle"
"""The law of couplings and forces unless another is named."""


class RemoteLawTable(Table):
    """What [remote] says of the law that couplings and forces are under."""

    law: str = Field(
        PORT_LAW,
        min_length=1,
        description="law of couplings and forces, installed or an importable module: what is late makes energy, which "
        "that of [controller] need not look at (docs/couplings.md)",
    )
    params: dict[str, Any] = Field(default_factory=dict, description="that law's own parameters")
