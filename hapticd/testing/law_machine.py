"""A law as machine code, one tick at a time, beside the same law interpreted."""

from __future__ import annotations

from functools import lru_cache
from types import ModuleType
from typing import Any

import numpy as np
from numba import njit

from hapticd.law import LawTick, Scalar, state_fields
from hapticd.simulation.compiler.compile import OPTIONS, TICK_KINDS, compiled_step, param_kinds, record_dtype


class LawMachine:
    """A law, started, as studies run it.

    Args:
        law: the law's module.
        state: its state after `start`, as a plain object; it stays as it is.
        params: its parameters as a plain object.

    Attributes:
        state: the state as machine code keeps it, a record.

    Raises:
        PluginError: the law cannot be compiled.
    """

    def __init__(self, law: ModuleType, state: Any, params: Any) -> None:
        self._step = _from_python(law)
        self.state = _record(state_fields(law), state)
        self._params = _record(param_kinds(law), params)
        self._tick = _record(TICK_KINDS, LawTick())

    def step(self, tick: LawTick) -> float:
        """The force for a tick [N]."""
        _fill(self._tick, TICK_KINDS, tick)
        return float(self._step(self.state, self._params, self._tick))


@lru_cache(maxsize=64)
def _from_python(law: ModuleType) -> Any:
    """A law's step, for Python to call."""
    step = compiled_step(law)

    @njit(**OPTIONS)  # type: ignore[untyped-decorator]  # numba publishes no types
    def call(state: Any, params: Any, tick: Any) -> Any:
        return step(state, params, tick)

    return call


def _record(kinds: dict[str, type[Scalar]], plain: Any) -> Any:
    record = np.zeros(1, record_dtype(kinds))[0]
    _fill(record, kinds, plain)
    return record


def _fill(record: Any, kinds: dict[str, type[Scalar]], plain: Any) -> None:
    for name in kinds:
        record[name] = getattr(plain, name)
