"""What became of the points of a batch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hapticd.simulation.batch.arrays import Array, Arrays
from hapticd.simulation.batch.prepare import Prepared


@dataclass(frozen=True, slots=True)
class BatchResult:
    """What became of each point: one element a point, in the order of the points.

    Attributes:
        peak_to_peak_m, measured_peak_to_peak_m: true and measured position over the last window [m].
        mean_depth_m: mean depth in the wall over the last window, true position, negative outside [m].
        mean_force_n: mean force of the actuator over the last window [N].
        peak_force_n: largest force that was written, magnitude, whole run [N].
        damping_n_s_per_m: damping of the law at the end; 0 when it has none.
        felt_mass_kg: mass identified by the law; 0 when unknown.
        cycles: completed energy cycles, by the ledger's 2+2 window.
        energy_j, generated_j, dissipated_j: the ledger at the end [J].
        settled_s: from when on the true position stayed within the band of its target; NaN when it did not, or when
            there is no target [s].
        finite: whether position, velocity and force stayed in bounds; when not, the run ended there.
        ticks: ticks that were run.
        states: final state of the law, a structured array.
        trace: (points, rows, columns) in the order of `TRACE_COLUMNS`; empty unless asked for.
    """

    peak_to_peak_m: Array
    measured_peak_to_peak_m: Array
    mean_depth_m: Array
    mean_force_n: Array
    peak_force_n: Array
    damping_n_s_per_m: Array
    felt_mass_kg: Array
    cycles: Array
    energy_j: Array
    generated_j: Array
    dissipated_j: Array
    settled_s: Array
    finite: Array
    ticks: Array
    states: Array
    trace: Array = field(repr=False)


def result_of(prepared: Sequence[Prepared], arrays: Arrays) -> BatchResult:
    """Read it from the arrays after the run."""
    loops, ledgers = arrays.loops, arrays.ledgers
    window = np.array([one.window for one in prepared], dtype=float)
    period_s = np.array([one.params["dt_s"] for one in prepared])
    finite = loops["finite"].copy()
    seen = np.where(finite, 1.0, np.nan)
    last = np.array([one.ticks for one in prepared]) - 1
    has_target = np.array([not math.isnan(one.params["target_m"]) for one in prepared])
    settled = has_target & finite & (loops["outside_tick"] < last)
    return BatchResult(
        peak_to_peak_m=(loops["high_m"] - loops["low_m"]) * seen,
        measured_peak_to_peak_m=(loops["high_measured_m"] - loops["low_measured_m"]) * seen,
        mean_depth_m=-loops["sum_x_m"] / window * seen,
        mean_force_n=loops["sum_force_n"] / window * seen,
        peak_force_n=loops["peak_force_n"].copy(),
        damping_n_s_per_m=loops["damping_n_s_per_m"].copy(),
        felt_mass_kg=loops["felt_mass_kg"].copy(),
        cycles=ledgers["cycle"].copy(),
        energy_j=ledgers["energy_j"].copy(),
        generated_j=ledgers["generated_j"].copy(),
        dissipated_j=ledgers["dissipated_j"].copy(),
        settled_s=np.where(settled, (loops["outside_tick"] + 1) * period_s, np.nan),
        finite=finite,
        ticks=loops["ticks"].copy(),
        states=arrays.law_states,
        trace=arrays.traces,
    )
