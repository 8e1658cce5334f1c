"""The benchmark of the serial rig's driver: what it measures is there, and it is the driver that it measures."""

from __future__ import annotations

import json

import pytest

from hapticd import cli
from hapticd.errors import HapticdError
from hapticd_bench import rig

ATTEMPTS = 5


def test_it_reports_the_drivers_share_beside_bare_system_calls(capsys: pytest.CaptureFixture[str]) -> None:
    """A computer that is too busy to run the far end for a tenth of a second looks like a rig that is lost."""
    for _ in range(ATTEMPTS):
        with pytest.raises(SystemExit) as ended:
            cli.main(["bench", "rig", "--quick", "--json"])
        said = capsys.readouterr()
        if "answer" not in said.err:
            break
    assert not ended.value.code, said.err
    report = json.loads(said.out)
    assert report["driver_us"]["count"] == report["raw_us"]["count"] == 200
    assert report["trouble"] == 0
    assert report["share_p50_ratio"] == report["driver_us"]["p50"] / report["raw_us"]["p50"]
    assert report["driver_trip_us"]["p50"] > 0.0
    assert report["trips_per_s"] > 0.0


def test_without_a_compiler_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(HapticdError, match="apt install gcc"):
        rig.measure(100, lambda _: None)
