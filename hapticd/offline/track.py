"""One run in space for a study: every tick's vectors and what the run leaves, as machine code where that can be."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hapticd.config.loading import LoadedConfig
from hapticd.errors import ConfigError
from hapticd.offline.rehearsal import Rehearsal
from hapticd.simulation.batch.space import SpaceRun, interpreted_because, row_of
from hapticd.simulation.batch.space_kernel import TRACE_COLUMNS
from hapticd.simulation.space.device import SpatialDevice
from hapticd.tick.space.tick import SpaceTick

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Track(NamedTuple):
    """One run in space.

    Attributes:
        tick, device: as the run left them.
        trace: a row a tick that was run, in the order of `TRACE_COLUMNS`.
        fault: why the daemon would have stopped; None when it would not.
        interpreted: what kept it from being compiled; empty when nothing did.
    """

    tick: SpaceTick
    device: SpatialDevice
    trace: NDArray[np.float64]
    fault: str | None
    interpreted: str


def track(loaded: LoadedConfig, ticks: int, compiled: bool = True) -> Track:
    """Run a configuration of a device with three axes; the numbers are the same either way, to the last bit.

    Machine code for a law takes as long to make as a million ticks take interpreted.

    Args:
        loaded: the configuration.
        ticks: how many.
        compiled: go on as machine code from the second tick, where that can be.

    Raises:
        ConfigError: the configuration is not one for a simulated device with three axes.
        PluginError: the law cannot be compiled.
    """
    rehearsal, tick, device = _begun(loaded)
    going = rehearsal.run(ticks)
    reason = "as asked for"
    if compiled and next(going, None) is not None:
        reason = interpreted_because(tick, device)
        if not reason:
            run = SpaceRun(tick, device, ticks)
            if run.run():
                going.close()
                return Track(tick, device, run.trace, rehearsal.fault, "")
            reason = "the run leaves all bounds"
        rehearsal, tick, device = _begun(loaded)
        going = rehearsal.run(ticks)
    return Track(tick, device, _rows(going, tick, device), rehearsal.fault, reason)


def _begun(loaded: LoadedConfig) -> tuple[Rehearsal, SpaceTick, SpatialDevice]:
    rehearsal = Rehearsal(loaded)
    if rehearsal.space is None or not isinstance(rehearsal.tick, SpaceTick):
        raise ConfigError(f"{loaded.path}: device.options.axes: must be 3 for a run in space")
    return rehearsal, rehearsal.tick, rehearsal.space


def _rows(going: Iterable[int], tick: SpaceTick, device: SpatialDevice) -> NDArray[np.float64]:
    rows = [row_of(tick, device) for _ in going]
    return np.array(rows, float).reshape(len(rows), len(TRACE_COLUMNS))
