"""The trades on the control side: loop rate, velocity estimator, window of the cycle detector."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from hapticd import plugins
from hapticd.config.loading import LoadedConfig
from hapticd.config.models import VelocityConfig
from hapticd.errors import ConfigError
from hapticd.offline import presses
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.offline.rehearsal import rehearse
from hapticd.offline.run import Run
from hapticd.simulation.batch import Batch
from hapticd.tick.velocity import make_estimator
from hapticd_studies.accuracy.cost import StepCost, costs
from hapticd_studies.accuracy.cycles import Detection, detected_ends, judge, least_swing_m, true_ends
from hapticd_studies.boundaries import stable_limit
from hapticd_studies.zwidth.scenario import PressScenario, scenario_of

RATES_HZ = (250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0)
WINDOWS = (1, 2, 3, 4, 6, 10)
STIFFNESSES_N_PER_M = tuple(float(value) for value in np.geomspace(500.0, 200e3, 60))
"""Walls that are tried for the stiffest that a law holds [N/m]."""

SETTLING_S = 5.0
"""How long such a wall has to settle [s]."""

ESTIMATORS: tuple[tuple[str, dict[str, Any]], ...] = (
    *((f"difference over {n}", {"estimator": "difference", "samples": n}) for n in (1, 2, 3, 5, 10, 20)),
    *((f"low-pass {hz:g} Hz", {"estimator": "lowpass", "cutoff_hz": hz}) for hz in (50.0, 100.0, 200.0)),
    *((f"foaw, up to {n}", {"estimator": "foaw", "samples": n}) for n in (8, 16, 32)),
)


@dataclass(frozen=True, slots=True)
class RateRow:
    """One loop rate.

    Attributes:
        rate_hz: ticks a second.
        cost: ticks of the daemon's loop a second, next to the slowest rate.
        leak_n_s_per_m: K T / 2 of the first wall [N s/m].
        position_m: largest distance from the run at the highest rate [m].
        verdict: of the configuration at this rate.
        displayed_n_per_m: stiffness shown at the end [N/m].
        alone_n_per_m: the exact limit of the linear loop without a law [N/m]; None where there is no press to ask for.
        law_n_per_m: the stiffest wall that settles under the law, softer ones settling too [N/m].
    """

    rate_hz: float
    cost: float
    leak_n_s_per_m: float
    position_m: float
    verdict: str
    displayed_n_per_m: float
    alone_n_per_m: float | None
    law_n_per_m: float | None


@dataclass(frozen=True, slots=True)
class VelocityRow:
    """One estimator.

    Attributes:
        name: for people.
        cost: of one estimate.
        error_m_per_s: root mean square of its error in contact, on the positions of the reference run [m/s].
        verdict: of the configuration with it.
        peak_to_peak_m: span of the position at the end [m].
        cycles: what the ledger's 2+2 window saw in that run.
        default: whether it is the configuration's own.
    """

    name: str
    cost: StepCost
    error_m_per_s: float
    verdict: str
    peak_to_peak_m: float
    cycles: Detection
    default: bool


@dataclass(frozen=True, slots=True)
class WindowRow:
    """One window of the cycle detector.

    Attributes:
        window: falls, and rises, that it asks for.
        open: what it sees while the law is off, so that the wall swings as it likes.
        closed: what it sees in the configuration's own run.
    """

    window: int
    open: Detection
    closed: Detection


def measure_rates(loaded: LoadedConfig, duration_s: float, progress: Callable[[str], object]) -> list[RateRow]:
    """Run the configuration at every rate, and find how stiff a wall each allows."""
    runs = []
    for rate_hz in RATES_HZ:
        progress(f"{rate_hz:g} Hz")
        runs.append(rehearse(at_rate(loaded, rate_hz), duration_s))
    finest, finest_hz = runs[-1], RATES_HZ[-1]
    rows = []
    for rate_hz, run in zip(RATES_HZ, runs, strict=True):
        every = round(finest_hz / rate_hz)
        same = finest.x_m[every - 1 :: every]
        ticks = min(len(same), len(run.x_m))
        walls = loaded.config.scene.walls
        try:
            scenario = scenario_of(at_rate(loaded, rate_hz))
        except ConfigError:
            scenario = None
        rows.append(
            RateRow(
                rate_hz=rate_hz,
                cost=rate_hz / RATES_HZ[0],
                leak_n_s_per_m=0.5 * walls[0].stiffness_n_per_m / rate_hz if walls else math.nan,
                position_m=float(np.max(np.abs(same[:ticks] - run.x_m[:ticks]), initial=0.0)),
                verdict=run.outcome.words,
                displayed_n_per_m=run.displayed_stiffness_n_per_m,
                alone_n_per_m=stable_limit(scenario.loop()) if scenario else None,
                law_n_per_m=_stiffest(loaded, scenario) if scenario else None,
            )
        )
    return rows


def measure_velocity(loaded: LoadedConfig, duration_s: float, progress: Callable[[str], object]) -> list[VelocityRow]:
    """Run the configuration with every estimator that fits its rate."""
    reference = rehearse(loaded, duration_s)
    own = loaded.config.velocity
    found = [(name, VelocityConfig.model_validate(keys)) for name, keys in ESTIMATORS]
    found = [
        (name, one) for name, one in found if one.estimator != "lowpass" or one.cutoff_hz < 0.5 / reference.period_s
    ]
    if not any(_same(one, own) for _, one in found):
        found.insert(0, ("the configuration's own", own))
    timed = costs([_estimating(one, reference) for _, one in found])
    rows = []
    for (name, velocity), cost in zip(found, timed, strict=True):
        progress(name)
        run = rehearse(replace(loaded, config=loaded.config.model_copy(update={"velocity": velocity})), duration_s)
        rows.append(
            VelocityRow(
                name=name,
                cost=cost,
                error_m_per_s=_velocity_error(velocity, reference),
                verdict=run.outcome.words,
                peak_to_peak_m=run.peak_to_peak_m,
                cycles=_seen(run, 2),
                default=_same(velocity, own),
            )
        )
    return rows


def measure_windows(loaded: LoadedConfig, duration_s: float, progress: Callable[[str], object]) -> list[WindowRow]:
    """Let detectors with every window watch the configuration, under its law and without one."""
    progress("cycle windows")
    law = plugins.law("none")
    unaided = rehearse(replace(loaded, law=law, params=law.Params()), duration_s)
    own = rehearse(loaded, duration_s)
    return [WindowRow(window, _seen(unaided, window), _seen(own, window)) for window in WINDOWS]


def at_rate(loaded: LoadedConfig, rate_hz: float) -> LoadedConfig:
    """The configuration at another rate."""
    loop = loaded.config.loop.model_copy(update={"rate_hz": rate_hz})
    return replace(loaded, config=loaded.config.model_copy(update={"loop": loop}))


def _stiffest(loaded: LoadedConfig, scenario: PressScenario) -> float:
    """The last of a row of walls that all settle, of those that are tried; 0 where none does [N/m].

    The row may begin late: on soft walls a bare mass takes longer to settle than anybody waits.
    """
    criterion = Criterion()
    points = [
        replace(scenario, wall=scenario.wall.model_copy(update={"stiffness_n_per_m": stiffness, "changes": ()})).point(
            loaded.params, criterion
        )
        for stiffness in STIFFNESSES_N_PER_M
    ]
    result = Batch(loaded.law, points, SETTLING_S, criterion.window_s, ledger=False).run()
    held = 0.0
    for stiffness, outcome in zip(STIFFNESSES_N_PER_M, presses.judge(criterion, points, result), strict=True):
        if outcome == Outcome.SETTLED:
            held = stiffness
        elif held > 0.0:
            break
    return held


def _seen(run: Run, window: int) -> Detection:
    return judge(true_ends(run, least_swing_m(run)), detected_ends(run, window))


def _same(one: VelocityConfig, other: VelocityConfig) -> bool:
    keys = {"difference": ("samples",), "lowpass": ("cutoff_hz",), "foaw": ("samples", "noise_m"), "device": ()}
    named = ("estimator", *keys[other.estimator])
    return all(getattr(one, key) == getattr(other, key) for key in named)


def _estimates(velocity: VelocityConfig, run: Run) -> Iterator[float]:
    estimator = make_estimator(velocity, run.options.resolution_m)
    x_measured_m = run.columns["x_measured_m"]
    estimator.start(x_measured_m[0])
    for x_m, v_m_per_s in zip(x_measured_m, run.columns["v_m_per_s"], strict=True):
        yield estimator.update(x_m, run.period_s, v_m_per_s)


def _velocity_error(velocity: VelocityConfig, run: Run) -> float:
    inside = run.in_contact
    off = np.array(list(_estimates(velocity, run))) - run.v_m_per_s
    return float(np.sqrt(np.mean(off[inside] ** 2))) if inside.any() else math.nan


def _estimating(velocity: VelocityConfig, run: Run) -> Callable[[], object]:
    """Estimates, one a call, on a slow movement such as windows grow long in."""
    estimator = make_estimator(velocity, run.options.resolution_m)
    last_m = run.columns["x_measured_m"][-1]
    estimator.start(last_m)
    return partial(estimator.update, last_m, run.period_s, 0.0)
