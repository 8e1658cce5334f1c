"""One run of a scenario with every tick, and what can be read from it."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from hapticd.law import plain_object
from hapticd.offline.run import Run
from hapticd.offline.simulate import simulate
from hapticd.tick.energy import cycle_ended
from hapticd_studies.paper.scenarios import PaperScenario

Array = np.ndarray[Any, Any]

STIFFNESS_JND = 0.23
"""Smallest change of stiffness that people tell apart (Jones and Hunter, 1990)."""

STILL_M = 1e-5
"""Vibration below this, or below two counts of the position, counts as imperceptible [m]."""


@dataclass(frozen=True, repr=False, eq=False)
class Recording(Run):
    """A scenario that has been run.

    Attributes:
        scenario: what was run.
    """

    scenario: PaperScenario

    @property
    def resolution_m(self) -> float:
        """Step of the measured position [m]."""
        return self.options.resolution_m

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
        """Ticks of the minima that end a cycle, by a time window of `window` samples on either side."""
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

    def spring_n(self) -> Array:
        """What the spring alone would give, within what the device can [N]."""
        spring_n = -self.scenario.stiffness_n_per_m * np.minimum(self.x_measured_m, 0.0)
        limited: Array = np.minimum(spring_n, self.options.max_force_n or np.inf)
        return limited

    def damping_force_n(self) -> Array:
        """What the law adds to the spring inside the wall [N]."""
        added: Array = np.where(self.in_contact, self.force_n - self.spring_n(), 0.0)
        return added

    def until(self, time_s: float) -> Array:
        """Which ticks are before a time, true or false."""
        before: Array = self.t_s < time_s
        return before

    def stiffness_n_per_m_over(self, samples: int) -> Array:
        """Force over true depth tick by tick, both means of this many samples in contact; NaN out of it [N/m]."""
        kernel = np.ones(samples)
        force_n = np.convolve(np.where(self.in_contact, self.force_n, 0.0), kernel)[: self.ticks]
        depth_m = np.convolve(np.where(self.in_contact, -self.x_m, 0.0), kernel)[: self.ticks]
        over: Array = np.divide(force_n, depth_m, out=np.full(self.ticks, np.nan), where=depth_m > self.resolution_m)
        return over

    def figures(self) -> RunFigures:
        """The numbers of this run."""
        flow_j = self.flow_j()
        window = -self.window.start
        before_m = np.ptp(self.x_m[-2 * window : -window]) if self.ticks >= 2 * window else np.nan
        stiffness = None if math.isnan(self.displayed_stiffness_n_per_m) else self.displayed_stiffness_n_per_m
        measured = None if math.isnan(self.measured_stiffness_n_per_m) else self.measured_stiffness_n_per_m
        error = None if stiffness is None else stiffness / self.scenario.stiffness_n_per_m - 1.0
        still_m = max(2.0 * self.resolution_m, STILL_M)
        grows = bool(self.peak_to_peak_m > 1.1 * before_m + self.resolution_m)
        return RunFigures(
            outcome=self.outcome.words,
            peak_to_peak_m=self.peak_to_peak_m,
            mean_depth_m=-self.mean_m,
            settled_s=None if self.settled_tick is None else self.settled_s,
            cycles_to_settle=None if self.settled_tick is None else int(self.cycle[self.settled_tick]),
            cycles=int(self.cycle[-1]),
            damping_n_s_per_m=float(self.damping_n_s_per_m[-1]),
            peak_damping_n_s_per_m=float(np.max(np.abs(self.damping_n_s_per_m))),
            peak_force_n=self.peak_force_n,
            energy_injected_j=float(flow_j[flow_j > 0.0].sum()),
            energy_recovered_j=float(-flow_j[flow_j < 0.0].sum()),
            generated_j=self.generated_j,
            lowest_energy_j=float(self.energy_j.min()),
            displayed_stiffness_n_per_m=stiffness,
            stiffness_error=error,
            measured_stiffness_n_per_m=measured,
            felt_index=None if math.isnan(self.felt_index) else self.felt_index,
            force_chatter_n=self.force_chatter_n,
            imperceptible=bool(
                self.peak_to_peak_m < still_m * (1.0 + 1e-9)
                and not grows
                and error is not None
                and abs(error) < STIFFNESS_JND
            ),
        )


def record(scenario: PaperScenario, duration_s: float | None = None) -> Recording:
    """Run a scenario.

    Args:
        scenario: what to run.
        duration_s: for how long, where other than the scenario says [s].
    """
    run = simulate(scenario.load(), scenario.duration_s if duration_s is None else duration_s)
    return Recording(**{field.name: getattr(run, field.name) for field in fields(Run)}, scenario=scenario)


@dataclass(frozen=True, slots=True)
class RunFigures:
    """What is reported of a run; spans, depth and stiffness are of its last half second.

    Attributes:
        outcome: settled in place, still elsewhere, moving or diverged.
        peak_to_peak_m, mean_depth_m: of the true position [m].
        settled_s: since when it has stayed in its place [s]; None when it does not.
        cycles_to_settle: completed cycles at that time.
        cycles: completed cycles at the end.
        damping_n_s_per_m, peak_damping_n_s_per_m: of the law, at the end and at most.
        peak_force_n: largest applied force [N].
        energy_injected_j, energy_recovered_j: all that went into the wall, and all that came back [J].
        generated_j: what sampling and hold made of it [J].
        lowest_energy_j: the least net energy of the whole run [J].
        displayed_stiffness_n_per_m: mean force over mean true depth.
        stiffness_error: its relative error.
        measured_stiffness_n_per_m: the same over the measured depth: the wall's own by construction, once at rest.
        felt_index: how many times the threshold of a hand the true position vibrates; None where it diverged.
        force_chatter_n: span of the applied force [N].
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
    measured_stiffness_n_per_m: float | None
    felt_index: float | None
    force_chatter_n: float
    imperceptible: bool

    @property
    def rest(self) -> str:
        """What of the end is felt, in words."""
        felt = "" if self.felt_index is None else f"felt {self.felt_index:.2g} times the threshold, "
        return f"{felt}force spans {self.force_chatter_n:.2g} N"

    def declared(self) -> dict[str, Any]:
        """For a file of results."""
        return asdict(self)
