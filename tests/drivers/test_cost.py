"""What a tick costs is measured on each driver's own way; how much it is stands in docs/benchmarks.md, in no test."""

from __future__ import annotations

from importlib.metadata import entry_points
from pathlib import Path

import pytest

from tests.drivers.cost import ATTEMPTS, DOUBLES, measure, row


@pytest.mark.nightly
@pytest.mark.parametrize("name", DOUBLES)
def test_every_driver_is_measured_armed_beside_the_simulated_device(name: str) -> None:
    for attempt in range(1, ATTEMPTS + 1):
        try:
            found = measure(name, 100)
            break
        except AssertionError:
            if attempt == ATTEMPTS:
                raise
    assert (found["driver"], found["disarmed"]) == (name.partition(",")[0], "")
    assert found["write_us"]["count"] == 100
    assert row(name, found).startswith(f"| {name} | ")


def test_every_installed_driver_has_a_double_and_a_line_in_the_table() -> None:
    installed = {point.name for point in entry_points(group="hapticd.drivers")}
    assert {name.partition(",")[0] for name in DOUBLES} == installed
    page = (Path(__file__).parents[2] / "docs" / "benchmarks.md").read_text()
    assert [name for name in DOUBLES if f"\n| {name} | " not in page] == []
