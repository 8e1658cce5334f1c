"""A driver that breaks one rule fails the test that is about it."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

HEAD = '''
import math, pytest, hapticd.testing
from hapticd.driver import DeviceInfo, Driver, DriverOptions, Metric, Sample

class Good(Driver):
    """A device of two axes in a few lines."""

    def _open(self):
        self.force_n, self.sample, self.on = [0.0, 0.0], Sample(2), False
        return DeviceInfo("two axes", "", ("x", "y"), 4.0, 1e-5, ((-1.0, 1.0),) * 2, 1000.0, 2.0, None)

    def _enable(self):
        self.on = True

    def _read(self):
        return self.sample

    def _write(self, force_n):
        self.force_n = list(force_n)

    def _disable(self):
        self.force_n, self.on = [0.0, 0.0], False

    def _close(self):
        pass

class Suite(hapticd.testing.DriverContract):
    @pytest.fixture
    def driver(self):
        return self.kind(DriverOptions(), 0.001)

    def force_on_device(self, driver):
        return driver.force_n if driver.on else [0.0, 0.0]
'''

FAULTS = {
    "nothing": ("pass", ""),
    "keeps_force": ("def _disable(self): pass", "test_disable_takes_the_force_away"),
    "keeps_force_closed": (
        "def close(self): self.state = hapticd.driver.DriverState.CLOSED\n    def _open(self):\n"
        "        kept = getattr(self, 'force_n', [0.0, 0.0]), getattr(self, 'on', False)\n"
        "        info = Good._open(self)\n        self.force_n, self.on = kept\n        return info",
        "test_a_with_block_opens_the_device_and_gives_it_back_without_force",
    ),
    "swallows": (
        "def __exit__(self, *error):\n        self.close()\n        return True",
        "test_a_with_block_opens_the_device_and_gives_it_back_without_force",
    ),
    "wrong_axis": ("def _write(self, force_n): self.force_n = force_n[::-1]", "test_a_written_force_arrives"),
    "wrong_sign": ("def _write(self, force_n): self.force_n = [-n for n in force_n]", "test_a_written_force_arrives"),
    "unchecked": ("def write(self, force_n): self._write(force_n)", "is_no_force_is_refused_and_the_last_one_stays"),
    "one_axis": ("def _read(self): return Sample(1)", "test_samples_are_finite_and_have_one_element_an_axis"),
    "nan": ("def _read(self):\n        self.sample.position_m[0] = math.nan\n        return self.sample", "are_finite"),
    "no_clock": ("def _read(self):\n        self.sample.time_ns = 7\n        return self.sample", "clock_or_count"),
    "metric": ("METRICS = (Metric('lost frames', 'x'),)", "test_its_metrics_have_names_of_their_own"),
    "never_follows": (
        "def _enable(self): self.on, self.forces_flow = True, False",
        "test_it_says_soon_that_forces",
    ),
    "kick": ("def _enable(self): self.on, self.force_n = True, [1.0, 0.0]", "test_force_is_zero_from_enable_until"),
}


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What pytest says of each driver, as its author would run it."""
    folder = tmp_path_factory.mktemp("drivers")
    lines = [HEAD]
    for name, (body, _) in FAULTS.items():
        lines.append(f"class Kind_{name}(Good):\n    {body}\nclass Test_{name}(Suite):\n    kind = Kind_{name}\n")
    lines.append("class Test_bare(hapticd.testing.DriverContract): pass")
    (folder / "test_drivers.py").write_text("\n".join(lines) + "\n")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-rfE", "-p", "no:cacheprovider", "test_drivers.py"],
        cwd=folder, env={**os.environ, "COLUMNS": "400"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    found = {name: "\n".join(line for line in failed if f"Test_{name}::" in line) for name in (*FAULTS, "bare")}
    return found | {"": done.stdout}


@pytest.mark.parametrize("name", [name for name in FAULTS if name != "nothing"])
def test_a_fault_is_found_by_the_test_that_is_about_it(reports: dict[str, str], name: str) -> None:
    assert FAULTS[name][1] in reports[name], reports[""]


def test_a_driver_without_fault_passes(reports: dict[str, str]) -> None:
    assert reports["nothing"] == ""


def test_a_failed_assertion_shows_its_values(reports: dict[str, str]) -> None:
    assert "assert [-1.41" in reports[""]


def test_a_suite_without_its_fixture_says_what_it_needs(reports: dict[str, str]) -> None:
    assert "give the test class a fixture `driver`: a closed driver whose device is there" in reports["bare"]
