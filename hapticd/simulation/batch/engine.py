"""The batch: points in, results out, as machine code or interpreted."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from types import ModuleType

from hapticd.errors import ConfigError
from hapticd.law import state_fields
from hapticd.simulation.batch.arrays import Arrays, arrays_of
from hapticd.simulation.batch.fields import plain, store
from hapticd.simulation.batch.kernel import LoopBuffers, bound
from hapticd.simulation.batch.machine_code import machine_code
from hapticd.simulation.batch.point import Point
from hapticd.simulation.batch.prepare import Prepared
from hapticd.simulation.batch.result import BatchResult, result_of
from hapticd.simulation.compiler.threads import in_threads
from hapticd.simulation.plant import Buffers, terms
from hapticd.tick.energy import EnergyLedger


class Batch:
    """A grid of loops with one law, ready to run.

    Args:
        law: the law's module.
        points: the loops.
        duration_s: simulated time [s].
        window_s: the last so many seconds are reported on [s].
        trace_every: keep one tick in this many; 0: none.
        ledger: keep the energy books; without them cycles and energies stay 0.

    Raises:
        ConfigError: a point that cannot be simulated, named by its index.
    """

    def __init__(
        self,
        law: ModuleType,
        points: Sequence[Point],
        duration_s: float,
        window_s: float = 0.5,
        trace_every: int = 0,
        ledger: bool = True,
    ) -> None:
        if not points:
            raise ConfigError("a batch needs at least one point")
        self.law = law
        self.points = points
        self._prepared = []
        for at, point in enumerate(points):
            try:
                self._prepared.append(Prepared(law, point, duration_s, window_s, trace_every))
            except ValueError as error:
                raise ConfigError(f"points[{at}]: {error}") from error
        state_names = state_fields(law)
        self._switches = {
            "WALL_DAMPING": any(segment["damping_n_s_per_m"] for one in self._prepared for segment in one.segments),
            "LONG_VELOCITY": any(point.velocity_samples > 1 for point in points),
            "LIMIT": any(point.max_force_n < math.inf for point in points),
            "LEDGER": ledger,
            "LAW_DAMPING": "damping_n_s_per_m" in state_names,
            "LAW_MASS": "felt_mass_kg" in state_names,
            "SETTLING": any(not math.isnan(float(one.params["target_m"])) for one in self._prepared),
            "TRACE": trace_every > 0,
        }
        for point in points:
            for name, on in terms(point.device).items():
                self._switches[name] = self._switches.get(name, False) or on
        self._rows = max(one.ticks for one in self._prepared) // trace_every if trace_every else 0

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
        return result_of(self._prepared, arrays)

    def arrays(self) -> Arrays:
        """Every point as it is before its first tick."""
        return arrays_of(self._prepared, self._rows)

    def run_on(self, arrays: Arrays, workers: int | None = None, progress: Callable[[int], None] | None = None) -> None:
        """Run every point as machine code, from and into these arrays; called again, it goes on where it was."""
        code = machine_code(self.law, tuple(sorted(self._switches.items())))
        in_threads(code, len(self._prepared), arrays, workers=workers, progress=progress)

    def run_interpreted(self) -> BatchResult:
        """Run every point as plain Python: the same numbers, about a hundred times slower."""
        loop = bound(self._switches, self.law.step, EnergyLedger.update)
        arrays = self.arrays()
        for at, one in enumerate(self._prepared):
            plant = plain(one.plant)
            state = plain(one.loop)
            ledger = EnergyLedger()
            law_state = plain(one.law_state)
            loop(
                plant,
                [plain(fields) for fields in one.epochs],
                Buffers(list(one.line), *one.recorded),
                LoopBuffers(list(one.history), [0.0] * len(one.history)),
                state,
                plain({**one.params, "first_segment": 0, "end_segment": len(one.segments)}),
                [plain(fields) for fields in one.segments],
                law_state,
                plain(one.law_params),
                plain(one.tick),
                ledger,
                arrays.traces[at],
            )
            store(arrays.loops[at], state)
            store(arrays.ledgers[at], ledger)
            store(arrays.law_states[at], law_state)
        return result_of(self._prepared, arrays)
