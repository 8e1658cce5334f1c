"""The part of a recording that is replayed: the longest one in which forces were let through all the time.

A gap, a restart, a pause and a change of configuration end it, and so does a client that has a part in the force.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from hapticd.config.loading import LoadedConfig, parse
from hapticd.device import DeviceInfo
from hapticd.errors import HapticdError
from hapticd.tick.event import EventCode
from hapticd_views.recording import Recording
from hapticd_views.replay.driven import driven

_FAR_M = 1e6
_PAUSE_S = 0.05  # so much more than a period between two ticks is no motion that goes on
_ALONG_AXES = ("position_m", "velocity_m_per_s", "force_n", "force_requested_n")


@dataclass(frozen=True, eq=False)
class Stretch:
    """Ticks one after the other.

    Attributes:
        ticks: columns as `Recording.ticks` has them.
        receipt: what was in force.
        first_s: from the first tick of the recording to its first one [s].
        in_contact: whether it begins inside a wall, for want of a tick outside.
    """

    ticks: dict[str, Any]
    receipt: dict[str, Any]
    first_s: float
    in_contact: bool

    def __len__(self) -> int:
        return len(self.ticks["seq"])

    @property
    def config(self) -> LoadedConfig:
        """The configuration that was in force.

        Raises:
            HapticdError: it is not in the recording.
            ConfigError: this installation cannot use it.
        """
        if not self.receipt["config_text"]:
            raise HapticdError(
                f"the recording has no configuration ({self.receipt['config_missing']}): name a --config"
            )
        folder = Path(self.receipt["config_file"]).parent
        return parse(self.receipt["config_text"], "recorded configuration", folder)

    @property
    def info(self) -> DeviceInfo:
        """What the device declared of itself, as far as the recording has it."""
        told = self.receipt.get("device_info") or {}
        known = {field.name for field in dataclasses.fields(DeviceInfo)}
        fields = {key: value for key, value in told.items() if key in known}
        axes = tuple(self.receipt["axes"])
        fields |= {
            "model": self.receipt["device"],
            "serial": self.receipt["serial"],
            "axes": axes,
            "simulated": self.receipt["simulated"],
            "max_force_n": fields.get("max_force_n") or self.receipt["max_force_n"] or math.inf,
            "resolution_m": fields.get("resolution_m", 0.0),
            "workspace_m": ((-_FAR_M, _FAR_M),) * len(axes),  # what was recorded was possible
            "nominal_rate_hz": fields.get("nominal_rate_hz", self.receipt["rate_hz"]),
            "safe_damping_n_s_per_m": fields.get("safe_damping_n_s_per_m", 1.0),
            "host_silence_ms": fields.get("host_silence_ms"),
            "notes": (),
        }
        return DeviceInfo(**fields)


def longest_stretch(recording: Recording, most_s: float | None = None) -> Stretch:
    """The part to replay; it begins outside of all walls where it can.

    Args:
        recording: of position, damping and timing at least.
        most_s: how much of it at most [s].

    Raises:
        HapticdError: there is nothing to replay, or a client moved an object.
    """
    if recording.receipt["every_ticks"] != 1:
        raise HapticdError(f"{recording.path}: only one tick in {recording.receipt['every_ticks']} was published")
    for needed in ("position", "damping", "timing"):
        if needed not in recording.topics:
            raise HapticdError(f"{recording.path}: has no topic {needed!r}, which a replay needs")
    ticks = recording.ticks
    if len(ticks["seq"]) < 2:
        raise HapticdError(f"{recording.path}: has no ticks to replay")
    in_force = recording.in_force
    start, end = _longest(recording)
    free = np.nonzero(~ticks["in_contact"][start:end].any(axis=1))[0]
    inside = not len(free) or start + int(free[0]) > end - 2
    start += 0 if inside else int(free[0])
    if most_s is not None:
        end = min(end, start + max(2, 1 + round(most_s * recording.receipt["rate_hz"])))
    receipt = recording.receipts[int(in_force[start])]
    axes = len(receipt["axes"])  # another part may be of a device with more
    return Stretch(
        ticks={
            name: column[start:end, :axes] if name in _ALONG_AXES else column[start:end]
            for name, column in ticks.items()
        },
        receipt=receipt,
        first_s=float(ticks["timestamp"][start] - ticks["timestamp"][0]),
        in_contact=inside,
    )


def _longest(recording: Recording) -> tuple[int, int]:
    """The first row of the longest part that can be replayed, and the one behind its last."""
    ticks, armed, by_clients = recording.ticks, recording.armed, driven(recording)
    replayed = armed & ~by_clients
    breaks = (np.diff(ticks["seq"]) != 1) | (np.diff(recording.loops) != 0) | (np.diff(recording.in_force) != 0)
    breaks |= np.diff(ticks["timestamp"]) > 1.0 / recording.receipt["rate_hz"] + _PAUSE_S
    breaks |= np.diff(replayed)
    event = recording.topics.get("event", {"code": [], "run": [], "seq": []})
    for code, run, seq in zip(event["code"], event["run"], event["seq"], strict=True):
        if code == EventCode.SWITCHED:  # also where the configuration is the same: it was in force behind that tick
            breaks |= (ticks["run"][:-1] == run) & (ticks["seq"][:-1] == seq)
    edges = [0, *(np.nonzero(breaks)[0] + 1).tolist(), len(ticks["seq"])]
    parts = [(start, end) for start, end in pairwise(edges) if replayed[start] and end - start > 1]
    if not parts:
        why = "no forces were let through" if not armed.any() else "clients had a part in every force"
        raise HapticdError(f"{recording.path}: {why}: there is nothing to replay")
    return max(parts, key=lambda part: part[1] - part[0])
