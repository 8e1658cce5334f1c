"""docs/faults.md and the codes that exist say the same, and every fault that is documented is provoked by a test."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from hapticd.config.models import FaultsConfig
from hapticd.loop.loop import BURST_TICKS, LATE_S
from hapticd.supervisor.child import STALL_S
from hapticd.supervisor.events import FLOOD
from hapticd.supervisor.recovery import FIRST_S, LONGEST_S, STEADY_S
from hapticd.tick.event import EventCode, LoopEvent
from hapticd.tick.motion import FROZEN_S, FROZEN_SAMPLES

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "faults.md").read_text()
PLACES = (
    "daemon/test_faults.py",
    "daemon/test_deaths.py",
    "drivers/forcedimension/test_daemon.py",
    "remote/test_daemon.py",
)
PROVOKED = "".join((ROOT / "tests" / place).read_text() for place in PLACES)
ROWS = re.findall(r"^\| (\d+) \| (\w+) \| (.+) \|$", PAGE, flags=re.MULTILINE)


def test_every_code_is_documented_once_and_none_is_invented() -> None:
    assert [(int(code), name) for code, name, _ in ROWS if int(code) < 200] == [
        (code.value, code.name) for code in EventCode if code < 200
    ]
    assert {(int(code), name) for code, name, _ in ROWS} == {(code.value, code.name) for code in EventCode}
    assert len(ROWS) == len(EventCode)


@pytest.mark.parametrize(("code", "name", "rest"), ROWS)
def test_every_row_is_complete(code: str, name: str, rest: str) -> None:
    cells = rest.split(" | ")
    assert len(cells) == {"1": 1, "2": 5, "3": 3}[code[0]], name
    assert all(cell.strip() for cell in cells)
    assert LoopEvent(int(code), "", 0, 0).is_fault == (code[0] == "2")


@pytest.mark.parametrize("code", [code for code in EventCode if code >= 200 and code != EventCode.NOT_REALTIME])
def test_every_fault_and_warning_is_provoked_on_a_daemon(code: EventCode) -> None:
    assert f"EventCode.{code.name}" in PROVOKED


def test_the_figures_of_the_page_are_those_of_the_code() -> None:
    waits = []
    wait_s = FIRST_S
    while wait_s < LONGEST_S:
        waits.append(f"{wait_s:g}")
        wait_s *= 2.0
    assert f"tried after {', '.join(waits)} and then every {LONGEST_S:g} s" in PAGE
    assert (STEADY_S, LATE_S, STALL_S) == (60.0, 0.05, 0.1)
    assert f"stood still for {FROZEN_S * 1e3:g} ms" in PAGE
    assert f"{FROZEN_SAMPLES} samples of its nominal rate" in PAGE
    assert f"{BURST_TICKS} deadlines and more" in PAGE
    assert f"more than {FLOOD} subscriptions" in PAGE
    assert f"are kept ({FaultsConfig().keep})" in PAGE
