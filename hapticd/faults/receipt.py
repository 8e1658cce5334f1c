"""What a fault record says of itself: what happened, to which device, under which configuration and kernel."""

from __future__ import annotations

import math
import platform
from dataclasses import asdict
from typing import Any

import hapticd
from hapticd.config.loading import LoadedConfig
from hapticd.contracts.device import DeviceInfo
from hapticd.contracts.event import Event, EventCode


def receipt(event: Event, epoch_s: float, instance: str, config: LoadedConfig, info: DeviceInfo) -> dict[str, Any]:
    """The header of a fault record.

    Args:
        event: the fault.
        epoch_s: when it happened [s since the epoch].
        instance: name of the daemon's instance.
        config: what was in force.
        info: the device.
    """
    told: dict[str, Any] = _plain(
        {
            "event": {**asdict(event), "name": EventCode(event.code).name, "timestamp": epoch_s},
            "instance": instance,
            "version": hapticd.__version__,
            "driver": config.config.device.driver,
            "device": asdict(info),
            "rate_hz": config.config.loop.rate_hz,
            "law": config.config.controller.law,
            "config": {"file": str(config.path), "sha256": config.sha256, "text": config.text},
            "kernel": f"{platform.system()} {platform.release()} {platform.version()}",
            "machine": platform.machine(),
            "python": platform.python_version(),
        }
    )
    return told


def _plain(value: Any) -> Any:
    """JSON has neither tuples nor infinities: a limit that is not there is null."""
    if isinstance(value, dict):
        return {key: _plain(element) for key, element in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(element) for element in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
