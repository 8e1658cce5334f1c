"""Runs in space as machine code: the daemon's own tick on the simulated device of three axes.

Contacts, laws, guard and books are compiled from the source that the loop interprets, method by method; the order of a
tick is written down once more, in `space_kernel`. A run begins interpreted, goes on compiled from its second tick, and
leaves its objects as if it had been interpreted throughout.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hapticd.shapes.solid import Part
from hapticd.simulation.batch.space_kernel import (
    TRACE_COLUMNS,
    SpaceContacts,
    SpaceDevice,
    SpaceLoop,
    SpaceVectors,
)
from hapticd.simulation.batch.space_machine import machine_of
from hapticd.simulation.compiler.classes import fill, store
from hapticd.simulation.plant import Buffers, terms
from hapticd.simulation.space.device import SpatialDevice
from hapticd.tick.guard import Mode
from hapticd.tick.space.tick import SpaceTick
from hapticd.tick.velocity import Difference


def interpreted_because(tick: SpaceTick, device: SpatialDevice) -> str:
    """What in a run that has made its first tick cannot be compiled, in the user's terms; empty when nothing."""
    motion, guard = tick.motion, tick.guard
    if tick.contacts or tick.leaving:
        return "scene.walls"
    if tick.has_ports:
        return "what clients drive: remote objects, scene.couplings or scene.forces"
    if not tick.solids:
        return "a scene without objects"
    if any(each.solid.proxy.voxels for each in tick.solids):
        return 'shape = "mesh"'
    if not all(isinstance(each, Difference) for each in motion.estimators):
        return "velocity: any but the difference of two samples"
    if motion.watches_speed:
        return "safety.max_speed_m_per_s"
    if any(channel.blending for each in tick.solids for channel in each.channels):
        return "a blend that is under way"
    if any(each.changing for each in device.axes):
        return "device.options.changes"
    if guard.mode is not Mode.ARMED or guard.changing or tick.fallback or tick.fading or tick.sight.blind:
        return "a run that does not begin armed"
    return ""


def row_of(tick: SpaceTick, device: SpatialDevice) -> list[float]:
    """What `TRACE_COLUMNS` names, after a tick that was interpreted."""
    energy_j = sum([contact.ledger.energy_j for contact in tick.solids])
    return [
        *device.position_m,
        *device.velocity_m_per_s,
        *device.measured_m,
        *tick.force_n,
        *tick.requested_n,
        energy_j,
    ]


