"""One run in space both ways: interpreted from its first tick to its last, and compiled from its second one on."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from types import ModuleType
from typing import Any

from hapticd.config.loading import LoadedConfig
from hapticd.offline.rehearsal import Rehearsal
from hapticd.simulation.batch.space import SpaceRun, row_of
from hapticd.simulation.batch.space_kernel import TRACE_COLUMNS
from hapticd.tick.space.tick import SpaceTick

AFTER = 10
"""Ticks that both go on with, interpreted, from what they have left."""

_NOT_STATE = ("configs", "info", "make_law", "advance", "module", "step", "shapes", "placed", "options")


class Both:
    """A configuration, run both ways.

    Attributes:
        rows: of each tick what `TRACE_COLUMNS` names, interpreted.
        trace: the same, compiled.
        apart: what differs between the objects that the two have left, by path; and again after some more ticks.
        whole: whether the compiled run came to its last tick.
        touched: ticks in which something was touched.
    """

    def __init__(self, loaded: LoadedConfig, ticks: int) -> None:
        interpreted, compiled = Rehearsal(loaded), Rehearsal(loaded)
        ours, theirs = interpreted.run(ticks + AFTER), compiled.run(1 + AFTER)
        next(theirs)
        run = SpaceRun(_tick(compiled), _known(compiled.space), ticks)
        self.whole = run.run()
        compiled.hold()
        self.trace = run.trace.tolist()
        self.rows: list[list[float]] = []
        self.touched = 0
        for _ in range(ticks):
            next(ours)
            self.rows.append(_row(interpreted))
            self.touched += any(each.in_contact for each in _tick(interpreted).solids)
        assert len(self.rows[0]) == len(TRACE_COLUMNS)
        self.apart = list(_apart(_left(interpreted), _left(compiled), ""))
        for _ in range(AFTER):
            next(ours)
            next(theirs)
        self.apart += list(_apart(_left(interpreted), _left(compiled), f"after {AFTER} more: "))


def _tick(rehearsal: Rehearsal) -> SpaceTick:
    assert isinstance(rehearsal.tick, SpaceTick)
    return rehearsal.tick


def _known(value: Any) -> Any:
    assert value is not None
    return value


def _row(rehearsal: Rehearsal) -> list[float]:
    tick, device = _tick(rehearsal), _known(rehearsal.space)
    return row_of(tick, device)


def _left(rehearsal: Rehearsal) -> Any:
    """All that a run remembers, as nested lists of numbers."""
    return [_state(rehearsal.tick, {}), _state(rehearsal.space, {})]


def _state(value: Any, seen: dict[int, int]) -> Any:
    if isinstance(value, enum.Enum | bool | int | float | str) or value is None:
        return value
    if id(value) in seen:  # the same object once more: which one
        return f"object {seen[id(value)]}"
    if isinstance(value, list | tuple):
        return [_state(each, seen) for each in value]
    if isinstance(value, ModuleType) or not type(value).__module__.startswith("hapticd"):
        return type(value).__name__
    seen[id(value)] = len(seen)
    names = sorted({name for cls in type(value).__mro__ for name in getattr(cls, "__slots__", ())})
    names += sorted(getattr(value, "__dict__", {}))
    return {
        name: _state(getattr(value, name), seen) for name in names if name not in _NOT_STATE and hasattr(value, name)
    }


def _apart(ours: Any, theirs: Any, path: str) -> Iterator[str]:
    if isinstance(ours, dict) and isinstance(theirs, dict):
        for name in {**ours, **theirs}:
            yield from _apart(ours.get(name, "unset"), theirs.get(name, "unset"), f"{path}.{name}")
    elif isinstance(ours, list) and isinstance(theirs, list) and len(ours) == len(theirs):
        for at, (one, two) in enumerate(zip(ours, theirs, strict=True)):
            yield from _apart(one, two, f"{path}[{at}]")
    elif ours != theirs or type(ours) is not type(theirs):
        yield f"{path}: {ours!r} and {theirs!r}"
