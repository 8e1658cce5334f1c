"""The batch: points in, results out, as machine code or interpreted."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any, NamedTuple

from hapticd.errors import ConfigError
from hapticd.law import state_fields
from hapticd.simulation.batch.arrays import Arrays, arrays_of
from hapticd.simulation.batch.fields import plain, store
from hapticd.simulation.batch.kernel import bound
from hapticd.simulation.batch.machine_code import machine_code
from hapticd.simulation.batch.point import Point
from hapticd.simulation.batch.prepare import Prepared
from hapticd.simulation.batch.result import BatchResult, result_of
from hapticd.simulation.batch.state import LoopBuffers, LoopControl, LoopDevice, LoopLaw
from hapticd.simulation.compiler.threads import in_threads
from hapticd.simulation.plant import Buffers, terms
from hapticd.tick.energy import EnergyLedger


class PlainLoop(NamedTuple):
    """What `run` takes, as plain objects."""

    device: LoopDevice
    control: LoopControl
    law: LoopLaw
    wall: Any
    ledger: EnergyLedger
    trace: Any


def plain_loop(prepared: Prepared, trace: Any) -> PlainLoop:
    """A point before its first tick, for an interpreted run.

    Args:
        prepared: the point.
        trace: where its trace goes, (rows, columns).
    """
    return PlainLoop(
        LoopDevice(
            plain(prepared.plant),
            [plain(fields) for fields in prepared.epochs],
            Buffers(list(prepared.line), *prepared.recorded),
        ),
        LoopControl(
            plain(prepared.loop),
            plain({**prepared.params, "first_segment": 0, "end_segment": len(prepared.segments)}),
            [plain(fields) for fields in prepared.segments],
            LoopBuffers(list(prepared.history), [0.0] * len(prepared.history)),
        ),
        LoopLaw(plain(prepared.law_state), plain(prepared.law_params), plain(prepared.tick)),
        plain(prepared.wall),
        EnergyLedger(),
        trace,
    )


class Batch:
    """A grid of loops with one law, ready to run.

    Args:
        law: the law's module.
        points: the loops.
        duration_s: simulated time [s].
        window_s: how much of the end is reported on [s].
        trace_every: keep one tick in this many; 0: none.
        trace_last_s: only those of this much of the end [s].
        ledger: keep the energy books; without them cycles and energies stay 0.

    Raises:
        ConfigError: a point that cannot be simulated, named by its index.

    Attributes:
        prepared: the points as they wait for their run.
        switches: which branches of the loop its points need.
    """

    def __init__(
        self,
        law: ModuleType,
        points: Sequence[Point],
        duration_s: float,
        window_s: float = 0.5,
        trace_every: int = 0,
        ledger: bool = True,
        trace_last_s: float = math.inf,
    ) -> None:
        if not points:
            raise ConfigError("a batch needs at least one point")
        self.law = law
        self.points = points
        self.prepared = []
        for at, point in enumerate(points):
            try:
                self.prepared.append(Prepared(law, point, duration_s, window_s, trace_every, trace_last_s))
            except ValueError as error:
                raise ConfigError(f"points[{at}]: {error}") from error
        state_names = state_fields(law)
        self.switches = {
            "LONG_VELOCITY": any(point.velocity_samples > 1 for point in points),
            "LIMIT": any(point.max_force_n < math.inf for point in points),
            "LEDGER": ledger,
            "LAW_DAMPING": "damping_n_s_per_m" in state_names,
            "LAW_MASS": "felt_mass_kg" in state_names,
            "SETTLING": any(not math.isnan(float(one.params["target_m"])) for one in self.prepared),
            "TRACE": trace_every > 0,
        }
        for point in points:
            for name, on in terms(point.device).items():
                self.switches[name] = self.switches.get(name, False) or on
        longest = max(one.ticks - one.params["trace_from"] for one in self.prepared)
        self._rows = longest // trace_every if trace_every else 0

    def run(self, workers: int | None = None, progress: Callable[[int], None] | None = None) -> BatchResult:
        """Run every point as machine code.

        Args:
            workers: threads; None: one a core.
            progress: told now and then how many points have been done since it was last told.

        Raises:
            PluginError: the law cannot be compiled.
        """
        arrays = self.arrays()
        self.run_on(arrays, workers, progress)
        return self.result(arrays)

    def result(self, arrays: Arrays) -> BatchResult:
        """What became of the points, from the arrays that they were run on."""
        return result_of(self.prepared, arrays)

    def arrays(self) -> Arrays:
        """Every point as it is before its first tick."""
        return arrays_of(self.prepared, self._rows)

    def run_on(self, arrays: Arrays, workers: int | None = None, progress: Callable[[int], None] | None = None) -> None:
        """Run every point as machine code, from and into these arrays; called again, it goes on where it was."""
        code = machine_code(self.law, tuple(sorted(self.switches.items())))
        in_threads(code, len(self.prepared), arrays, workers=workers, progress=progress)

    def run_interpreted(self) -> BatchResult:
        """Run every point as plain Python: the same numbers, about a hundred times slower."""
        loop = bound(self.switches, self.law.step)
        arrays = self.arrays()
        for at, one in enumerate(self.prepared):
            objects = plain_loop(one, arrays.traces[at])
            loop(*objects)
            store(arrays.loops[at], objects.control.state)
            store(arrays.ledgers[at], objects.ledger)
            store(arrays.law_states[at], objects.law.state)
        return result_of(self.prepared, arrays)
