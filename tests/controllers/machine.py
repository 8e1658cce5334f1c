"""The plant and a law as machine code: the same source, on records."""

from __future__ import annotations

from functools import lru_cache
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
from numba import njit

from .plant import Rig
from .plant import drive as plain_drive

_KINDS = {float: np.float64, int: np.int64, bool: np.bool_}


def drive(rig: Rig, ticks: int) -> None:
    """As `plant.drive`, compiled; the rig's objects have the result afterwards."""
    objects = (rig.state, rig.params, rig.tick, rig.plant)
    records = [_record(each) for each in objects]
    _loop()(_compiled(rig.law), *(record[0] for record in records), ticks)
    for each, record in zip(objects, records, strict=True):
        for name in record.dtype.names or ():
            if name != "unused":
                setattr(each, name, record[name][0].item())


@lru_cache
def _loop() -> Any:
    return njit(plain_drive)


@lru_cache
def _compiled(law: ModuleType) -> Any:
    return _machine(law.step, {})


def _machine(function: FunctionType, done: dict[FunctionType, Any]) -> Any:
    if function not in done:
        names = dict(function.__globals__)
        for name in function.__code__.co_names:
            if isinstance(names.get(name), FunctionType):
                names[name] = _machine(names[name], done)
        done[function] = njit(FunctionType(function.__code__, names, function.__name__))
    return done[function]


def _record(plain: Any) -> Any:
    """A record with the fields of a slotted object; one that has none gets one that nobody uses."""
    fields = {name: getattr(plain, name) for name in type(plain).__slots__} or {"unused": 0.0}
    record = np.zeros(1, np.dtype([(name, _KINDS[type(value)]) for name, value in fields.items()], align=True))
    for name, value in fields.items():
        record[name] = value
    return record
