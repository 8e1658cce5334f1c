"""A law that breaks one rule fails the test that is about it, and the message shows where."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

import hapticd.testing
from hapticd import Outcome
from hapticd.errors import ConfigError
from hapticd.testing import press

LAW = '''
"""A law with one fault."""
from typing import Literal
from hapticd.law import Field, LawParams

RULE_SOFT, RULE_HARD = range(2)

class Params(LawParams):
    rule: Literal["soft", "hard"] = "soft"

class State:
    sum_m: float
    count: int

def start(state, params, snapshot):
    state.sum_m = 0.0
    state.count = 0

def step(state, params, tick):
    state.count += 1
    return tick.contact_n
'''

FINITE = "test_finite_ticks_give_a_finite_force_and_a_state_of_numbers"
FAULTS = {
    "none": ("", "", ""),
    "no_docstring": ('"""A law with one fault."""', "", "test_it_says_what_it_is_in_its_first_line"),
    "power": (
        "return tick.contact_n",
        "return tick.contact_n + 0.0 * min(tick.x_m, 1.0) ** 2",
        "test_it_is_arithmetic",
    ),
    "list": ("return tick.contact_n", "return max([tick.contact_n, 0.0])", "test_it_is_arithmetic_on_numbers"),
    "constants": ("RULE_SOFT, RULE_HARD", "RULE_HARD, RULE_SOFT", "test_a_choice_is_the_constant_of_its_name"),
    "divides": ("return tick.contact_n", "return tick.contact_n / tick.velocity_m_per_s", FINITE),
    "overflows": ("return tick.contact_n", "return tick.contact_n * 1e300", FINITE),
    "nothing": ("return tick.contact_n", "state.count = 1", FINITE),
    "runs_away": ("state.count += 1", "state.sum_m = 2.0 * state.sum_m + tick.x_m * 1e290", FINITE),
    "half_counts": ("state.count += 1", "state.count += 0.5", "is declared as int and is 0.5"),
    "debt": ("state.sum_m = 0.0", "state.sum_m = 1.0 / snapshot.debt_j", "test_it_starts_from_any_snapshot"),
    "outside": ("return tick.contact_n", "return tick.contact_n / (0.0 if tick.x_m > 0.0 else 1.0)", "feels_nothing"),
    "overflows_as_machine_code": ("state.count += 1", "state.count += 4611686018427387904", "last_bit"),
}
NAMES_A_FIELD_AND_A_TICK = ("half_counts", "State.count"), ("divides", "LawTick(applied_contact_n=")


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What pytest says of each law, as its author would run it."""
    folder = tmp_path_factory.mktemp("laws")
    (folder / "faulty").mkdir()
    lines = ["import hapticd.testing"]
    for name, (right, wrong, _) in FAULTS.items():
        assert right in LAW
        (folder / "faulty" / f"{name}.py").write_text(LAW.replace(right, wrong) if right else LAW)
        lines.append(f"class Test_{name}(hapticd.testing.LawContract):\n    law = 'faulty.{name}'")
    (folder / "test_laws.py").write_text("\n".join(lines) + "\n")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-rf", "-p", "no:cacheprovider", "test_laws.py"],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(folder), "COLUMNS": "400"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    found = {name: "\n".join(line for line in failed if f"Test_{name}::" in line) for name in FAULTS}
    return found | {"": done.stdout}


@pytest.mark.parametrize("name", [name for name in FAULTS if name != "none"])
def test_a_fault_is_found_by_the_test_that_is_about_it(reports: dict[str, str], name: str) -> None:
    assert FAULTS[name][2] in reports[name], reports[""]


def test_a_law_without_fault_passes(reports: dict[str, str]) -> None:
    assert reports["none"] == ""


@pytest.mark.parametrize(("name", "said"), NAMES_A_FIELD_AND_A_TICK)
def test_the_report_names_the_field_or_the_tick(reports: dict[str, str], name: str, said: str) -> None:
    assert reports[name]
    assert said in reports[""]


def test_a_press_says_what_became_of_it() -> None:
    assert press("none", stiffness_n_per_m=3e3).settled
    rattling = press("none", stiffness_n_per_m=12e3, start_m=0.002)
    assert (str(rattling.outcome), rattling.settled, rattling.fault) == ("keeps moving", False, None)
    assert len(rattling.x_m) == 3000
    capped = {"cap": "fixed", "cap_damping_n_s_per_m": 0.1}
    assert press("energy-cycle", stiffness_n_per_m=12e3, start_m=0.002).settled
    assert press("energy-cycle", capped, stiffness_n_per_m=12e3, start_m=0.002).outcome is Outcome.MOVING


def test_a_press_takes_the_keys_of_a_configuration_and_refuses_others() -> None:
    brief = press("none", rate_hz=2000.0, duration_s=0.1, device={"model": "falcon"}, hand_n=-1.0)
    assert (len(brief.x_m), brief.options.model) == (200, "falcon")
    with pytest.raises(ConfigError, match=r"press: controller\.params\.windw = 3: unknown key"):
        press("energy-cycle", {"windw": 3})
    with pytest.raises(ConfigError, match=r'press: controller\.law = "magic": not installed'):
        press("magic")


def test_the_suites_say_what_they_need_where_pytest_is_not_installed() -> None:
    script = (
        "import sys; sys.modules['pytest'] = None\n"
        "import hapticd.testing\n"
        "print(hapticd.testing.press('none', stiffness_n_per_m=2e3).outcome)\n"
        "hapticd.testing.LawContract\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.stdout == "settled\n"
    assert done.stderr.splitlines()[-1].endswith("hapticd.testing.LawContract needs pytest: pip install pytest")


def test_a_name_that_there_is_not_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Contract'"):
        _ = hapticd.testing.Contract
