"""The loop as machine code, over the points of a batch."""

from __future__ import annotations

from functools import lru_cache
from types import ModuleType
from typing import Any

from numba import njit

from hapticd.simulation.batch.kernel import bound
from hapticd.simulation.batch.state import LoopBuffers, LoopControl, LoopDevice, LoopLaw
from hapticd.simulation.compiler.compile import INNER, OPTIONS, compiled, compiled_step, on_stack
from hapticd.simulation.plant import Buffers


@lru_cache(maxsize=32)
def machine_code(law: ModuleType, switches: tuple[tuple[str, bool], ...]) -> Any:
    """A function of a first point, the point to stop at and `Arrays`, that runs these points.

    Raises:
        PluginError: the law cannot be compiled.
    """
    memo = {law.step: compiled_step(law)}
    loop = compiled(bound(dict(switches), law.step), memo)

    @njit(**INNER)  # type: ignore[untyped-decorator]  # numba publishes no types
    def one(at: Any, arrays: Any) -> None:
        plant = on_stack(arrays.plants[at])
        state = on_stack(arrays.loops[at])
        tick = on_stack(arrays.ticks[at])
        law_state = on_stack(arrays.law_states[at])
        wall = on_stack(arrays.walls[at])
        ledger = on_stack(arrays.ledgers[at])
        line = slice(arrays.line_from[at], arrays.line_from[at + 1])
        points = slice(arrays.points_from[at], arrays.points_from[at + 1])
        past = slice(arrays.history_from[at], arrays.history_from[at + 1])
        buffers = Buffers(arrays.lines[line], arrays.points_s[points], arrays.points_n[points])
        history = LoopBuffers(arrays.history_m[past], arrays.history_s[past])
        loop(
            LoopDevice(plant, arrays.epochs, buffers),
            LoopControl(state, on_stack(arrays.params[at]), arrays.segments, history),
            LoopLaw(law_state, on_stack(arrays.law_params[at]), tick),
            wall,
            ledger,
            arrays.traces[at],
        )
        arrays.plants[at] = plant
        arrays.loops[at] = state
        arrays.ticks[at] = tick
        arrays.law_states[at] = law_state
        arrays.walls[at] = wall
        arrays.ledgers[at] = ledger

    @njit(**OPTIONS)  # type: ignore[untyped-decorator]  # numba publishes no types
    def sweep(first: Any, stop: Any, arrays: Any) -> None:
        for at in range(first, stop):
            one(at, arrays)

    return sweep
