"""The receipt of a recording: what was recorded, under which configuration, on which computer.

In the file it is a metadata record of texts, one at the beginning and one at each change, so that any tool shows it.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from hapticd.errors import HapticdError
from hapticd.telemetry.records import Status
from hapticd.version import __version__

METADATA = "hapticd receipt"
"""Name of the metadata record."""

_JSON = {"device_info"} | {field.name for field in dataclasses.fields(Status) if field.type != "str"}
_CHANGED = "the file was damaged or changed after it was recorded: take its original"
_COUNTS = (
    "seq", "measured_rate_hz", "ticks", "overruns", "late_histogram", "late_max_us", "busy_max_us", "ring_drops",
    "event_drops", "next_try_timestamp",
)  # fmt: skip
"""What a status counts; the recording has it as it goes on."""


class _Needed(BaseModel):
    """What every reader of a recording may rely on; the rest of a receipt is shown as it is."""

    model_config = ConfigDict(strict=True)

    timestamp: float
    version: str
    instance: str
    rate_hz: float
    every_ticks: int
    law: str
    driver: str
    device: str
    serial: str
    simulated: bool
    realtime: bool
    axes: list[str]
    max_force_n: float | None
    wall_axis: list[str]
    wall_position_m: list[float]
    wall_stiffness_n_per_m: list[float]
    warnings: list[str]
    config_file: str
    config_hash: str
    config_text: str
    config_missing: str


def make_receipt(status: Status, asked: Mapping[str, Any] | HapticdError) -> dict[str, Any]:
    """What is in force.

    Args:
        status: the newest of the daemon.
        asked: what it answers when asked for a receipt, or why it cannot be asked.
    """
    told: dict[str, Any] = {**status.as_map(), "config_text": "", "config_missing": ""}
    if isinstance(asked, HapticdError):
        told["config_missing"] = str(asked)
    else:
        told.update(asked)
    for key in _COUNTS:
        told.pop(key, None)
    wire = {"timestamp": status.timestamp, "schema": status.schema, "every_ticks": status.every_ticks}
    return {**told, **wire, "recorder_version": __version__}


def as_texts(receipt: Mapping[str, Any]) -> dict[str, str]:
    """A receipt as the texts of a metadata record."""
    return {
        key: json.dumps(_finite(value), default=str) if key in _JSON else str(value) for key, value in receipt.items()
    }


def from_texts(texts: Mapping[str, str]) -> dict[str, Any]:
    """The receipt that these are the texts of.

    Raises:
        ValueError: they are of none, or do not say what every receipt does.
    """
    receipt = {key: json.loads(text) if key in _JSON else text for key, text in texts.items()}
    try:
        _Needed.model_validate(receipt)
    except ValidationError as error:
        odd = sorted({str(one["loc"][0]) for one in error.errors()})
        raise ValueError(f"its receipt does not say {', '.join(odd)}; {_CHANGED}") from None
    walls = {len(receipt[key]) for key in ("wall_axis", "wall_position_m", "wall_stiffness_n_per_m")}
    axes = receipt["axes"]
    if len(walls) > 1 or (len(axes) > 1 and not set(receipt["wall_axis"]) <= set(axes)):
        raise ValueError(f"the walls in its receipt do not fit each other or the axes; {_CHANGED}")
    return receipt


def _finite(value: Any) -> Any:
    """JSON has no infinity: a limit that is not there is null."""
    if isinstance(value, Mapping):
        return {str(key): _finite(element) for key, element in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(element) for element in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
