"""A tick as the state socket tells it: the keys that docs/remote.md promises."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hapticd.tick.flags import Flag
from hapticd.tick.record import TickRecord
from hapticd.tick.remote.port_record import PortRecord
from hapticd.tick.remote.port_state import PortState

_ARMED = int(Flag.ARMED)


def state_map(record: TickRecord, names: Sequence[tuple[str, int]], epoch_offset_ns: int) -> dict[str, Any]:
    """What clients are told of a tick.

    Args:
        record: it.
        names: of its ports, in their order, with since when each is summed [ns]; empty while they are not known.
        epoch_offset_ns: what to add to CLOCK_MONOTONIC to get nanoseconds since the epoch.
    """
    state: dict[str, Any] = {
        "seq": record.seq,
        "timestamp": (record.deadline_ns + epoch_offset_ns) * 1e-9,
        "deadline_ns": record.deadline_ns,
        "dt_s": record.dt_s,
        "armed": bool(record.flags & _ARMED),
        "position_m": record.position_m,
        "velocity_m_per_s": record.velocity_m_per_s,
        "force_n": record.force_n,
        "buttons": record.buttons,
        "ports": {
            names[port.index][0]: _port_map(port, names[port.index][1])
            for port in ports_of(record)
            if port.index < len(names)
        },
    }
    if record.orientation:
        state["orientation"] = record.orientation
    return state


def ports_of(record: TickRecord) -> Sequence[PortRecord]:
    """What a tick has of each port."""
    return record.ports.shown if record.ports is not None else ()


def _port_map(port: PortRecord, since_ns: int) -> dict[str, Any]:
    return {
        "since_ns": since_ns,
        "force_n": port.force_n,
        "impulse_n_s": port.impulse_n_s,
        "target_m": port.target_m,
        "seq": port.seq,
        "age_s": port.age_s,
        "state": PortState(port.state).name.lower(),
        "work_j": port.work_j,
    }