class SpaceRun:
    """One run in space, made ready to go on as machine code.

    Args:
        tick: the daemon's tick, after its first one.
        device: the simulated device.
        ticks: how many there are to be, the first among them.

    Raises:
        PluginError: the law cannot be compiled.
        ValueError: something else cannot, see `interpreted_because`.

    Attributes:
        trace: a row a tick, in the order of `TRACE_COLUMNS`.
    """

    def __init__(self, tick: SpaceTick, device: SpatialDevice, ticks: int) -> None:
        reason = interpreted_because(tick, device)
        if reason:
            raise ValueError(f"{reason} cannot be compiled")
        self._tick = tick
        self._device = device
        self._machine = machine_of(tick.solids[0].normal.law)
        self._loop = _loop(tick, device, ticks)
        self.trace = np.full((ticks, len(TRACE_COLUMNS)), np.nan)
        self.trace[0] = row_of(tick, device)
        self._arguments = self._made()

    def run(self) -> bool:
        """Go on to the last tick; False where the daemon would have stopped it, and the objects are as they were."""
        switches: dict[str, bool] = {"COUPLED": self._device.masses is not None}
        for axis in self._device.axes:
            for name, on in terms(axis.options, switches["COUPLED"]).items():
                switches[name] = switches.get(name, False) or on
        code = self._machine.run(switches)
        try:
            whole = bool(code(*self._arguments))
        except ArithmeticError:
            whole = False
        if whole:
            self._store()
        return whole

    def _made(self) -> list[Any]:
        """What the kernel takes, in its order."""
        tick, device, dtype = self._tick, self._device, self._machine.classes.dtype
        solids = tick.solids
        proxy = solids[0].solid.proxy
        parts = max(1, *(len(each.solid.proxy.others) for each in solids))
        several = {
            "others": (Part(proxy.shapes[0], proxy.pose), 1 << (parts - 1).bit_length()),
            "channels": (solids[0].normal, 3),
            "estimators": (self._loop.estimators[0], 3),
        }
        contacts = np.zeros(len(solids), dtype(solids[0], several))
        for row, contact in zip(contacts, solids, strict=True):
            fill(row, contact)
        axes = device.axes
        matrices = device.masses
        return [
            self._record(self._loop, several),
            self._record(tick.guard, several),
            SpaceDevice(
                _rows(dtype, [axis.state for axis in axes]),
                _rows(dtype, [axis.params for axis in axes]),
                tuple(Buffers(*(np.array(values, float) for values in axis.buffers)) for axis in axes),
                np.array(matrices.table if matrices else (0.0,)),
                np.array(matrices.springs_n_per_m if matrices else (0.0,) * 3),
            ),
            SpaceContacts(
                contacts,
                np.array([contact in tick.awake for contact in solids]),
                np.array([contact in tick.held for contact in solids]),
            ),
            SpaceVectors(*(np.array(values, float) for values in self._vectors())),
            self.trace,
        ]

    def _record(self, source: Any, several: dict[str, tuple[Any, int]]) -> Any:
        rows = np.zeros(1, self._machine.classes.dtype(source, several))
        fill(rows[0], source)
        return rows

    def _vectors(self) -> list[list[float]]:
        tick = self._tick
        return [tick.motion.position_m, tick.motion.velocity_m_per_s, tick.force_n, tick.requested_n]

    def _store(self) -> None:
        """Put what the kernel has left into the objects."""
        tick, device = self._tick, self._device
        loop, guard, left, (contacts, awake, held), vectors, _ = self._arguments
        store(loop[0], self._loop)
        store(guard[0], tick.guard)
        for row, contact in zip(contacts, tick.solids, strict=True):
            store(row, contact)
        for axis, row, line in zip(device.axes, left.plants, left.buffers, strict=True):
            before = axis.state.tick
            store(row, axis.state)
            own = terms(axis.options)  # what the code can do beyond that leaves its traces
            if not own["TIMED"]:
                axis.state.tick = before
            if own["DELAY"]:
                axis.buffers.line[:] = line.line.tolist()
            axis.ticks = self._loop.ticks
        device.measured_m[:] = [axis.measured_m for axis in device.axes]
        device.ticks = self._loop.ticks
        for target, values in zip(self._vectors(), vectors, strict=True):
            target[:] = values.tolist()
        tick.motion.time_ns = device.ticks * round(device.period_s * 1e9)
        tick.at_m = (self._loop.at_x, self._loop.at_y, self._loop.at_z)
        tick.awake = [contact for contact, near in zip(tick.solids, awake, strict=True) if near]
        tick.held = [contact for contact, near in zip(tick.solids, held, strict=True) if near]
        tick.books.rest([contact for contact in tick.solids if contact not in tick.awake])


def _loop(tick: SpaceTick, device: SpatialDevice, ticks: int) -> SpaceLoop:
    loop = SpaceLoop()
    matrices = device.masses
    loop.ticks, loop.stop = device.ticks, device.ticks + ticks - 1
    loop.dt_s = tick.motion.dt_s
    loop.at_x, loop.at_y, loop.at_z = tick.at_m
    loop.estimators, loop.nearby = tick.motion.estimators, tick.nearby
    loop.coupled = matrices is not None
    loop.step_m = matrices.step_m if matrices else 1.0
    loop.places_x, loop.places_y, loop.places_z = matrices.places if matrices else (1, 1, 1)
    return loop


def _rows(dtype: Any, objects: list[Any]) -> Any:
    rows = np.zeros(len(objects), dtype(objects[0], {}))
    for row, one in zip(rows, objects, strict=True):
        fill(row, one)
    return rows
