"""What the supervisor tells the remote process: whole each time, in a file, since it may be long."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import msgpack

from hapticd.config.ports import PortLimits
from hapticd.errors import HapticdError
from hapticd.keys.file import Key
from hapticd.keys.store import KeyRing
from hapticd.version import __version__

SETTINGS = b"settings"
"""The packet that says that there are some: their file comes with it, and the memory of the loop."""

LARGEST_PACKET = 1 << 16
"""Of what the remote process says [bytes]."""


@dataclass(frozen=True, slots=True)
class RemoteSettings:
    """What the remote process serves; the memory of the loop comes with it.

    Attributes:
        version: of the supervisor's hapticd.
        directory: runtime directory of the instance.
        scene_tcp, state_tcp: endpoints for other computers; None: none.
        ring: the keys that these take.
        lease_s: how long a client that says nothing keeps a name [s].
        rate_hz: ticks a second [Hz].
        axes: names of the device's axes.
        has_orientation: whether it has a wrist.
        epoch_offset_ns: what to add to CLOCK_MONOTONIC to get nanoseconds since the epoch.
        ports: what clients may drive, in the order of the scene.
        cpus: processors to stay on; empty: any.
        realtime: it may take a real-time priority there.
    """

    version: str
    directory: str
    scene_tcp: str | None
    state_tcp: str | None
    ring: KeyRing | None
    lease_s: float
    rate_hz: float
    axes: tuple[str, ...]
    has_orientation: bool
    epoch_offset_ns: int
    ports: tuple[PortLimits, ...]
    cpus: tuple[int, ...]
    realtime: bool

    def packed(self) -> bytes:
        """As bytes."""
        packed: bytes = msgpack.packb(asdict(self), unicode_errors="surrogateescape")
        return packed


def unpacked(packed: bytes) -> RemoteSettings:
    """The settings in these bytes.

    Raises:
        HapticdError: another version of hapticd has written them.
    """
    said: dict[str, Any] = msgpack.unpackb(packed, unicode_errors="surrogateescape")
    if said["version"] != __version__:
        raise HapticdError(f"hapticd {__version__} was installed while {said['version']} runs: restart the daemon")
    ring = said.pop("ring")
    return RemoteSettings(
        **{
            **said,
            "ring": ring and KeyRing(Key(**ring["pair"]), {name: Key(**key) for name, key in ring["clients"].items()}),
            "axes": tuple(said["axes"]),
            "ports": tuple(PortLimits(**port) for port in said["ports"]),
            "cpus": tuple(said["cpus"]),
        }
    )
