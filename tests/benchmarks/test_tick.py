"""The bench of the tick measures what it says, with the real loop in it."""

from __future__ import annotations

import json
import os
import shutil
from array import array
from pathlib import Path

import pytest

from hapticd import cli, plugins
from hapticd.config.loading import parse
from hapticd.errors import HapticdError
from hapticd.measure import Quantiles
from hapticd_bench import tick
from hapticd_bench.compiling import compile_c
from hapticd_bench.tick import Body, Ticks
from hapticd_bench.tick.memory import MemoryReader


class Clock:
    """A clock that goes when told to."""

    def __init__(self) -> None:
        self.ns = 1_000

    def __call__(self) -> int:
        return self.ns


class Stopped(Exception):  # noqa: N818 - nothing went wrong
    pass


def stop() -> None:
    raise Stopped


def body(group: str, p99_us: float, problem: str = "", name: str = "some", over: float = 0.0) -> Body:
    us = Quantiles(1000, p99_us / 2, p99_us, p99_us, p99_us)
    return Body(group, name, us, us, p99_us * 1e-3, over, 1.0, 1.0, 1.0, problem)


class TestStopwatch:
    def test_takes_the_time_between_two_sleeps_and_not_the_sleep(self) -> None:
        clock = Clock()
        spent = array("q", [0, 0, 0])

        def sleep_until(deadline_ns: int) -> int:
            clock.ns = deadline_ns + 50  # the sleep itself, and how late it ends
            return clock.ns

        sleep = tick.stopwatch(spent, sleep_until, stop, clock)
        for number in range(3):
            sleep(1_000_000 * (number + 1))
            clock.ns += 7 + number  # the body
        with pytest.raises(Stopped):
            sleep(4_000_000)
        assert list(spent) == [7, 8, 9]

    def test_hot_does_not_sleep(self) -> None:
        clock = Clock()
        spent = array("q", [0, 0])
        sleep = tick.stopwatch(spent, None, stop, clock)
        sleep(10**18)
        clock.ns += 3
        sleep(10**18)
        clock.ns += 4
        with pytest.raises(Stopped):
            sleep(10**18)
        assert list(spent) == [3, 4]


class TestBars:
    def test_only_laws_and_configurations_are_held_against_the_target(self) -> None:
        groups = ("reference", "law", "config", "walls")
        bars = tick.judge([body(group, 20.0) for group in groups], realtime=True, others=0.0)
        assert [bar.name.split()[0] for bar in bars] == ["law", "config"]
        assert {bar.verdict for bar in bars} == {"PASS"}

    def test_more_than_3_percent_of_the_period_fails_where_it_counts(self) -> None:
        assert tick.judge_body("x", 0.031, realtime=True, others=0.0).verdict == "FAIL"
        assert tick.judge_body("x", 0.030, realtime=True, others=0.0).verdict == "PASS"

    @pytest.mark.parametrize(("realtime", "others"), [(False, 0.0), (True, 0.5)])
    def test_a_miss_at_normal_priority_or_beside_other_work_says_nothing(self, realtime: bool, others: float) -> None:
        assert tick.judge_body("x", 0.031, realtime, others).verdict == "INCONCLUSIVE"
        assert tick.judge_body("x", 0.029, realtime, others).verdict == "PASS"

    @pytest.mark.parametrize(
        ("over", "held_up", "verdict"), [(0.012, 0.001, "FAIL"), (0.012, 0.002, "INCONCLUSIVE"), (0.05, 0.03, "FAIL")]
    )
    def test_a_miss_that_a_c_program_which_reads_memory_shares_says_nothing(
        self, over: float, held_up: float, verdict: str
    ) -> None:
        reference = body("reference", 5.0, name="memory in C", over=held_up)
        bars = tick.judge([reference, body("law", 100.0, over=over)], realtime=True, others=0.0)
        assert [bar.verdict for bar in bars] == [verdict]

    def test_a_pass_stays_one_however_restless_the_machine(self) -> None:
        reference = body("reference", 200.0, name="memory in C", over=0.02)
        bars = tick.judge([reference, body("law", 29.0, over=0.009)], realtime=True, others=0.0)
        assert [bar.verdict for bar in bars] == ["PASS"]

    def test_what_could_not_be_measured_is_not_judged(self) -> None:
        assert tick.judge([body("law", 0.0, problem="diverged")], realtime=True, others=0.0) == []


