"""What one tick records of what clients drive, and how that lies in a record."""

from __future__ import annotations

from dataclasses import dataclass
from struct import Struct
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # clients read records without the tick that makes them
    from hapticd.tick.remote.port import Port
    from hapticd.tick.tick import ControlTick

MOST_PORTS = 24
"""Most ports in one record: couplings and forces first, then the remote objects that are touched."""

_SCALARS = 9


@dataclass(slots=True)
class PortRecord:
    """One port in one tick.

    Attributes:
        index: of the port in the scene: remote objects, couplings, forces.
        object: index of the object in the scene; -1: it is a coupling or a force.
        state: how it stands with its client, as `PortState`.
        seq: the client's own number of the message in force; -1: none is.
        age_s: since it was taken [s].
        stiffness_n_per_m: in force now [N/m].
        damping_n_s_per_m: of the law, the largest of its axes [N s/m].
        felt_mass_kg: of the law, the largest of its axes [kg]; 0 while unknown.
        work_j: what its client has put in, less what it took [J].
        target_m: where the followed target is, one element an axis [m].
        force_n: on the device [N].
        impulse_n_s: the sum of what pulls at the target times how long it was applied [N s].
    """

    index: int
    object: int
    state: int
    seq: int
    age_s: float
    stiffness_n_per_m: float
    damping_n_s_per_m: float
    felt_mass_kg: float
    work_j: float
    target_m: tuple[float, ...]
    force_n: tuple[float, ...]
    impulse_n_s: tuple[float, ...]


@dataclass(slots=True)
class PortsRecord:
    """What a scene with ports adds to a tick.

    Attributes:
        count: how many the scene has.
        objects: how many of them are remote objects, which come first.
        work_j: what the clients of all couplings and forces have put in, those that are gone included [J].
        shown: those that the record has room for.
    """

    count: int
    objects: int
    work_j: float
    shown: tuple[PortRecord, ...]


class PortLayout:
    """Where the ports lie behind the rest of a record.

    Args:
        axes: of the device.
    """

    def __init__(self, axes: int) -> None:
        self._axes = axes
        one = "qqqqddddd" + "d" * (3 * axes)
        self._structs = [Struct(f"<qqqd{one * shown}") for shown in range(MOST_PORTS + 1)]
        self.size = self._structs[-1].size
        self.format = self._structs[-1].format[1:]

    def pack(self, area: memoryview, at: int, tick: ControlTick, work_j: float) -> None:
        """Write the ports of a tick.

        Args:
            area: where to.
            at: offset in it [bytes].
            tick: it.
            work_j: what the clients of all couplings and forces have put in [J].
        """
        ports = tick.ports
        objects = len(ports) - len(tick.own_ports.couplings)
        shown = list(enumerate(ports))
        if len(shown) > MOST_PORTS:
            shown = sorted(shown, key=_rank)[:MOST_PORTS]
        values: list[float] = []
        for index, port in shown:
            values += (index, port.object_index, port.state, port.seq, port.age_s, *port.law_values(), port.work_j)
            values += port.target_m
            values += port.force_n
            values += port.impulse_n_s
        self._structs[len(shown)].pack_into(area, at, len(shown), len(ports), objects, work_j, *values)

    def unpack(self, row: bytes | memoryview, at: int) -> PortsRecord:
        """Read them."""
        shown = int.from_bytes(row[at : at + 8], "little")
        values = self._structs[shown].unpack_from(row, at)
        axes = self._axes
        each = _SCALARS + 3 * axes
        _, count, objects, work_j = values[:4]
        ports = []
        for start in range(4, len(values), each):
            one = values[start : start + each]
            vectors = [tuple(one[_SCALARS + n * axes : _SCALARS + (n + 1) * axes]) for n in range(3)]
            ports.append(PortRecord(*one[:_SCALARS], *vectors))
        return PortsRecord(count, objects, work_j, tuple(ports))


def _rank(entry: tuple[int, Port]) -> tuple[bool, bool]:
    """Couplings and forces first, then what has a force."""
    port = entry[1]
    return port.kind == "object", not any(port.force_n)
