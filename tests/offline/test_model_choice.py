"""A configuration that asks for an accuracy gets the cheapest model that keeps it, the same one every time."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.cli import main
from hapticd.config.loading import LoadedConfig, parse
from hapticd.errors import ConfigError
from hapticd.offline.model_choice import OMISSIONS, fit, fitted, omissions, without
from hapticd.offline.rehearsal import rehearse
from hapticd.simulation.options import SimulationOptions
from tests.examples import examples

FULL = """
[device.options]
model = "omega7"
initial_position_m = 0.005
resolution_m = 0.0
coulomb_n = 1e-4
noise_m = 1e-9
bandwidth_hz = 2000.0
force_delay_samples = 1
hand = {{ force = {{ profile = "constant", newton = -3.0 }}, stiffness_n_per_m = 1.0, damping_n_s_per_m = 2.0 }}
{accuracy}
[[scene.walls]]
stiffness_n_per_m = 2000.0
[controller]
law = "energy-cycle"
"""


def config(accuracy: str) -> LoadedConfig:
    return parse(FULL.format(accuracy=f"accuracy = {{ {accuracy}, over_s = 0.5 }}" if accuracy else ""), "lab.toml")


def errors(loaded: LoadedConfig) -> tuple[float, float]:
    """What the chosen model errs by in position and energy, measured here and not by what chose it."""
    full = config("")
    assert isinstance(full.options, SimulationOptions)
    assert isinstance(loaded.options, SimulationOptions)
    truth, found = rehearse(full, 0.5), rehearse(full, 0.5, loaded.options)
    assert truth.ticks == found.ticks == 500
    return (
        max(abs(a - b) for a, b in zip(truth.columns["x_m"], found.columns["x_m"], strict=True)),
        max(abs(a - b) for a, b in zip(truth.columns["energy_j"], found.columns["energy_j"], strict=True)),
    )


@pytest.mark.parametrize("position_m", [1e-9, 1e-6, 1e-5, 1e-3])
def test_the_error_asked_for_is_kept(position_m: float) -> None:
    found = fit(config(f"position_m = {position_m}"))
    assert found is not None
    error_m, error_j = errors(fitted(config(f"position_m = {position_m}")))
    assert error_m <= position_m
    assert (error_m, error_j) == (found.position_error_m, found.energy_error_j)


def test_a_looser_error_costs_less_and_none_costs_more_than_the_full_model() -> None:
    costs = []
    for position_m in (1e-12, 1e-6, 1e-5, 1e-3):
        found = fit(config(f"position_m = {position_m}"))
        assert found is not None
        costs.append(found.operations)
        assert found.operations <= found.full_operations
    assert costs == sorted(costs, reverse=True)
    assert costs[-1] < 0.5 * costs[0]


def test_both_errors_are_kept_when_both_are_asked_for() -> None:
    loose = fit(config("position_m = 1e-3"))
    both = fit(config("position_m = 1e-3, energy_j = 1e-5"))
    assert loose is not None
    assert both is not None
    assert both.energy_error_j <= 1e-5 < loose.energy_error_j
    assert both.operations > loose.operations


def test_the_same_file_gets_the_same_model_and_the_same_words() -> None:
    """Nothing in the choice is timed."""
    first, again = (fit(config("position_m = 1e-6")) for _ in range(2))
    assert first == again
    assert first is not None
    assert first.omitted == ("coulomb_n", "noise_m")
    assert "exact step without coulomb_n, noise_m: errs by" in first.reason


def test_what_the_device_declares_to_controllers_is_never_left_out() -> None:
    text = FULL.format(accuracy="accuracy = { position_m = 1.0, over_s = 0.5 }").replace("resolution_m = 0.0", "")
    found = fit(parse(text, "lab.toml"))
    assert found is not None
    assert (found.options.resolution_m, found.options.max_force_n) == (1e-5, 12.0)
    assert set(found.omitted) == {
        "coulomb_n", "noise_m", "bandwidth_hz", "force_delay_samples", "hand.stiffness_n_per_m"
    }  # fmt: skip


def test_a_term_that_comes_later_is_a_term() -> None:
    """Friction that sets in half-way may not be left out because there is none at the start."""
    text = FULL.format(
        accuracy="changes = [{ at_s = 0.3, coulomb_n = 2.0 }]\naccuracy = { position_m = 1e-6, over_s = 0.5 }"
    )
    found = fit(parse(text, "lab.toml"))
    assert found is not None
    assert "coulomb_n" not in found.omitted
    assert found.options.changes[0].coulomb_n == 2.0


def test_a_device_with_nothing_to_leave_out_keeps_its_exact_step() -> None:
    """It is the cheapest integrator too, so there is nothing to try."""
    found = fit(parse('[device.options]\nmodel = "omega7"\naccuracy = { position_m = 1.0, over_s = 0.1 }', "lab.toml"))
    assert found is not None
    assert (found.omitted, found.options.integrator, found.rehearsed) == ((), "exact", 1)
    assert found.reason == "exact step of every term: nothing else costs less"


def test_another_integrator_is_taken_where_friction_makes_the_exact_step_dear() -> None:
    """Every stop and turn of a hand that presses and lets go is exact only at a price that 0.1 mm need not pay."""
    text = """
        [device.options]
        initial_position_m = 0.005
        coulomb_n = 0.3
        accuracy = { position_m = 1e-4, over_s = 0.5 }
        [device.options.hand]
        force = { profile = "press-and-release", newton = -3.0, period_s = 0.3 }
        mass_kg = 0.1
        damping_n_s_per_m = 2.0
        stiffness_n_per_m = 100.0
        [[scene.walls]]
        stiffness_n_per_m = 2000.0
        [controller]
        law = "energy-cycle"
        """
    found = fit(parse(text, "lab.toml"))
    assert found is not None
    assert (found.options.integrator, found.omitted) == ("velocity-verlet", ())
    assert 1e-6 < found.position_error_m <= 1e-4
    assert found.operations < 0.6 * found.full_operations


def test_without_an_accuracy_nothing_is_chosen() -> None:
    loaded = config("")
    assert fit(loaded) is None
    assert fitted(loaded) is loaded


@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("accuracy = { }", "accuracy: name position_m, energy_j or both"),
        ("accuracy = { position_m = 0.0 }", "accuracy.position_m"),
        ("accuracy = { position_m = 1e-6, over_s = 100.0 }", "accuracy.over_s"),
        ('accuracy = { position_m = 1e-6 }\nintegrator = "rk4"', "accuracy chooses the integrator itself"),
        ('accuracy = { position_m = 1e-6 }\nclock = "wall"', 'needs clock = "ticks"'),
        ("substeps = 4", "substeps must be 1 with the exact integrator"),
    ],
)
def test_a_demand_that_makes_no_sense_is_refused_by_name(line: str, named: str) -> None:
    with pytest.raises(ConfigError, match=r"device\.options") as refused:
        parse(FULL.format(accuracy=line), "lab.toml")
    assert named in str(refused.value)


def test_check_says_which_model_and_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "lab.toml"
    file.write_text(FULL.format(accuracy="accuracy = { position_m = 1e-6, over_s = 0.5 }"))
    with pytest.raises(SystemExit) as left:
        main(["check", str(file)])
    assert not left.value.code
    assert "device.options.accuracy: exact step without coulomb_n, noise_m: errs by" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["check", "--json", str(file)])
    assert json.loads(capsys.readouterr().out)[0]["accuracy"].startswith("exact step without")


@examples(40)
@given(
    keys=st.fixed_dictionaries(
        {
            "coulomb_n": st.just(0.0) | st.floats(1e-3, 5.0),
            "noise_m": st.just(0.0) | st.floats(1e-9, 1e-3),
            "viscous_n_s_per_m": st.just(0.0) | st.floats(-2.0, -0.1) | st.floats(0.1, 5.0),
            "force_delay_samples": st.integers(0, 4),
            "max_force_n": st.just(0.0) | st.floats(0.1, 20.0),
        }
    ),
    later=st.floats(0.01, 5.0),
)
def test_a_device_without_its_terms_has_none_of_them_left(keys: dict[str, float], later: float) -> None:
    changes = [{"at_s": 1.0, "coulomb_n": later, "hand_mass_kg": later}]
    options = SimulationOptions.model_validate({**keys, "changes": changes})
    bare = without(options, omissions(options))
    assert not omissions(bare)
    assert not bare.changes
    assert SimulationOptions.model_validate(bare.model_dump(exclude_unset=True)) == bare
    assert math.isclose(bare.mass_kg, options.mass_kg)
    assert all(one.name and not one.present(bare) for one in OMISSIONS)
