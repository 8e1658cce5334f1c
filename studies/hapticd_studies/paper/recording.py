"""One run of a scenario with every tick, and what can be read from it."""

from __future__ import annotations

from collections import deque
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hapticd.law import plain_object
from hapticd.offline.run import OfflineRun, Row, Summary
from hapticd.offline.verdict import Criterion, Outcome, balance
from hapticd.simulation.options import SimulationOptions
from hapticd.tick.energy import cycle_ended
from hapticd_studies.paper.scenarios import PaperScenario

Array = np.ndarray[Any, Any]

SETTLED_SHARE = 0.05
"""Settled is within this share of the depth, or three counts of the position where that is more."""

STIFFNESS_SHARE = 0.01
"""The displayed stiffness is right within this share, or half a count over the depth where that is more."""

STIFFNESS_JND = 0.23
"""Smallest change of stiffness that people tell apart (Jones and Hunter, 1990)."""

STILL_M = 1e-5
"""Vibration below this, or below two counts of the position, counts as imperceptible [m]."""


class Recording:
    """A scenario that has been run.

    Args:
        scenario: what to run.
        duration_s: for how long, where other than the scenario says [s].

    Attributes:
        scenario: what was run.
        summary: its last half second.
        t_s, x_m, v_m_per_s, x_measured_m, force_n, energy_j, damping_n_s_per_m, in_contact: a value a tick.
    """

    def __init__(self, scenario: PaperScenario, duration_s: float | None = None) -> None:
        self.scenario = scenario
        loaded = scenario.load()
        assert isinstance(loaded.options, SimulationOptions)
        self._options = loaded.options
        self._balance = balance(loaded.options, loaded.config.scene.walls)
        self.resolution_m = loaded.options.resolution_m
        rows: deque[Row] = deque()
        run = OfflineRun(loaded, scenario.duration_s if duration_s is None else duration_s)
        self.period_s = run.period_s
        self.summary: Summary = run.run(rows.append)
        table = np.array(rows)
        columns = dict(zip(Row._fields, table.T, strict=True))
        self.t_s: Array = columns["t_s"]
        self.x_m: Array = columns["x_m"]
        self.v_m_per_s: Array = columns["v_m_per_s"]
        self.x_measured_m: Array = columns["x_measured_m"]
        self.force_n: Array = columns["force_n"]
        self.energy_j: Array = columns["energy_j"]
        self.damping_n_s_per_m: Array = columns["damping_n_s_per_m"]
        self.cycle: Array = columns["cycle"]
        self.in_contact: Array = columns["in_contact"] > 0.0

    def flow_j(self) -> Array:
        """Energy into the wall tick by tick [J]; its own increments, so that nothing drowns in the sum."""
        moved_m = np.diff(self.x_measured_m, prepend=self.x_measured_m[0])
        held_n = np.concatenate(([0.0], self.force_n[:-1]))
        flow: Array = -held_n * moved_m
        return flow

    def velocity(self) -> Array:
        """The difference of measured positions, which is what the law sees [m/s]."""
        difference: Array = np.diff(self.x_measured_m, prepend=self.x_measured_m[0]) / self.period_s
        return difference

    def cycle_ends(self, window: int) -> list[int]:
        """Ticks of the minima that end a cycle, by a time window of so many samples on either side."""
        fields = {"window_energy_j": 0.0, "window_minimum_j": 0.0, "window_falls": 0, "window_rises": 0}
        state: Any = plain_object("Window", fields)
        ends = []
        energy_j = 0.0
        lowest = 0
        for at, (flow_j, inside) in enumerate(zip(self.flow_j().tolist(), self.in_contact.tolist(), strict=True)):
            energy_j += flow_j
            if flow_j < 0.0:
                lowest = at
            if cycle_ended(state, energy_j, inside, window, window):
                ends.append(lowest)
                energy_j -= state.window_minimum_j
                state.window_energy_j -= state.window_minimum_j
                state.window_minimum_j = 0.0
        return ends

    def settled_tick(self) -> int | None:
        """The first tick from which on the true position stays in place; None when it does not."""
        balance_m = self._balance.x_m
        band_m = max(SETTLED_SHARE * abs(balance_m), 3.0 * self.resolution_m)
        outside = np.flatnonzero(np.abs(self.x_m - balance_m) > band_m)
        first = int(outside[-1]) + 1 if outside.size else 0
        return first if first < len(self.x_m) else None

    def damping_force_n(self) -> Array:
        """What the law adds to the spring inside the wall [N]."""
        spring_n = -self.scenario.stiffness_n_per_m * np.minimum(self.x_measured_m, 0.0)
        added: Array = np.where(self.in_contact, self.force_n - spring_n, 0.0)
        return added

    def figures(self) -> RunFigures:
        """The numbers of this run."""
        summary = self.summary
        flow_j = self.flow_j()
        settled = self.settled_tick()
        window = round(summary.window_s / self.period_s)
        before_m = np.ptp(self.x_m[-2 * window : -window]) if len(self.x_m) >= 2 * window else np.nan
        depth_m = -self._balance.x_m
        stiffness = summary.displayed_stiffness_n_per_m
        error = None if stiffness is None else stiffness / self.scenario.stiffness_n_per_m - 1.0
        outcome = Criterion().outcome(self._options, self._balance, summary.peak_to_peak_m, -summary.mean_depth_m)
        still_m = max(2.0 * self.resolution_m, STILL_M)
        grows = bool(summary.peak_to_peak_m > 1.1 * before_m + self.resolution_m)
        return RunFigures(
            outcome=Outcome.DIVERGED.words if summary.fault else outcome.words,
            peak_to_peak_m=summary.peak_to_peak_m,
            mean_depth_m=summary.mean_depth_m,
            settled_s=None if settled is None else settled * self.period_s,
            cycles_to_settle=None if settled is None else int(self.cycle[settled]),
            cycles=summary.cycles,
            damping_n_s_per_m=summary.damping_n_s_per_m,
            peak_damping_n_s_per_m=float(np.max(np.abs(self.damping_n_s_per_m))),
            peak_force_n=summary.peak_force_n,
            energy_injected_j=float(flow_j[flow_j > 0.0].sum()),
            energy_recovered_j=float(-flow_j[flow_j < 0.0].sum()),
            generated_j=summary.generated_j,
            lowest_energy_j=float(self.energy_j.min()),
            displayed_stiffness_n_per_m=stiffness,
            stiffness_error=error,
            stiffness_tolerance=max(STIFFNESS_SHARE, 0.5 * self.resolution_m / depth_m),
            measured_stiffness_n_per_m=summary.measured_stiffness_n_per_m,
            imperceptible=bool(
                summary.peak_to_peak_m < still_m * (1.0 + 1e-9)
                and not grows
                and error is not None
                and abs(error) < STIFFNESS_JND
            ),
        )


