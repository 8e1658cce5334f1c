"""What the doctor says of lateness and of the tick, and that its child measures what it says."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from hapticd.config.loading import LoadedConfig, parse
from hapticd.config.models import LoopConfig
from hapticd.doctor.latency import Latency, judge, judge_tick, measure
from hapticd.errors import HapticdError
from hapticd.measure import Quantiles
from tests.doctor.machine import says

WALL = '[[scene.walls]]\naxis = "x"\nposition_m = 0.0\nstiffness_n_per_m = 1000.0\n'

OwnLaw = Callable[[str], LoadedConfig]


@pytest.fixture
def own_law(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> OwnLaw:
    """Makes a configuration with a law of somebody's own, by what its step does."""
    package = tmp_path / f"lab_{tmp_path.name}"
    package.mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))

    def write(step: str) -> LoadedConfig:
        lines = [
            "import time",
            "from hapticd.law import LawParams",
            "class Params(LawParams): pass",
            "class State: n: int",
            "def start(state, params, snapshot): state.n = 0",
            f"def step(state, params, tick): {step}",
        ]
        (package / "law.py").write_text("\n".join(lines) + "\n")
        return parse(f'{WALL}[controller]\nlaw = "{package.name}.law"\n', "lab.toml")

    return write


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
    tick_p99_us: float = 30.0,
    tick_fault: str = "",
) -> Latency:
    return Latency(
        rate_hz=rate_hz,
        seconds=ticks / rate_hz,
        realtime=realtime,
        late_us=Quantiles(ticks - skipped, p99_us / 2, p99_us, p99_us * 2, p99_us * 3),
        tick_us=Quantiles(ticks - skipped, tick_p99_us / 2, tick_p99_us, tick_p99_us * 2, tick_p99_us * 3),
        tick_fault=tick_fault,
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


@pytest.mark.parametrize(
    ("p99_us", "rate_hz", "mark"),
    [(100.0, 1000.0, "ok"), (101.0, 1000.0, "advice"), (501.0, 1000.0, "problem"), (100.0, 8000.0, "problem")],
)
def test_a_tick_is_judged_by_its_share_of_the_period_as_well(p99_us: float, rate_hz: float, mark: str) -> None:
    latency = measured(tick_p99_us=p99_us, rate_hz=rate_hz)
    found = says(judge_tick(latency), mark, f"p99 {p99_us:.0f} us")
    assert judge(latency) == judge(measured(rate_hz=rate_hz))
    assert ["bench tick" in line for line in found.mend] == [True] * (mark != "ok")


def test_of_a_tick_that_stopped_nothing_is_said_but_why() -> None:
    says(judge_tick(measured(tick_p99_us=900.0, tick_fault="the law raised ValueError")), "unknown", "ValueError")


@pytest.mark.parametrize("rate_hz", [200.0, 1000.0])
def test_every_deadline_was_met_or_skipped(rate_hz: float) -> None:
    shares: list[float] = []
    # A realtime of "required" is what is examined, no reason to stop.
    found = measure(LoopConfig(rate_hz=rate_hz, realtime="required"), parse(WALL, "lab.toml"), 0.5, shares.append)
    deadlines = round(0.5 * rate_hz)
    # The last skip may reach beyond the end.
    assert found.late_us.count <= deadlines <= found.late_us.count + found.skipped
    assert sum(found.histogram) == found.late_us.count
    assert 0.0 < found.late_us.p50 <= found.late_us.p99 <= found.late_us.max
    assert (found.tick_us.count, found.tick_fault) == (found.late_us.count, "")
    assert 0.0 < found.tick_us.p50 <= found.tick_us.p99 <= found.tick_us.max
    assert shares == sorted(shares)
    assert shares


def test_what_a_law_takes_is_in_the_tick_and_what_it_prints_is_no_answer(own_law: OwnLaw) -> None:
    found = measure(LoopConfig(), own_law("time.sleep(0.002); print('a law talks'); return tick.contact_n"), 0.2)
    assert found.tick_us.p50 >= 2000.0
    assert found.skipped > 2 * found.tick_us.count - 10
    says(judge_tick(found), "problem", "longest")


def test_a_law_that_fails_in_the_tick_is_named(own_law: OwnLaw) -> None:
    found = measure(LoopConfig(), own_law("raise ValueError('no such mass')"), 0.2)
    assert found.late_us.count
    says(judge_tick(found), "unknown", "no such mass")


def test_without_a_configuration_the_loop_only_sleeps() -> None:
    found = measure(LoopConfig(), None, 0.2)
    assert found.late_us.count
    assert not found.tick_us.count
    says(judge_tick(found), "unknown", "the configuration cannot be used")


def test_a_child_that_fails_is_reported_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(HapticdError, match="child that measures failed: 1"):
        measure(LoopConfig(), None, 0.1)
