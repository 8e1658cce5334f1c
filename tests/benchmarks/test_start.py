"""The benchmark of a start: its moments come in their order, and what costs time shows where it is."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hapticd import cli
from hapticd_bench import start


def test_it_reports_the_way_to_the_first_tick(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["bench", "start", "--starts", "1", "--json"])
    said = capsys.readouterr()
    assert not ended.value.code, said.err
    report = json.loads(said.out)
    moments = [report[name]["p50"] for name in ("helper", "loop", "tick")]
    assert moments == sorted(moments)
    assert moments[0] > 1.0, "no daemon is there sooner than an interpreter"
    assert set(report["processor"]) == set(report["imports"]) == {"supervisor", "helper", "loop"}
    for imports in report["imports"].values():
        assert "pydantic" in imports
        assert imports["all"] >= sum(imports.values()) - imports["all"]


def test_a_package_that_is_slow_to_import_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "slow_package.py").write_text("import time\ntime.sleep(3.0)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    found = start._imports("slow_package, json", 0.01)
    assert list(found)[:2] == ["all", "slow_package"]
    assert found["slow_package"] >= 300.0