@dataclass(frozen=True, slots=True)
class RunFigures:
    """What is reported of a run; spans, depth and stiffness are of its last half second.

    Attributes:
        outcome: settled in place, still elsewhere, moving or diverged.
        peak_to_peak_m, mean_depth_m: of the true position [m].
        settled_s: since when it has stayed within 5 % of its depth [s]; None when it does not.
        cycles_to_settle: completed cycles at that time.
        cycles: completed cycles at the end.
        damping_n_s_per_m, peak_damping_n_s_per_m: of the law, at the end and at most.
        peak_force_n: largest applied force [N].
        energy_injected_j, energy_recovered_j: all that went into the wall, and all that came back [J].
        generated_j: what sampling and hold made of it [J].
        lowest_energy_j: the least net energy of the whole run [J].
        displayed_stiffness_n_per_m: mean force over mean true depth.
        stiffness_error: its relative error; `stiffness_tolerance` is what counts as right.
        measured_stiffness_n_per_m: the same over the measured depth: the wall's own by construction, once at rest.
        imperceptible: vibration below two counts or 10 um and not growing, stiffness within the JND of 23 %.
    """

    outcome: str
    peak_to_peak_m: float
    mean_depth_m: float
    settled_s: float | None
    cycles_to_settle: int | None
    cycles: int
    damping_n_s_per_m: float
    peak_damping_n_s_per_m: float
    peak_force_n: float
    energy_injected_j: float
    energy_recovered_j: float
    generated_j: float
    lowest_energy_j: float
    displayed_stiffness_n_per_m: float | None
    stiffness_error: float | None
    stiffness_tolerance: float
    measured_stiffness_n_per_m: float | None
    imperceptible: bool

    def declared(self) -> dict[str, Any]:
        """For a file of results."""
        return asdict(self)
