"""A law that cannot be compiled, or not to the same bits, is named by line and construct, in its author's words."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from hapticd import plugins
from hapticd.config.walls import WallConfig
from hapticd.errors import PluginError
from hapticd.simulation.batch import Batch, Point
from hapticd.simulation.compiler.compile import compiled_step
from hapticd.simulation.compiler.lint import lint_law
from hapticd.simulation.options import SimulationOptions

HEAD = """
import math
from math import hypot
from hapticd.tick import energy
from hapticd.law import LawParams
from hapticd.tick.energy import CycleFields, cycle_ended

class Params(LawParams):
    gain: float = 1.0
    exponent: int = 2

class State(CycleFields):
    energy_j: float

def start(state, params, snapshot):
    state.energy_j = 0.0

def twice(value):
    return 2.0 * value
"""

Write = Callable[..., ModuleType]


@pytest.fixture
def write_law(tmp_path: Path) -> Write:
    """Makes a module of a law whose step has this body."""

    def write(body: str, more: str = "") -> ModuleType:
        lines = "".join(f"    {line}\n" for line in body.splitlines())
        file = tmp_path / "a_law.py"
        file.write_text(f"{HEAD}\ndef step(state, params, tick):\n{lines}\n{more}")
        spec = importlib.util.spec_from_file_location("a_law", file)
        assert spec is not None
        assert spec.loader is not None
        law = importlib.util.module_from_spec(spec)
        sys.modules["a_law"] = law
        spec.loader.exec_module(law)
        return law

    return write


@pytest.mark.parametrize("name", ["none", "energy-cycle", "tdpa"])
def test_the_shipped_laws_are_pure_arithmetic(name: str) -> None:
    assert lint_law(plugins.law(name)) == []


LAST_BITS = {
    "return tick.x_m ** 2": "**",
    "return pow(tick.x_m, 2.0)": "pow()",
    "return hypot(tick.x_m, 1.0)": "hypot()",
    "return math.sin(tick.x_m)": "math.sin()",
    "return math.exp(tick.x_m)": "math.exp()",
    "return tick.x_m % 1.0": "%",
    "tick.x_m = 0.0\nreturn 0.0": "writing tick.x_m",
}
IMPOSSIBLE = {
    "h = [0.0] * 5\nreturn h[0]": "a list",
    "return {1: 2.0}[1]": "a dict",
    "return sum(i for i in range(3))": "a generator",
    'if params.gain == "high":\n    return 1.0\nreturn 0.0': "the string 'high'",
    'return float(f"{tick.x_m}")': "a formatted string",
    "try:\n    return 1.0 / tick.x_m\nexcept ZeroDivisionError:\n    return 0.0": "try",
    "state.forgotten = 1.0\nreturn 0.0": "state.forgotten",
    "return params.unknown": "params.unknown",
    "return tick.force_n": "tick.force_n",
    "import random\nreturn random.random()": "import inside a function",
    "def inner():\n    return 1.0\nreturn inner()": "a function inside a function",
    "return (lambda: 1.0)()": "a lambda",
    "if tick.x_m is None:\n    return 1.0\nreturn 0.0": "`is`",
    "return 1.0 if tick.x_m in (1.0, 2.0) else 0.0": "`in`",
    "print(tick.x_m)\nreturn 0.0": "print()",
    "return not_there(tick.x_m)": "not_there()",
    "energy.cycle_ended(state, 0.0, True, 2, 2)\nreturn 0.0": "energy.cycle_ended()",
}


@pytest.mark.parametrize("body", LAST_BITS)
def test_what_compiles_to_other_bits_is_pointed_out_but_compiles(write_law: Write, body: str) -> None:
    law = write_law(body)
    found = lint_law(law)
    assert [finding.construct for finding in found] == [LAST_BITS[body]]
    assert not found[0].fatal
    assert Path(found[0].file).name == "a_law.py"
    source = Path(found[0].file).read_text().splitlines()[found[0].line - 1]
    assert source.strip() in body
    compiled_step(law)


@pytest.mark.parametrize("body", IMPOSSIBLE)
def test_what_cannot_be_compiled_is_refused_by_line_and_construct(write_law: Write, body: str) -> None:
    law = write_law(body)
    fatal = [finding for finding in lint_law(law) if finding.fatal]
    assert IMPOSSIBLE[body] in [finding.construct for finding in fatal]
    with pytest.raises(PluginError) as refused:
        compiled_step(law)
    lines = str(refused.value).splitlines()
    assert lines[0] == "law a_law cannot be compiled:"
    assert f"a_law.py:{fatal[0].line}: " in lines[1]
    assert len(lines) <= 1 + len(fatal)


def test_a_fault_in_a_function_that_the_law_calls_is_found_where_it_is(write_law: Write) -> None:
    law = write_law(
        "return twice(tick.x_m) + helper(state)",
        "def helper(memory):\n    return memory.missing\n",
    )
    (finding,) = lint_law(law)
    assert finding.construct == "memory.missing"
    assert finding.advice == "State has no such field"


def test_what_the_lint_lets_through_and_numba_does_not_is_still_said_in_one_line(write_law: Write) -> None:
    law = write_law("force = tick\nif tick.in_contact:\n    force = 1.0\nreturn force")
    with pytest.raises(PluginError) as refused:
        compiled_step(law)
    first, second = str(refused.value).splitlines()
    assert first == "law a_law cannot be compiled:"
    assert "a_law.py:" in second


def test_a_law_of_ones_own_runs_compiled_as_it_does_interpreted(write_law: Write) -> None:
    law = write_law(
        "state.energy_j -= tick.applied_n * tick.moved_m\n"
        "ended = cycle_ended(state, state.energy_j, tick.in_contact, params.exponent, 2)\n"
        "if ended and math.sqrt(abs(state.energy_j)) > 1e-3:\n"
        "    return max(0.0, tick.contact_n - twice(params.gain) * tick.velocity_m_per_s)\n"
        "return min(tick.contact_n, 100.0)"
    )
    assert lint_law(law) == []
    device = SimulationOptions.model_validate(
        {"hand": {"force": {"profile": "constant", "newton": -3}}, "initial_position_m": 0.002}
    )
    at = Point(device, WallConfig(stiffness_n_per_m=9000.0), law.Params())
    batch = Batch(law, [at], 2.0, trace_every=1)
    assert (batch.run().trace == batch.run_interpreted().trace).all()
