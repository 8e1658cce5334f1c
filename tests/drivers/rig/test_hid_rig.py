"""Every test of hid_inside.py, run in a process that sees the rig that is not there: this one cannot preload itself."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.drivers.rig import hid_inside
from tests.drivers.rig.hid_bench import PRELOAD

INSIDE = Path(hid_inside.__file__)
LONGEST_S = 600.0


def names() -> Iterator[str]:
    """Every test there, without its parameters; one of a class with the class before it."""
    for name, thing in vars(hid_inside).items():
        if name.startswith("test_"):
            yield name
        elif name.startswith("Test"):
            yield from (f"{name}.{method}" for method in dir(thing) if method.startswith("test_"))


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """For each test what became of it under each of its parameters: "" when it passed."""
    report = tmp_path_factory.mktemp("inside") / "report.xml"
    ours = ("PYTEST_", "UMOCKDEV_", "REPEAT", "TAKEN_MS")  # repeated, and disturbed, from out here
    kept = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", str(INSIDE), "-q", "-p", "no:cacheprovider", f"--junit-xml={report}"],
        env={**kept, "LD_PRELOAD": PRELOAD},
        cwd=INSIDE.parents[3],
        capture_output=True,
        text=True,
        timeout=LONGEST_S,
        check=False,
    )
    if not report.exists():
        pytest.fail(done.stdout + done.stderr)
    found: dict[str, list[str]] = {}
    for case in ElementTree.parse(report).iter("testcase"):
        *_, group = case.attrib["classname"].split(".")
        name = case.attrib["name"].partition("[")[0]
        found.setdefault(f"{group}.{name}" if group.startswith("Test") else name, []).append(
            "".join(f"{problem.tag}: {problem.text}\n" for problem in case)
        )
    return found


@pytest.mark.timeout(LONGEST_S)
@pytest.mark.parametrize("name", list(names()))
def test_inside(outcomes: dict[str, list[str]], name: str) -> None:
    skipped = [text for text in outcomes[name] if text.startswith("skipped")]
    if skipped:
        pytest.skip(skipped[0])
    assert not any(outcomes[name]), "\n".join(outcomes[name])
