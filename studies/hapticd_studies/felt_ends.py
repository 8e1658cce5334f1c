"""What of the end of a batch of presses is felt."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hapticd.offline.felt import WINDOW_S, felt_index
from hapticd.simulation.batch import TRACE_COLUMNS, BatchResult, Point

Array = npt.NDArray[np.float64]


def felt_ends(points: Sequence[Point], result: BatchResult) -> tuple[Array, Array]:
    """What of the end of each press is felt, and how much its force still swings.

    Args:
        points: the presses.
        result: what became of them, with every tick of the last `WINDOW_S` in the trace.

    Returns:
        The felt index of the true position, and the span of the applied force [N]; infinite where a press diverged.
    """
    felt, chatter_n = np.full(len(points), np.inf), np.full(len(points), np.inf)
    for at, point in enumerate(points):
        if not result.finite[at]:
            continue
        end = result.trace[at, : round(WINDOW_S / point.period_s)]
        end = end[~np.isnan(end[:, 0])]  # a press may be shorter
        force_n = end[:, TRACE_COLUMNS.index("force_n")]
        felt[at] = felt_index(end[:, TRACE_COLUMNS.index("x_m")], point.period_s)
        chatter_n[at] = float(force_n.max() - force_n.min())
    return felt, chatter_n
