r"""A fault record as a file: what it is, in JSON, then the ticks as they lay in the ring.

hapticd fault record 1\n
{"event": ..., "config": ..., "device": ..., "ticks": {"count": 6001, "format": "<qqddd...", ...}, ...}\n
zlib stream of rows
"""

from __future__ import annotations

import json
import math
import platform
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hapticd.config.loading import LoadedConfig
from hapticd.device import DeviceInfo
from hapticd.errors import HapticdError
from hapticd.tick.event import EventCode, LoopEvent
from hapticd.tick.flags import FORCES
from hapticd.tick.record import RecordLayout, TickRecord
from hapticd.version import __version__

MAGIC = b"hapticd fault record 1\n"
SUFFIX = ".fault"

_LARGEST_HEADER = 1 << 24
_KEYS = {"event", "instance", "version", "device", "driver", "config", "law", "ticks"}
_EVENT_KEYS = {"code", "name", "text", "seq", "deadline_ns", "timestamp"}


@dataclass(frozen=True, slots=True)
class FaultRecord:
    """A fault record that was read.

    Attributes:
        name: what `hapticd fault` calls it.
        header: event, configuration, device, version, kernel; see docs/faults.md.
        ticks: the ticks around the fault, oldest first.
    """

    name: str
    header: dict[str, Any]
    ticks: list[TickRecord]

    @property
    def trace(self) -> list[str]:
        """What driver and device had said to each other last, each entry with its time on CLOCK_MONOTONIC [ns]."""
        return list(self.header.get("trace", ()))  # records of version 0.1 have none

    @property
    def fault_ns(self) -> int:
        """Time of the fault on CLOCK_MONOTONIC [ns]."""
        return int(self.header["event"]["deadline_ns"])


def encode(header: dict[str, Any], layout: RecordLayout, rows: Iterator[bytes]) -> bytes:
    """A fault record as bytes.

    Args:
        header: what the record says of itself.
        layout: how the rows lie.
        rows: whole rows, any number in each piece.
    """
    compressor = zlib.compressobj(level=1)
    packed = bytearray()
    size = 0
    for piece in rows:
        size += len(piece)
        packed += compressor.compress(piece)
    packed += compressor.flush()
    ticks = {
        "count": size // layout.size,
        "bytes": layout.size,
        "format": layout.format,
        "axes": layout.axes,
        "orientation": layout.orientation,
        "max_walls": layout.max_walls,
    }
    said = json.dumps({**header, "ticks": ticks}, allow_nan=False).encode()
    return MAGIC + said + b"\n" + bytes(packed)


def read_header(path: Path) -> dict[str, Any]:
    """What a fault record says of itself.

    Raises:
        HapticdError: it cannot be read, or is none.
    """
    return _parts(path, ticks=False)[0]


def read(path: Path) -> FaultRecord:
    """A fault record with its ticks.

    Raises:
        HapticdError: it cannot be read, or is none that this version knows.
    """
    header, packed = _parts(path, ticks=True)
    try:
        ticks = header["ticks"]
        layout = RecordLayout(ticks["axes"], ticks["orientation"], ticks["max_walls"])
        if ticks["format"] != layout.format:
            raise HapticdError(f"{path}: its ticks are laid out as hapticd {header['version']} does; read it with that")
        rows = memoryview(zlib.decompress(packed))
        if len(rows) % layout.size:
            raise HapticdError(f"{path}: damaged: the last of its ticks is not whole")
        found = [layout.unpack(rows[at : at + layout.size]) for at in range(0, len(rows), layout.size)]
    except (zlib.error, KeyError, TypeError, ValueError, IndexError, OverflowError, MemoryError) as error:
        raise HapticdError(f"{path}: damaged: {error or type(error).__name__}") from error
    return FaultRecord(path.stem, header, found)


def _parts(path: Path, ticks: bool) -> tuple[dict[str, Any], bytes]:
    try:
        with path.open("rb") as file:
            if file.readline(len(MAGIC)) != MAGIC:
                raise HapticdError(f"{path}: no fault record that this version of hapticd can read")
            header: dict[str, Any] = json.loads(file.readline(_LARGEST_HEADER))
            if not _has(header, _KEYS) or not _has(header["event"], _EVENT_KEYS):
                raise HapticdError(f"{path}: damaged: its header is none of a fault record")
            return header, file.read() if ticks else b""
    except OSError as error:
        raise HapticdError(f"{path}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise HapticdError(f"{path}: damaged: {error}") from error


def _has(table: Any, keys: set[str]) -> bool:
    return isinstance(table, dict) and table.keys() >= keys


def receipt(event: LoopEvent, epoch_s: float, instance: str, config: LoadedConfig, info: DeviceInfo) -> dict[str, Any]:
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
            "version": __version__,
            "driver": config.config.device.driver,
            "device": asdict(info),
            "rate_hz": config.config.loop.rate_hz,
            "law": config.config.controller.law,
            "config": {"file": str(config.path), "sha256": config.sha256, "text": config.text},
            **machine(),
        }
    )
    return told


def machine() -> dict[str, str]:
    """The computer in a receipt: kernel, processor architecture, Python."""
    return {
        "kernel": f"{platform.system()} {platform.release()} {platform.version()}",
        "machine": platform.machine(),
        "python": platform.python_version(),
    }


def _plain(value: Any) -> Any:
    """JSON has neither tuples nor infinities: a limit that is not there is null."""
    if isinstance(value, dict):
        return {key: _plain(element) for key, element in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(element) for element in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@dataclass(frozen=True, slots=True)
class FaultSummary:
    """Figures of a fault record.

    Attributes:
        ticks: ticks in the record.
        before_s: how far it reaches back before the fault [s].
        after_s: how far it goes on after it [s].
        force_before_n: magnitude of the force in the last tick before the fault [N].
        peak_force_n: largest magnitude from the fault on [N].
        ramp_ticks: ticks from the fault up to the last one with a force; None when the record ends before the device
            is disarmed.
        skipped: deadlines skipped within the record.
    """

    ticks: int
    before_s: float
    after_s: float
    force_before_n: float
    peak_force_n: float
    ramp_ticks: int | None
    skipped: int


def summarise(record: FaultRecord) -> FaultSummary:
    """The figures of a record."""
    ticks = record.ticks
    at = int(record.header["event"]["seq"])
    forces = [(tick.seq, math.hypot(*tick.force_n)) for tick in ticks]
    after = [force for seq, force in forces if seq >= at]
    return FaultSummary(
        ticks=len(ticks),
        before_s=max(0.0, (record.fault_ns - ticks[0].deadline_ns) * 1e-9) if ticks else 0.0,
        after_s=max(0.0, (ticks[-1].deadline_ns - record.fault_ns) * 1e-9) if ticks else 0.0,
        force_before_n=next((force for seq, force in reversed(forces) if seq < at), 0.0),
        peak_force_n=max(after, default=0.0),
        ramp_ticks=_ramp_ticks([tick for tick in ticks if tick.seq >= at]),
        skipped=ticks[-1].skipped - ticks[0].skipped if ticks else 0,
    )


def _ramp_ticks(after: Sequence[TickRecord]) -> int | None:
    """A handle that is out of the wall for a moment has no force either, so the release is over where it is disarmed.

    Somebody may arm it again within the record: that force is another one.
    """
    disarmed = next((index for index, tick in enumerate(after) if not tick.flags & FORCES), None)
    if disarmed is None:
        return None
    return max((index + 1 for index, tick in enumerate(after[: disarmed + 1]) if any(tick.force_n)), default=0)
