"""The model of the device: what every setting costs, and what it makes of the configuration's scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hapticd.config.loading import LoadedConfig
from hapticd.offline.model_choice import operations
from hapticd.offline.outcome import pressing_n
from hapticd.offline.rehearsal import rehearse, simulation_options
from hapticd.offline.run import Run
from hapticd_studies.accuracy.cost import StepCost, costs
from hapticd_studies.accuracy.leak import Leak, leak
from hapticd_studies.accuracy.settings import Setting, default_name, settings_of


@dataclass(frozen=True, slots=True)
class ModelRow:
    """One setting.

    Attributes:
        name, family: of the setting.
        cost: of one period, interpreted as the daemon runs it.
        operations: instructions of the interpreter for it, as a mean over the run; where most is done outside of it, as
            many as would take as long. Settings are ranked by these: the count is the same on every machine.
        same_forces_m: largest error of the position under the forces of the exact run [m].
        position_m: largest error of the position in the loop [m].
        energy_j: largest error of the energy into the walls in the loop [J].
        leak: what a sampled wall gains under it; None without a wall.
        verdict: what became of the run.
        felt_index: how many times the threshold of a hand it vibrates at the end; NaN where nothing rests.
        force_chatter_n: span of its force there [N].
        displayed_n_per_m: stiffness shown at the end of the run [N/m]; NaN without contact.
        offered: may be chosen.
        best: nothing else that is offered is both cheaper and more accurate.
    """

    name: str
    family: str
    cost: StepCost
    operations: float
    same_forces_m: float
    position_m: float
    energy_j: float
    leak: Leak | None
    verdict: str
    felt_index: float
    force_chatter_n: float
    displayed_n_per_m: float
    offered: bool
    best: bool


@dataclass(frozen=True, slots=True)
class ModelStudy:
    """Every setting of a device.

    Attributes:
        rows: one a setting; the first is the reference, the exact step.
        default: name of the configuration's own setting.
        reference: the exact run.
    """

    rows: Sequence[ModelRow]
    default: str
    reference: Run

    def choice(self, below_m: float) -> ModelRow:
        """The cheapest setting whose error of position in the loop is below this [m]."""
        return min(
            (row for row in self.rows if row.offered and row.position_m <= below_m), key=lambda row: row.operations
        )

    def named(self, name: str) -> ModelRow:
        """The row of a setting."""
        return next(row for row in self.rows if row.name == name)


def measure_model(loaded: LoadedConfig, duration_s: float, progress: Callable[[str], object]) -> ModelStudy:
    """Run and time every setting.

    Args:
        loaded: the configuration.
        duration_s: simulated time of each run [s].
        progress: told what is being done, once for each setting and then once for each round of timing.
    """
    options = simulation_options(loaded)
    settings = list(settings_of(options))
    period_s = loaded.config.loop.period_s
    runs = []
    for setting in settings:
        progress(setting.name)
        runs.append(rehearse(loaded, duration_s, setting.options, setting.make_device))
    reference = runs[0]
    force_n = reference.columns["force_n"]
    steppers = [_stepper(setting, reference) for setting in settings]
    timed = costs([step for step, _ in steppers], lambda: progress("timing"), idle=steppers[0][1])
    rows = [
        ModelRow(
            name=setting.name,
            family=setting.family,
            cost=cost,
            operations=(
                operations(setting.options, period_s, force_n)
                if setting.counted
                else operations(reference.options, period_s, force_n) * cost.ns / timed[0].ns
            ),
            same_forces_m=_same_forces_m(setting, reference),
            position_m=run.position_error_m(reference),
            energy_j=run.energy_error_j(reference),
            leak=_leak(loaded, setting),
            verdict=run.outcome.words,
            felt_index=run.felt_index,
            force_chatter_n=run.force_chatter_n,
            displayed_n_per_m=run.displayed_stiffness_n_per_m,
            offered=setting.offered,
            best=False,
        )
        for setting, cost, run in zip(settings, timed, runs, strict=True)
    ]
    return ModelStudy(_marked(rows), default_name(options), reference)


def _stepper(setting: Setting, reference: Run) -> tuple[Callable[[], object], Callable[[], object]]:
    """The period in which the exact run was fastest, again and again, and what this does besides that period.

    A device at rest would cost less than it does in use.
    """
    device = setting.make_device(setting.options, reference.period_s)
    fastest = int(np.argmax(np.abs(reference.v_m_per_s)))
    force_n = reference.columns["force_n"]
    for command_n in [0.0, *force_n][: fastest + 1]:
        device.advance(command_n)
    state = device.state
    x_m, v_m_per_s, command_n = state.x_m, state.v_m_per_s, force_n[fastest]

    def step() -> None:
        state.x_m, state.v_m_per_s = x_m, v_m_per_s
        device.advance(command_n)

    def idle() -> None:
        state.x_m, state.v_m_per_s = x_m, v_m_per_s

    return step, idle


def _same_forces_m(setting: Setting, reference: Run) -> float:
    device = setting.make_device(setting.options, reference.period_s)
    largest = 0.0
    for command_n, exact_m in zip([0.0, *reference.columns["force_n"]], reference.columns["x_m"], strict=False):
        device.advance(command_n)
        if not abs(device.x_m) < math.inf:
            return math.inf
        largest = max(largest, abs(device.x_m - exact_m))
    return largest


def _leak(loaded: LoadedConfig, setting: Setting) -> Leak | None:
    walls = loaded.config.scene.walls
    if not walls or not walls[0].stiffness_n_per_m > 0.0:
        return None
    press_n = pressing_n(setting.options)
    stiffness = walls[0].stiffness_n_per_m
    depth_m = (press_n if press_n > 0.0 else 1.0) / stiffness
    return leak(setting.options, stiffness, loaded.config.loop.period_s, depth_m, setting.make_device)


def _marked(rows: Sequence[ModelRow]) -> list[ModelRow]:
    """The rows with the Pareto front marked: cost against error in the loop."""
    cost = np.array([row.operations if row.offered else math.inf for row in rows])
    error = np.array([row.position_m if row.offered else math.inf for row in rows])
    found = []
    for row in rows:
        better = (cost <= row.operations) & (error <= row.position_m)
        strictly = (cost < row.operations) | (error < row.position_m)
        found.append(replace(row, best=row.offered and not bool(np.any(better & strictly))))
    return found
