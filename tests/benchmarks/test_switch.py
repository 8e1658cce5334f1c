"""The benchmark of a switch: it measures a switch that took place, and says so when the daemon does not survive."""

from __future__ import annotations

import json

import pytest

from hapticd import cli
from hapticd.errors import HapticdError
from hapticd_bench import switch


def test_it_reports_the_longest_gap_before_and_during_a_switch(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["bench", "switch", "--switches", "2", "--burners", "1", "--json"])
    said = capsys.readouterr()
    assert not ended.value.code, said.err
    report = json.loads(said.out)
    for when in ("before_ms", "during_ms"):
        assert report[when]["count"] == 2
        assert report[when]["p50"] >= 1.0, "two ticks are never closer than a period"


def test_a_law_that_holds_the_loop_up_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """It computes for 20 ms as it is started, which is in the tick."""
    slow = """import time
    end_s = time.monotonic() + 0.02
    while time.monotonic() < end_s: pass
    state.damping"""
    monkeypatch.setattr(switch, "LAW", switch.LAW.replace("state.damping", slow, 1))
    assert switch.measure(1, 0, lambda _: None).during_ms.max >= 20.0


def test_a_law_that_is_none_is_refused_with_what_the_daemon_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(switch, "LAW", "nonsense(")
    with pytest.raises(HapticdError, match="was refused"):
        switch.measure(1, 0, lambda _: None)
