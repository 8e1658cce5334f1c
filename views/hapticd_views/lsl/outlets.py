"""The two streams as liblsl has them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import pylsl

from hapticd.telemetry.records import Status
from hapticd_views.lsl.channels import JoinedTick, Layout

BUFFERED_S = 60
"""What liblsl keeps for a reader that is slow [s]."""

_AT_ONCE = 20  # ticks in a message of the daemon


class Outlets:
    """A regular stream of ticks and an irregular one of texts, for as long as the layout stays.

    Args:
        layout: of the ticks.
        status: of the daemon.
    """

    def __init__(self, layout: Layout, status: Status) -> None:
        self.layout = layout
        channels = layout.channels
        info = _info(status, "ticks", "Haptics", len(channels), layout.rate_hz, pylsl.cf_double64)
        info.set_channel_labels([name for name, _, _ in channels])
        info.set_channel_units([unit for _, unit, _ in channels])
        info.set_channel_types([kind for _, _, kind in channels])
        self._ticks = pylsl.StreamOutlet(info, _AT_ONCE, BUFFERED_S)
        self._events = pylsl.StreamOutlet(_info(status, "events", "Markers", 1, pylsl.IRREGULAR_RATE, pylsl.cf_string))

    def push(self, ticks: Sequence[JoinedTick]) -> None:
        """Stream ticks; each has its deadline as its time."""
        if ticks:
            self._ticks.push_chunk([tick.sample for tick in ticks], [tick.time_s for tick in ticks])

    def tell(self, told: dict[str, Any], time_s: float) -> None:
        """Stream a text: what happened, as a JSON object with `kind` and `seq`.

        Args:
            told: the object.
            time_s: when, on LSL's clock [s].
        """
        self._events.push_sample([json.dumps(told, ensure_ascii=False)], time_s)


def _info(status: Status, what: str, kind: str, channels: int, rate_hz: float, form: int) -> Any:
    """The description of a stream; its source is the same after a restart, so that readers find it again."""
    name = f"hapticd-{status.instance}"
    info = pylsl.StreamInfo(f"{name}-{what}", kind, channels, rate_hz, form, f"{name}-{what}")
    described = info.desc()
    described.append_child_value("manufacturer", "hapticd")
    made = described.append_child("hapticd")
    for key in ("version", "instance", "driver", "device", "serial", "law", "config_hash"):
        made.append_child_value(key, str(getattr(status, key)))
    return info
