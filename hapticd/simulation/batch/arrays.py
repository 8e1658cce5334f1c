"""All points of a batch as arrays, as machine code takes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from hapticd.simulation.batch.fields import fields_of, hints, records
from hapticd.simulation.batch.prepare import Prepared
from hapticd.simulation.batch.state import TRACE_COLUMNS, LoopParams, LoopState, Segment, WallState
from hapticd.simulation.compiler.compile import TICK_KINDS, kinds
from hapticd.simulation.plant import PlantParams, PlantState
from hapticd.tick.energy import EnergyLedger

Array: TypeAlias = np.ndarray[Any, Any]


class Arrays(NamedTuple):
    """All points as arrays of records, and what does not fit into records as one flat array each.

    Attributes:
        plants, loops, params, law_states, law_params, ticks, walls, ledgers: a record a point.
        epochs, segments: those of all points, end to end; segments and `params` say which.
        lines, points_s, points_n, history_m, history_s: those of all points, end to end.
        line_from, points_from, history_from: where those of each point begin, and where the last ends.
        traces: (points, rows, columns).
    """

    plants: Array
    epochs: Array
    lines: Array
    line_from: Array
    points_s: Array
    points_n: Array
    points_from: Array
    history_m: Array
    history_s: Array
    history_from: Array
    loops: Array
    params: Array
    segments: Array
    law_states: Array
    law_params: Array
    ticks: Array
    walls: Array
    ledgers: Array
    traces: Array


def arrays_of(prepared: Sequence[Prepared], rows: int) -> Arrays:
    """Every point as it is before its first tick, with room for `rows` rows of trace."""
    segments: list[dict[str, Any]] = []
    params = []
    first_epoch = 0
    for one in prepared:
        first = len(segments)
        segments += [{**fields, "epoch": fields["epoch"] + first_epoch} for fields in one.segments]
        params.append({**one.params, "first_segment": first, "end_segment": len(segments)})
        first_epoch += len(one.epochs)
    lines, line_from = _flat([one.line for one in prepared])
    points_s, points_from = _flat([one.recorded[0] for one in prepared])
    points_n, _ = _flat([one.recorded[1] for one in prepared])
    history_m, history_from = _flat([one.history for one in prepared])
    ledger = fields_of(EnergyLedger())
    return Arrays(
        plants=records([one.plant for one in prepared], hints(PlantState)),
        epochs=records([fields for one in prepared for fields in one.epochs], hints(PlantParams)),
        lines=lines,
        line_from=line_from,
        points_s=points_s,
        points_n=points_n,
        points_from=points_from,
        history_m=history_m,
        history_s=np.zeros_like(history_m),
        history_from=history_from,
        loops=records([one.loop for one in prepared], hints(LoopState)),
        params=records(params, hints(LoopParams)),
        segments=records(segments, hints(Segment)),
        law_states=records([one.law_state for one in prepared], kinds(prepared[0].law_state)),
        law_params=records([one.law_params for one in prepared], prepared[0].law_param_kinds),
        ticks=records([one.tick for one in prepared], TICK_KINDS),
        walls=records([one.wall for one in prepared], hints(WallState)),
        ledgers=records([ledger] * len(prepared), kinds(ledger)),
        traces=np.full((len(prepared), rows, len(TRACE_COLUMNS)), np.nan),
    )


def _flat(lists: Sequence[Sequence[float]]) -> tuple[Array, Array]:
    """Lists end to end, and where each begins."""
    starts = np.cumsum([0, *(len(one) for one in lists)])
    return np.array([value for one in lists for value in one], dtype=float), starts
