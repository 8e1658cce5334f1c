"""What compiled Python costs against C: the closed loop over a grid, the same arithmetic, results compared.

    hapticd bench batch [--points 1000] [--seconds 3] [--repeats 7] [--json]

The C is batch_reference.c, built when this runs with -O2 -ffp-contract=off. All are measured in turns, and the
best turn of each counts. On one core that is processor time, which other programs hardly disturb; all cores together
are measured by the clock, so that figure means something only while the machine is otherwise idle.
"""

from __future__ import annotations

import ctypes
import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hapticd import plugins
from hapticd.config.walls import WallConfig
from hapticd.simulation.batch import Batch, Point
from hapticd.simulation.compiler.threads import cores
from hapticd.simulation.options import SimulationOptions
from hapticd_bench.compiling import compile_c

_C_TYPES = {"float64": "double", "int64": "int64_t", "bool": "bool"}
_STRUCTS = {
    "plant_state": "plants",
    "plant_params": "epochs",
    "loop_state": "loops",
    "loop_params": "params",
    "segment": "segments",
    "law_state": "law_states",
    "law_params": "law_params",
    "law_tick": "ticks",
}


@dataclass(frozen=True, slots=True)
class BatchFigures:
    """Throughput in million ticks a second, and the ratios that are compared between machines.

    Attributes:
        threads: threads of `all_cores`.
        c_one_core, one_core, all_cores, interpreted: Mtick/s.
        one_core_ratio, all_cores_ratio, interpreted_ratio: against C on one core.
        load: runnable tasks on this machine, mean of the last minute; one more than `threads` is too many.
        equal: whether C and compiled Python ended in the same states, bit for bit.
    """

    threads: int
    c_one_core: float
    one_core: float
    all_cores: float
    interpreted: float
    one_core_ratio: float
    all_cores_ratio: float
    interpreted_ratio: float
    load: float
    equal: bool


def grid(points: int) -> list[Point]:
    """Walls from 4 to 30 kN/m, struck from 0 to 8 mm and then pressed: some settle, some bounce at the force limit."""
    law = plugins.law("energy-cycle")
    found = []
    for at in range(points):
        device = SimulationOptions.model_validate(
            {
                "initial_position_m": 0.001 * (at % 9),
                "hand": {"force": {"profile": "constant", "newton": -1.0 - at % 7}},
            }
        )
        wall = WallConfig(stiffness_n_per_m=4000.0 + 26000.0 * at / points)
        found.append(Point(device, wall, law.Params(), max_force_n=12.0))
    return found


def measure(points: int, seconds: float, repeats: int) -> BatchFigures:
    """Measure all of them in turns.

    Raises:
        HapticdError: there is no C compiler.
    """
    law = plugins.law("energy-cycle")
    loops = grid(points)
    batch = Batch(law, loops, seconds, ledger=False)
    few = Batch(law, loops[:: max(1, points // 4)], min(seconds, 2.0), ledger=False)
    with tempfile.TemporaryDirectory() as folder:
        reference = Reference(batch, Path(folder))
        batch.run(1)
        ticks = sum(round(seconds / point.period_s) for point in loops)
        few_ticks = sum(round(min(seconds, 2.0) / point.period_s) for point in few.points)
        best = dict.fromkeys(("c", "one", "all", "plain"), 1e9)
        for _ in range(repeats):
            best["c"] = min(best["c"], reference.run())
            best["one"] = min(best["one"], _kernel(batch, 1))
            best["all"] = min(best["all"], _kernel(batch, None, time.perf_counter))
            best["plain"] = min(best["plain"], _seconds(few.run_interpreted))
        equal = reference.agrees_with(batch)
    c, one, both = (ticks / best[name] * 1e-6 for name in ("c", "one", "all"))
    plain = few_ticks / best["plain"] * 1e-6
    return BatchFigures(cores(), c, one, both, plain, one / c, both / c, plain / c, os.getloadavg()[0], equal)


class Reference:
    """The loop in C over the records of a batch."""

    def __init__(self, batch: Batch, folder: Path) -> None:
        self._batch = batch
        arrays = batch.arrays()
        header = [_struct(name, getattr(arrays, field).dtype) for name, field in _STRUCTS.items()]
        (folder / "batch_types.h").write_text("\n".join(header))
        source = Path(__file__).with_name("batch_reference.c")
        library = compile_c(
            source, folder / "batch_reference.so", "-ffp-contract=off", "-shared", "-fPIC", f"-I{folder}", "-lm"
        )
        self._sweep = ctypes.CDLL(str(library)).sweep
        self._arrays = arrays

    def run(self) -> float:
        """Run once.  -> seconds that it took."""
        self._arrays = arrays = self._batch.arrays()
        pointers = [ctypes.c_void_p(getattr(arrays, field).ctypes.data) for field in _STRUCTS.values()]
        count = ctypes.c_int64(len(self._batch.points))
        # Where no point has a target, the kernel has this branch compiled away for all of them.
        settling = ctypes.c_bool(self._batch.switches["SETTLING"])
        return _seconds(lambda: self._sweep(ctypes.c_int64(0), count, *pointers, settling))

    def agrees_with(self, batch: Batch) -> bool:
        """Whether the last run ended in the same states as compiled Python does."""
        arrays = batch.arrays()
        batch.run_on(arrays, 1)
        pairs = ((arrays.loops, self._arrays.loops), (arrays.law_states, self._arrays.law_states))
        return all(np.array_equal(ours[name], theirs[name]) for ours, theirs in pairs for name in ours.dtype.names)


def _struct(name: str, dtype: np.dtype[Any]) -> str:
    assert dtype.names is not None
    fields = " ".join(f"{_C_TYPES[dtype[field].name]} {field};" for field in dtype.names)
    return f"typedef struct {{ {fields} }} {name};"


def _kernel(batch: Batch, workers: int | None, clock: Callable[[], float] = time.process_time) -> float:
    arrays = batch.arrays()
    return _seconds(lambda: batch.run_on(arrays, workers), clock)


def _seconds(function: Callable[[], Any], clock: Callable[[], float] = time.process_time) -> float:
    start = clock()
    function()
    return clock() - start
