"""A press that counts as settled may still be felt: the index and the force say so beside the verdict."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from hapticd import plugins
from hapticd.config.walls import WallConfig
from hapticd.offline.felt import JUST_FELT, WINDOW_S
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.offline.presses import aimed, judge
from hapticd.simulation.batch import Batch, BatchResult, Point
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.felt_ends import felt_ends
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.robustness.report import report
from hapticd_studies.robustness.sweep import COLUMNS, RobustnessPlan

CRITERION = Criterion()


def press(law: str, stiffness_n_per_m: float, duration_s: float = 6.0, period_s: float = 1e-3) -> Point:
    device = SimulationOptions.model_validate(
        {"model": "omega7", "hand": {"force": {"profile": "constant", "newton": -3.0}}, "initial_position_m": 2e-3}
    )
    wall = WallConfig(stiffness_n_per_m=stiffness_n_per_m)
    return aimed(Point(device, wall, plugins.law(law).Params(), period_s, 12.0), CRITERION)


def run(law: str, points: list[Point], duration_s: float = 6.0) -> BatchResult:
    batch = Batch(
        plugins.law(law), points, duration_s, CRITERION.window_s, trace_every=1, ledger=False, trace_last_s=WINDOW_S
    )
    return batch.run()


def test_a_stiff_wall_that_chatters_within_two_counts_is_settled_and_felt() -> None:
    points = [press("energy-cycle", 12e3), press("energy-cycle", 119e3)]
    result = run("energy-cycle", points)
    assert list(judge(CRITERION, points, result)) == [Outcome.SETTLED, Outcome.SETTLED]
    felt, chatter_n = felt_ends(points, result)
    assert felt[0] < JUST_FELT
    assert chatter_n[0] < 0.1
    assert felt[1] > 30.0 * JUST_FELT
    assert chatter_n[1] > 3.0


def test_what_diverges_is_felt_without_bound() -> None:
    calm = press("none", 4e3)
    active = replace(calm, device=calm.device.model_copy(update={"viscous_n_s_per_m": -50.0}))
    points = [calm, active]
    result = run("none", points)
    assert list(result.finite) == [True, False]
    felt, chatter_n = felt_ends(points, result)
    assert felt[0] < math.inf
    assert math.isinf(felt[1])
    assert math.isinf(chatter_n[1])


def test_the_trace_of_the_end_is_the_end_of_the_trace() -> None:
    """Presses of other rates have another number of ticks in their last second."""
    points = [press("none", 8.5e3), press("none", 8.5e3, period_s=5e-4)]
    whole = Batch(plugins.law("none"), points, 3.0, CRITERION.window_s, trace_every=1, ledger=False).run().trace
    end = run("none", points, 3.0).trace
    assert end[0, :1000].tolist() == whole[0, 2000:3000].tolist()
    assert end[1].tolist() == whole[1, 4000:6000].tolist()


def test_a_press_shorter_than_the_window_is_looked_at_whole() -> None:
    points = [press("none", 4e3)]
    felt, _ = felt_ends(points, run("none", points, 0.5))
    assert felt[0] > 0.0


@pytest.mark.parametrize("felt", [0.5, 2.0])
def test_the_study_of_devices_counts_what_is_not_felt(felt: float) -> None:
    plan = RobustnessPlan(1, 3, [LawSpec("none", "none", {})], CRITERION)
    row = [0.0] * len(COLUMNS)
    row[COLUMNS.index("felt_index")] = felt
    (summary,) = report(plan, [np.array([row] * 3)]).summaries
    assert summary.not_felt.settled == (3 if felt <= JUST_FELT else 0)
    assert summary.not_felt.devices == 3
    assert summary.median_felt == felt
