"""What the doctor says of lateness, and that its child measures what it says."""

from __future__ import annotations

import sys

import pytest

from hapticd.config.models import LoopConfig
from hapticd.doctor.latency import Latency, judge, measure
from hapticd.errors import HapticdError
from hapticd.measure import Quantiles
from tests.doctor.machine import says


def measured(
    p99_us: float = 30.0,
    *,
    skipped: int = 0,
    rate_hz: float = 1000.0,
    ticks: int = 5000,
    realtime: bool = True,
    virtual: bool = False,
    stolen: float = 0.0,
    others: float = 0.0,
    rivals: tuple[str, ...] = (),
) -> Latency:
    return Latency(
        rate_hz=rate_hz,
        seconds=ticks / rate_hz,
        realtime=realtime,
        late_us=Quantiles(ticks - skipped, p99_us / 2, p99_us, p99_us * 2, p99_us * 3),
        skipped=skipped,
        histogram=(ticks - skipped,),
        virtual=virtual,
        stolen=stolen,
        others=others,
        rivals=rivals,
    )


@pytest.mark.parametrize(("p99_us", "mark"), [(30.0, "ok"), (100.0, "ok"), (101.0, "advice"), (501.0, "problem")])
def test_lateness_is_judged_by_its_share_of_the_period(p99_us: float, mark: str) -> None:
    says(judge(measured(p99_us)), mark, f"p99 {p99_us:.0f} us")


def test_what_is_well_at_1_khz_is_late_at_8_khz() -> None:
    assert judge(measured(100.0)).mark == "ok"
    assert judge(measured(100.0, rate_hz=8000.0)).mark == "problem"


@pytest.mark.parametrize(("skipped", "mark"), [(5, "ok"), (6, "advice"), (51, "problem")])
def test_a_skipped_tick_is_not_in_the_histogram_and_counts_all_the_same(skipped: int, mark: str) -> None:
    says(judge(measured(skipped=skipped)), mark, f"{skipped} of 5000 deadlines skipped")


def test_a_guest_says_that_its_host_has_a_part_in_it() -> None:
    says(judge(measured(virtual=True)), "ok", "virtual machine", "host")
    found = says(judge(measured(600.0, virtual=True, stolen=0.04)), "problem", "4.0% of a processor")
    assert "not in a virtual machine" in found.mend[0]
    assert "virtual" not in judge(measured(600.0)).text


def test_the_remedy_is_the_nearest_cause() -> None:
    assert "mend scheduling" in judge(measured(600.0, realtime=False, virtual=True)).mend[0]
    assert "other programs stopped" in judge(measured(600.0, others=1.5)).mend[0]
    assert "bench lateness" in judge(measured(600.0)).mend[0]
    says(judge(measured(rivals=("12 cyclictest",))), "ok", "12 cyclictest")


def test_a_short_look_says_so() -> None:
    says(judge(measured(ticks=100)), "ok", "too short")


@pytest.mark.parametrize("rate_hz", [200.0, 1000.0])
def test_every_deadline_was_met_or_skipped(rate_hz: float) -> None:
    shares: list[float] = []
    # A realtime of "required" is what is examined, no reason to stop.
    found = measure(LoopConfig(rate_hz=rate_hz, realtime="required"), 0.5, shares.append)
    deadlines = round(0.5 * rate_hz)
    # The last skip may reach beyond the end.
    assert found.late_us.count <= deadlines <= found.late_us.count + found.skipped
    assert sum(found.histogram) == found.late_us.count
    assert 0.0 < found.late_us.p50 <= found.late_us.p99 <= found.late_us.max
    assert shares == sorted(shares)
    assert shares


def test_a_child_that_fails_is_reported_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(HapticdError, match="child that measures failed: 1"):
        measure(LoopConfig(), 0.1)