class TestMemory:
    def test_without_a_compiler_the_message_says_what_to_install(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("CC", "no-such-compiler")
        with pytest.raises(HapticdError, match="apt install gcc"):
            MemoryReader()

    def test_a_source_that_does_not_compile_is_named(self, tmp_path: Path) -> None:
        source = tmp_path / "broken.c"
        source.write_text("int main(void) { return nothing; }\n")
        with pytest.raises(HapticdError, match=r"broken\.c.*nothing"):
            compile_c(source, tmp_path / "broken")


class TestCases:
    def test_the_first_is_the_reference_and_every_text_is_a_configuration(self) -> None:
        found = tick.cases()
        assert (found[0].group, found[0].text) == ("reference", "")
        for case in found:
            if case.text:
                parse(case.text, case.name)

    def test_configurations_that_differ_in_numbers_only_are_measured_once(self) -> None:
        names = {case.name for case in tick.cases() if case.group == "config"}
        assert {"hapticd.toml", "wall-12-energy-cycle.toml", "fig6-set2-wall.toml"} <= names
        assert "wall-18-energy-cycle.toml" not in names

    @pytest.mark.parametrize("walls", [0, 1, 2, 8])
    def test_a_scene_has_as_many_walls_and_their_stiffness_sums_to_the_same(self, walls: int) -> None:
        built = parse(tick.scene(walls=walls), "x").config.scene.walls
        assert len(built) == walls
        assert sum(wall.stiffness_n_per_m for wall in built) == (12000.0 if walls else 0.0)


def test_the_first_seconds_of_a_run_can_be_left_out() -> None:
    ticks = Ticks()
    for number in range(10):
        ticks.seq.append(number)
        ticks.deadline_ns.append(10**12 + number * 100_000_000)
        ticks.late_us.append(1.0)
        ticks.busy_us.append(2.0)
        ticks.skipped.append(0)
    assert list(ticks.from_s(0.35).seq) == [4, 5, 6, 7, 8, 9]


def test_a_daemon_that_cannot_start_says_why() -> None:
    with pytest.raises(HapticdError, match="single axis"):
        tick.RecordedLoop(
            tick.serve_daemon, tick.scene(walls=1) + '[[scene.walls]]\naxis = "y"\nstiffness_n_per_m = 1.0\n'
        )


@pytest.mark.skipif(shutil.which(os.environ.get("CC", "cc")) is None, reason="no C compiler")
def test_bench_tick_measures_every_installed_law(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["bench", "tick", "--quick", "--json"])
    report = json.loads(capsys.readouterr().out)
    assert not ended.value.code
    laws = [each["name"] for each in report["bodies"] if each["group"] == "law"]
    assert laws == plugins.names(plugins.CONTROLLERS)
    for each in report["bodies"]:
        assert each["problem"] == ""
        assert each["paced_us"]["count"] == each["hot_us"]["count"] == 100
        assert 0.0 < each["paced_us"]["p50"] <= each["paced_us"]["p99"] <= each["paced_us"]["max"]
    assert report["bodies"][0]["p50_ratio"] == 1.0
    assert [piece["name"] for piece in report["pieces"]] == ["nothing", "read", "step", "write", "record"]
    assert all(piece["us"]["count"] == 100 for piece in report["pieces"])
    assert len(report["bars"]) == sum(each["group"] in ("law", "config") for each in report["bodies"])
    assert report["rates"] == []


def test_bench_alone_lists_the_benchmarks(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["bench"])
    assert ended.value.code == 2
    listed = capsys.readouterr().err
    assert all(name in listed for name in ("tick", "lateness", "telemetry", "batch"))
