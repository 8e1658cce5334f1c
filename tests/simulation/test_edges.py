"""At the edges of what its options allow a simulated device gives numbers, or says which option goes too far."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from hapticd import plugins
from hapticd.config.loading import parse
from hapticd.config.walls import WallConfig
from hapticd.errors import ConfigError
from hapticd.simulation.batch import Batch, Point
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import FARTHEST_M, SimulationOptions
from tests.examples import examples


def decades(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda power: 10.0**power)


def zero_or(values: st.SearchStrategy[float]) -> st.SearchStrategy[float]:
    return st.just(0.0) | values


OPTIONS = st.fixed_dictionaries(
    {
        "model": st.just("paper-simulation"),
        "mass_kg": decades(-9, 6),
        "viscous_n_s_per_m": zero_or(decades(-300, 9)) | decades(-12, 6).map(lambda value: -value),
        "coulomb_n": zero_or(decades(-12, 6)),
        "resolution_m": zero_or(decades(-12, 0)),
        "noise_m": zero_or(decades(-300, 0)),
        "max_force_n": zero_or(decades(-300, 6)),
        "bandwidth_hz": zero_or(decades(-3, 9)),
        "force_delay_samples": st.integers(0, 128),
        "initial_position_m": st.floats(-1e3, 1e3),
        "initial_velocity_m_per_s": st.floats(-1e3, 1e3),
        "hand": st.fixed_dictionaries(
            {
                "mass_kg": zero_or(decades(-12, 6)),
                "damping_n_s_per_m": zero_or(decades(-12, 6)),
                "stiffness_n_per_m": zero_or(decades(-300, 9)),
                "force": st.fixed_dictionaries(
                    {"profile": st.just("constant"), "newton": st.floats(-1e6, 1e6)},
                )
                | st.fixed_dictionaries(
                    {"profile": st.just("sine"), "newton": st.floats(-1e6, 1e6), "frequency_hz": decades(-300, 6)}
                )
                | st.fixed_dictionaries(
                    {"profile": st.just("press-and-release"), "newton": st.floats(-1e6, 0), "period_s": decades(-6, 9)}
                ),
            }
        ),
    }
)


@examples(400)
@given(keys=OPTIONS, period_s=decades(-6, 1), force_n=st.floats(-1e6, 1e6))
def test_a_device_gives_numbers_or_names_the_option_that_goes_too_far(
    keys: dict[str, Any], period_s: float, force_n: float
) -> None:
    options = SimulationOptions.model_validate(keys)
    refused = ""
    try:
        device = SimulatedDevice(options, period_s)
    except ValueError as error:
        refused = str(error)
    if refused:
        assert re.search(r"(viscous_n_s_per_m|hand\.stiffness_n_per_m) = .*: .*(or more|at most)", refused)
        return
    for tick in range(60):
        device.advance(force_n if tick % 3 else -force_n)
        assert math.isfinite(device.x_m)
        assert math.isfinite(device.v_m_per_s)
        assert math.isfinite(device.measured_m)
        if abs(device.measured_m) > FARTHEST_M or abs(device.v_m_per_s) > 1e12:
            return  # where driver and batch stop it


@pytest.mark.parametrize(
    ("keys", "period_s", "says"),
    [
        ({"viscous_n_s_per_m": -25.1}, 1.0, "viscous_n_s_per_m = -25.1: 0.25 kg would speed up e^100-fold"),
        ({"hand": {"stiffness_n_per_m": 1e9}}, 100.0, "hand.stiffness_n_per_m = 1e+09: 0.25 kg would swing 1.01e+06"),
        ({}, 0.0, "period_s = 0: must be more than 0"),
        ({}, math.nan, "period_s = nan: must be more than 0"),
        ({"changes": [{"at_s": 1.0, "viscous_n_s_per_m": -1e6}]}, 1e-3, "viscous_n_s_per_m = -1e+06: 0.25 kg"),
    ],
)
def test_what_a_step_cannot_hold_is_refused_with_its_limit(keys: dict[str, Any], period_s: float, says: str) -> None:
    with pytest.raises(ValueError, match=re.escape(says)):
        SimulatedDevice(
            SimulationOptions.model_validate({"model": "paper-simulation", "mass_kg": 0.25, **keys}), period_s
        )


def test_a_configuration_that_cannot_be_stepped_is_refused_when_it_is_loaded() -> None:
    text = """
        loop.rate_hz = 100.0
        device.options = {{ mass_kg = 1e-3, viscous_n_s_per_m = {viscous} }}
        scene.walls = [{{ axis = "x", stiffness_n_per_m = 1000.0 }}]
    """
    parse(text.format(viscous=-9.9), "light.toml")
    with pytest.raises(
        ConfigError, match=r"light.toml: device.options: viscous_n_s_per_m = -11: .*; must be -10 or more"
    ):
        parse(text.format(viscous=-11.0), "light.toml")


def test_the_limits_themselves_are_still_steps() -> None:
    for keys in ({"viscous_n_s_per_m": -24.9}, {"hand": {"stiffness_n_per_m": 9e6}}):
        options = {"model": "paper-simulation", "mass_kg": 0.25, "initial_position_m": 1e-3, **keys}
        device = SimulatedDevice(SimulationOptions.model_validate(options), 1.0)
        device.advance(0.0)
        assert math.isfinite(device.x_m)
        assert math.isfinite(device.v_m_per_s)


def test_friction_below_what_a_force_resolves_is_refused() -> None:
    """A push of a denormal beyond friction would neither move the device nor let it rest."""
    with pytest.raises(ValidationError, match="must be 0 or at least 1e-12"):
        SimulationOptions.model_validate({"coulomb_n": 1e-320})
    with pytest.raises(ValidationError, match="must be 0 or at least 1e-12"):
        SimulationOptions.model_validate({"changes": [{"at_s": 1.0, "coulomb_n": 1e-320}]})


def test_a_batch_goes_on_where_it_was() -> None:
    law = plugins.law("none")
    device = SimulationOptions.model_validate(
        {
            "force_delay_samples": 2,
            "noise_m": 1e-6,
            "bandwidth_hz": 200.0,
            "hand": {"force": {"profile": "sine", "newton": 3.0, "offset_newton": -3.0, "frequency_hz": 3.0}},
        }
    )
    point = Point(device, WallConfig(stiffness_n_per_m=12_000.0), law.Params(), velocity_samples=3)
    whole = Batch(law, [point], 2.0, 2.0, trace_every=1).run().trace[0]
    batch = Batch(law, [point], 0.5, 0.5, trace_every=1)
    arrays = batch.arrays()
    parts = []
    for _ in range(4):
        batch.run_on(arrays)
        parts.append(arrays.traces[0].copy())
    assert np.array_equal(np.concatenate(parts), whole)
