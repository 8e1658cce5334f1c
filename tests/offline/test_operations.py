"""Instructions are counted, not timed: the same call, the same count; and what a device has not costs it none."""

from __future__ import annotations

import importlib.util
import inspect
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import FunctionType
from typing import Any

import pytest

from hapticd.offline.operations import count_operations, operations_by_code
from hapticd.simulation.compiler.specialise import specialise
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd.simulation.plant import bend, hold, move, sense, step, stepped, terms


def device(**keys: Any) -> SimulatedDevice:
    return SimulatedDevice(SimulationOptions.model_validate({"model": "paper-simulation", **keys}), 1e-3)


def period(**keys: Any) -> int:
    mover = device(initial_velocity_m_per_s=0.1, **keys)
    mover.advance(-0.5)
    return count_operations(partial(mover.advance, -0.5))


def ten_additions() -> int:
    value = 0
    for _ in range(10):
        value = value + 3
    return value


def twenty_additions() -> int:
    return ten_additions() + ten_additions()


def test_the_same_call_takes_the_same_instructions() -> None:
    assert len({period() for _ in range(5)}) == 1


def test_functions_that_are_called_count_each_time() -> None:
    counts = operations_by_code(twenty_additions)
    once = operations_by_code(ten_additions)
    assert counts[ten_additions.__code__] == 2 * once[ten_additions.__code__] > 100


def test_a_tracer_that_was_there_is_there_again_even_after_an_error() -> None:
    def tracer(*_: Any) -> None:
        return None

    def fails() -> None:
        raise ValueError

    before = sys.gettrace()
    sys.settrace(tracer)
    try:
        count_operations(ten_additions)
        with pytest.raises(ValueError):  # noqa: PT011 - it has no words
            count_operations(fails)
        assert sys.gettrace() is tracer
    finally:
        sys.settrace(before)


def test_every_term_costs_its_own_instructions_and_none_when_it_is_absent() -> None:
    bare = period()
    costs = {
        key: period(**{key: value}) - bare
        for key, value in {
            "resolution_m": 1e-5, "noise_m": 1e-6, "max_force_n": 5.0, "bandwidth_hz": 100.0,
            "force_delay_samples": 2, "coulomb_n": 0.1, "force_delay_s": 4e-4,
            "flexible": {"frequency_hz": 150.0, "handle_share": 0.3},
        }.items()
    }  # fmt: skip
    assert all(cost > 0 for cost in costs.values()), costs
    # Terms that do not stand next to each other: neighbours may share a jump of the compiler.
    several = {"resolution_m": 1e-5, "bandwidth_hz": 100.0, "force_delay_samples": 2}
    assert period(**several) == bare + sum(costs[key] for key in several)


@pytest.mark.parametrize("keys", [{"mass_kg": 3.0}, {"viscous_n_s_per_m": 2.0}, {"hand": {"damping_n_s_per_m": 9.0}}])
def test_what_only_changes_coefficients_costs_nothing(keys: dict[str, Any]) -> None:
    assert period(**keys) == period()


def test_the_exact_step_is_the_cheapest_integrator_too() -> None:
    exact = period()
    for integrator in ("explicit-euler", "semi-implicit-euler", "velocity-verlet", "rk4"):
        counts = [period(integrator=integrator, substeps=n) for n in (1, 2, 3)]
        assert counts[0] > exact
        assert counts[2] - counts[1] == counts[1] - counts[0] > 0


def test_a_plain_device_runs_no_line_of_what_it_has_not() -> None:
    mover = device()
    run = {code.co_name for code in operations_by_code(partial(mover.advance, -1.0))}
    absent: list[Callable[..., Any]] = [
        bend.bend, step.slide, step.stand_still, stepped.stepped, stepped.acceleration, hold.flow
    ]  # fmt: skip
    assert not run & {function.__name__ for function in absent}


def with_a_new_feature(tmp_path: Path, function: FunctionType, line: str) -> FunctionType:
    """The same function after somebody has added a feature to its source, behind a switch of its own."""
    module = inspect.getmodule(function)
    assert module is not None
    source = inspect.getsource(module)
    head = inspect.getsource(function)
    first = head.index("\n    ", head.index('"""', head.index('"""') + 3))
    assert source.count(head) == 1
    changed = source.replace(head, head[:first] + line + head[first:]) + "\n\nWARP: bool = True\n"
    file = tmp_path / f"{function.__name__}_with_more.py"
    file.write_text(changed)
    spec = importlib.util.spec_from_file_location("hapticd.simulation.plant.more", file)
    assert spec is not None
    assert spec.loader is not None
    extended = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(extended)
    found = getattr(extended, function.__name__)
    assert isinstance(found, FunctionType)
    return found


@pytest.mark.parametrize("function", [move, sense], ids=["move", "sense"])
def test_a_feature_that_is_added_and_not_used_changes_no_instruction(tmp_path: Path, function: FunctionType) -> None:
    """The added branch is gone before the function runs: instruction for instruction it is the one from before."""
    line = "\n    if WARP and params.period_s > 0.0:\n        state.x_m = state.x_m * 1.5"
    extended = with_a_new_feature(tmp_path, function, line)
    switches = terms(SimulationOptions.model_validate({"model": "omega7", "coulomb_n": 0.1}))
    before = specialise(function, switches)
    unused = specialise(extended, {**switches, "WARP": False})
    used = specialise(extended, {**switches, "WARP": True})
    assert unused.__code__.co_code == before.__code__.co_code
    assert len(used.__code__.co_code) > len(before.__code__.co_code)
