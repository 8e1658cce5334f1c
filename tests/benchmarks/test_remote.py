"""The benchmark of clients: it measures messages that were in force, and judges them by the echo of the same run."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from hapticd import cli
from hapticd.measure import Conditions
from hapticd_bench import remote

QUIET = Conditions("", "", "", 0.0, 0.0, 0.0, 0.0, (), 1.0)


def test_it_reports_every_way_beside_the_echo(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["bench", "remote", "--messages", "10", "--json"])
    said = capsys.readouterr()
    assert not ended.value.code, said.err
    report = json.loads(said.out)
    assert report["echo_us"]["count"] == 20
    assert report["to_tick_us"]["count"] == 10
    assert report["to_client_us"]["count"] >= 10
    assert report["echo_us"]["p50"] > 0.0
    assert [bar["limit"] for bar in report["bars"][:2]] == pytest.approx(
        [1000.0 + 3.0 * report["echo_us"]["p50"], 3.0 * report["echo_us"]["p50"]]
    )


def test_what_takes_longer_than_is_asked_fails() -> None:
    report = remote._report([100.0] * 100, [1301.0] * 100, [299.0] * 99 + [301.0], QUIET, False)
    assert [bar.verdict for bar in report.bars] == ["FAIL", "PASS", "FAIL", "PASS"]


def test_beside_other_programs_only_those_are_judged_that_they_do_not_disturb() -> None:
    busy = replace(QUIET, others=1.5)
    for realtime, verdict in ((False, "INCONCLUSIVE"), (True, "PASS")):
        report = remote._report([100.0] * 100, [1200.0] * 100, [200.0] * 100, busy, realtime)
        assert {bar.verdict for bar in report.bars} == {verdict}
