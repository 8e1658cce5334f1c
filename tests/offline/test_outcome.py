"""Settled means still and in place; each alone is not enough."""

from __future__ import annotations

import math
from typing import Any

import pytest

from hapticd import plugins
from hapticd.config.loading import LoadedConfig, parse
from hapticd.config.walls import WallConfig
from hapticd.offline.outcome import Criterion, Outcome, balance
from hapticd.offline.presses import balance_m, judge, misplaced_m
from hapticd.offline.simulate import simulate
from hapticd.simulation.batch import Batch, Point
from hapticd.simulation.options import SimulationOptions

CRITERION = Criterion()


def press(stiffness: float, newton: float, law: str = "none", **device: Any) -> tuple[Point, Any]:
    hand = {"force": {"profile": "constant", "newton": -newton}, **device.pop("hand", {})}
    wall = WallConfig.model_validate({"stiffness_n_per_m": stiffness, **device.pop("wall", {})})
    options = SimulationOptions.model_validate({"hand": hand, **device})
    module = plugins.law(law)
    point = Point(options, wall, module.Params(), max_force_n=12.0)
    return point, Batch(module, [point], 4.0, CRITERION.window_s, ledger=False).run_interpreted()


def outcome(stiffness: float, newton: float, law: str = "none", **device: Any) -> Outcome:
    point, result = press(stiffness, newton, law, **device)
    (found,) = judge(CRITERION, [point], result)
    return Outcome(found)


def test_a_soft_wall_settles_and_a_hard_one_keeps_moving() -> None:
    assert outcome(5000.0, 3.0) is Outcome.SETTLED
    assert outcome(12000.0, 3.0) is Outcome.MOVING


def test_a_law_that_rests_two_newtons_too_shallow_has_not_settled() -> None:
    law = "tests.studies.pushing_law"
    point, result = press(5000.0, 3.0, law, resolution_m=0.0)
    assert result.peak_to_peak_m[0] < CRITERION.still_m
    assert misplaced_m([point], result)[0] == pytest.approx(-2.0 / 5000.0, rel=1e-3)
    assert outcome(5000.0, 3.0, law, resolution_m=0.0) is Outcome.ELSEWHERE


def test_an_active_device_diverges() -> None:
    assert outcome(3000.0, 3.0, viscous_n_s_per_m=-60.0, max_force_n=0.0) is Outcome.DIVERGED


def test_the_spring_of_the_hand_moves_the_place_and_so_does_a_wall_that_stiffens() -> None:
    held, _ = press(5000.0, 3.0, hand={"stiffness_n_per_m": 1000.0})
    stiffened, _ = press(3000.0, 3.0, wall={"changes": [{"at_s": 1.0, "stiffness_n_per_m": 6000.0}]})
    assert balance_m(held) == balance_m(stiffened) == pytest.approx(-5e-4)
    assert outcome(5000.0, 3.0, hand={"stiffness_n_per_m": 1000.0}) is Outcome.SETTLED
    assert outcome(3000.0, 3.0, wall={"changes": [{"at_s": 1.0, "stiffness_n_per_m": 6000.0}]}) is Outcome.SETTLED


def test_friction_may_hold_a_device_beside_the_balance() -> None:
    """1 N of friction at 1 kN/m: anywhere within 1 mm nothing moves it, and no law is to blame."""
    stuck: dict[str, Any] = {"coulomb_n": 1.0, "initial_position_m": -2.9e-3, "viscous_n_s_per_m": 40.0}
    point, result = press(1000.0, 2.0, **stuck)
    off_m = abs(misplaced_m([point], result)[0])
    assert 0.1 * 2e-3 < off_m < 1e-3
    assert outcome(1000.0, 2.0, **stuck) is Outcome.SETTLED


WALLS = """
[[scene.walls]]
position_m = 0.05
stiffness_n_per_m = 1000.0
[[scene.walls]]
position_m = 0.049
stiffness_n_per_m = 3000.0
"""


def pressed(newton: float, extra: str = "", walls: str = WALLS) -> LoadedConfig:
    hand = f'hand.force = {{ profile = "constant", newton = -{newton} }}'
    return parse(f'[controller]\nlaw = "none"\n[device.options]\n{hand}\n{extra}\n{walls}', "lab.toml")


def test_a_second_wall_carries_its_part_only_where_it_is_reached() -> None:
    """1 kN/m, and 1 mm deeper 3 kN/m more: 0.5 N ends before the second wall, 3 N half a millimetre inside it."""
    for newton, x_m, springs in ((0.5, -0.5e-3, 1000.0), (3.0, -1.5e-3, 4000.0)):
        loaded = pressed(newton)
        assert isinstance(loaded.options, SimulationOptions)
        found = balance(loaded.options, loaded.config.scene.walls)
        assert found.x_m == pytest.approx(x_m)
        assert found.springs_n_per_m == springs
        assert simulate(loaded, 2.0).mean_m == pytest.approx(x_m, abs=2e-5)


@pytest.mark.parametrize(
    ("stiffness", "extra", "words"),
    [
        (5000.0, "", "settled"),
        (12000.0, "", "keeps moving"),
        (1000.0, "coulomb_n = 1.0\ninitial_position_m = -3.9e-3\nviscous_n_s_per_m = 40.0", "settled"),
    ],
)
def test_a_run_of_the_loop_and_a_point_of_a_batch_are_judged_alike(stiffness: float, extra: str, words: str) -> None:
    """The last is held by friction a third of its depth beside the balance."""
    loaded = pressed(3.0, extra, f"[[scene.walls]]\nstiffness_n_per_m = {stiffness}")
    assert isinstance(loaded.options, SimulationOptions)
    assert simulate(loaded, 4.0).outcome.words == words
    law = plugins.law("none")
    point = Point(loaded.options, loaded.config.scene.walls[0], law.Params(), max_force_n=12.0)
    result = Batch(law, [point], 4.0, CRITERION.window_s, ledger=False).run_interpreted()
    assert Outcome(judge(CRITERION, [point], result)[0]).words == words


def test_stillness_is_never_finer_than_the_sensor() -> None:
    assert CRITERION.still_limit_m(SimulationOptions(resolution_m=1e-6)) == 5e-5
    assert CRITERION.still_limit_m(SimulationOptions(resolution_m=1e-4)) == 2e-4


def test_a_hand_that_does_not_press_has_no_balance() -> None:
    assert math.isnan(balance_m(press(5000.0, 0.0)[0]))


def test_every_output_says_what_settled_means() -> None:
    declared = Criterion(still_m=1e-4, place_share=0.05).declared()
    assert "at most 0.1 mm" in declared["words"]
    assert "within 5 %" in declared["words"]
    assert declared["still_m"] == 1e-4
