"""The harness says of made-up loops what is true of them, and its witness keeps the grid."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from hapticd import measure
from hapticd.cli import main
from hapticd.errors import HapticdError, RealtimeError
from hapticd.measure import MachineWatch, Quantiles, Verdict, doubtful
from hapticd_bench import lateness, lateness_block
from hapticd_bench.lateness import Cell
from hapticd_bench.lateness_block import Block, Load, Loop
from hapticd_bench.threaded import serve_threaded
from hapticd_bench.tick import RecordedLoop, scene, serve_daemon

MS = lateness_block.PERIOD_NS
needs_compiler = pytest.mark.skipif(shutil.which(os.environ.get("CC", "cc")) is None, reason="no C compiler")


def record(late_us: Sequence[float | None], first: int = 0) -> dict[int, float]:
    """Deadline to lateness; None is a deadline that was skipped."""
    return {(first + tick) * MS: late for tick, late in enumerate(late_us) if late is not None}


def block(loop: Sequence[float | None], witness: Sequence[float | None]) -> Block:
    return Block(record(loop), record(witness), sum(v is None for v in loop), sum(v is None for v in witness))


def cell(loop: Loop, excess_us: Sequence[float], witness_us: float = 60.0, load: Load = "idle") -> Cell:
    """A cell whose witness is always equally late and whose excess is given."""
    return lateness.pool(
        loop, load, [block([witness_us + excess for excess in excess_us], [witness_us] * len(excess_us))]
    )


def verdicts(cells: Sequence[Cell], loop: Loop = "daemon") -> dict[str, Verdict]:
    return {bar.name.partition(": ")[2]: bar.verdict for bar in lateness.judge(cells, loop)}


def a_loop(p50: float = 10.0, p99: float = 14.0, p999: float = 20.0) -> list[float]:
    """Excess of 20000 ticks with these quantiles."""
    return [p50] * 19_700 + [p99] * 250 + [p999] * 50


class TestQuantiles:
    def test_a_quantile_is_a_value_that_was_measured_and_that_share_is_not_above_it(self) -> None:
        found = Quantiles.of(range(1000, 0, -1))
        assert (found.count, found.p50, found.p99, found.p999, found.max) == (1000, 500, 990, 999, 1000)

    def test_of_a_single_value_is_that_value(self) -> None:
        assert Quantiles.of([7.0]) == Quantiles(1, 7.0, 7.0, 7.0, 7.0)

    def test_of_nothing_is_zero(self) -> None:
        assert Quantiles.of([]).count == 0


class TestJoin:
    def test_excess_is_taken_tick_by_tick_and_not_between_sorted_values(self) -> None:
        """A stall that hits both leaves no excess; comparing quantiles of each would not show that."""
        pooled = lateness.pool("daemon", "idle", [block([30, 5030, 30], [20, 5010, 20])])
        assert (pooled.excess_us.p50, pooled.excess_us.max) == (10, 20)
        assert pooled.late_us.max == 5030

    def test_ticks_that_only_one_of_them_ran_drop_out(self) -> None:
        pooled = lateness.pool("daemon", "idle", [block([30, None, 33, 31], [20, 20, None, 20])])
        assert pooled.joined == 2
        assert (pooled.loop_skipped, pooled.witness_skipped) == (1, 1)
        assert pooled.excess_us.max == 11

    def test_blocks_are_pooled_and_equal_deadlines_of_two_blocks_stay_apart(self) -> None:
        pooled = lateness.pool("daemon", "idle", [block([30, 30], [20, 20]), block([50, 50], [20, 20])])
        assert pooled.joined == 4
        assert (pooled.excess_us.p50, pooled.excess_us.max) == (10, 30)

    def test_shares_count_what_is_beyond_200_us(self) -> None:
        pooled = lateness.pool("daemon", "idle", [block([201, 400, 230, 30], [1, 199, 20, 250])])
        assert pooled.excess_late == 0.5
        assert pooled.witness_late == 0.25

    def test_only_the_time_that_the_witness_covers_counts(self) -> None:
        """The first 0.3 s of the witness are left out, and what comes after the measuring time."""
        witness = record([20.0] * 1700, first=1000)
        loop = record([30.0] * 3000, first=0)
        cut = lateness_block.cut(loop, witness, dict.fromkeys(loop, 14.0), seconds=1.0)
        assert (min(cut.late_us), max(cut.late_us)) == (1300 * MS, 2299 * MS)
        assert len(cut.late_us) == len(cut.witness_us) == len(cut.busy_us) == 1000
        assert (cut.loop_skipped, cut.witness_skipped) == (0, 0)

    def test_skipped_deadlines_are_counted_in_that_time(self) -> None:
        witness = record([20.0] * 1700, first=0)
        loop = {deadline: late for deadline, late in record([30.0] * 1700).items() if not 400 <= deadline // MS < 410}
        assert lateness_block.cut(loop, witness, {}, seconds=1.0).loop_skipped == 10

    def test_a_loop_that_came_too_late_is_an_error_and_not_a_result(self) -> None:
        with pytest.raises(HapticdError, match="was not there"):
            lateness_block.cut(record([30.0] * 10, first=2000), record([20.0] * 1700), {}, seconds=1.0)


class TestBars:
    def test_a_loop_like_the_c_loop_passes_all(self) -> None:
        found = verdicts([cell("C", a_loop()), cell("daemon", a_loop(11.0, 15.0, 21.0))])
        assert set(found.values()) == {"PASS"}
        assert len(found) == 5

    @pytest.mark.parametrize(
        ("bar", "daemon"),
        [
            ("excess p50 / C loop's", a_loop(p50=13.5)),
            ("excess p99 / C loop's", a_loop(p99=29.0, p999=30.0)),
            ("excess p99.9 / C loop's", a_loop(p999=41.0)),
            ("p99.9 lateness / witness's", a_loop(p999=35.0)),
            ("share of excess > 200 us", [*a_loop()[:-40], *[201.0] * 40]),
        ],
    )
    def test_each_bar_is_missed_by_what_it_is_there_for(self, bar: str, daemon: list[float]) -> None:
        assert verdicts([cell("C", a_loop()), cell("daemon", daemon)])[bar] == "FAIL"

    @pytest.mark.parametrize("restless", ["C", "daemon"])
    def test_a_restless_witness_beside_either_loop_makes_every_bar_inconclusive(self, restless: str) -> None:
        """Late in over 1 % of ticks: neither pass nor fail, however good or bad the figures are."""
        pairs: list[tuple[Loop, list[float]]] = [("C", a_loop()), ("daemon", a_loop(p50=500.0))]
        cells = [
            lateness.pool(
                loop,
                "idle",
                [
                    block(
                        [20.0 + value for value in excess],
                        [300.0 if loop == restless and tick % 90 == 0 else 20.0 for tick in range(len(excess))],
                    )
                ],
            )
            for loop, excess in pairs
        ]
        assert set(verdicts(cells).values()) == {"INCONCLUSIVE"}

    def test_a_witness_late_in_just_under_1_percent_decides_nothing(self) -> None:
        late = [300.0 if tick % 101 == 0 else 20.0 for tick in range(20_200)]
        assert not lateness.pool("C", "idle", [block(late, late)]).inconclusive

    def test_too_few_ticks_leave_the_tail_open_and_judge_the_rest(self) -> None:
        found = verdicts([cell("C", [10.0] * 2000), cell("daemon", [11.0] * 2000)])
        assert found["excess p50 / C loop's"] == found["excess p99 / C loop's"] == "PASS"
        assert [name for name, verdict in found.items() if verdict == "INCONCLUSIVE"] == [
            "excess p99.9 / C loop's",
            "p99.9 lateness / witness's",
            "share of excess > 200 us",
        ]

    def test_a_loop_is_compared_with_the_c_loop_under_the_same_load(self) -> None:
        cells = [cell("C", a_loop(p50=100.0), load="burners"), cell("C", a_loop()), cell("daemon", a_loop(p50=20.0))]
        assert verdicts(cells)["excess p50 / C loop's"] == "FAIL"

    def test_a_cell_without_a_single_joined_tick_is_inconclusive(self) -> None:
        assert lateness.pool("daemon", "idle", []).inconclusive


class TestNegativeControl:
    def test_passes_when_the_thread_layout_misses_a_bar(self) -> None:
        cells = [cell("C", a_loop()), cell("thread", a_loop(p99=5000.0, p999=10_000.0))]
        assert lateness.judge_control(lateness.judge(cells, "thread")).verdict == "PASS"

    def test_fails_when_the_thread_layout_passes(self) -> None:
        cells = [cell("C", a_loop()), cell("thread", a_loop())]
        assert lateness.judge_control(lateness.judge(cells, "thread")).verdict == "FAIL"

    def test_says_nothing_when_the_machine_was_restless(self) -> None:
        cells = [cell("C", a_loop(), 300.0), cell("thread", a_loop(p99=5000.0), 300.0)]
        assert lateness.judge_control(lateness.judge(cells, "thread")).verdict == "INCONCLUSIVE"


def test_beside_another_real_time_program_nothing_is_judged() -> None:
    """Two loops of one priority on one processor wait for each other, at every millisecond."""
    bars = lateness.judge([cell("C", a_loop()), cell("daemon", a_loop(p50=50.0))], "daemon")
    calm = MachineWatch().end()
    assert doubtful(bars, replace(calm, rivals=())) == bars
    assert {bar.verdict for bar in doubtful(bars, replace(calm, rivals=("42 other",)))} == {"INCONCLUSIVE"}


def test_every_cell_gets_as_many_blocks() -> None:
    plan = lateness.plan(3, negative_control=True)
    assert len(plan) == 15
    assert {plan.count(cell) for cell in plan} == {3}
    assert ("thread", "idle") not in lateness.plan(3, negative_control=False)


@pytest.fixture(scope="module")
def witness(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return lateness_block.compile_witness(tmp_path_factory.mktemp("witness"))


@needs_compiler
class TestWitness:
    def test_sleeps_to_whole_milliseconds_and_is_never_early(self, witness: Path, tmp_path: Path) -> None:
        cpu = max(os.sched_getaffinity(0))
        for name in ("a", "b"):
            done = subprocess.run(
                [witness, str(cpu), "0", "60", tmp_path / name], capture_output=True, text=True, check=True
            )
            assert done.stdout == "ready\n"
            pairs = lateness_block.read_pairs(tmp_path / name)
            assert len(pairs) == 60
            assert all(deadline % MS == 0 for deadline in pairs)
            assert all(late_us >= 0.0 for late_us in pairs.values())
            assert list(pairs) == sorted(pairs)

    def test_without_the_right_the_message_says_what_to_grant(self, tmp_path: Path) -> None:
        refusing = tmp_path / "witness"
        refusing.write_text("#!/bin/sh\necho 'sched_setscheduler: Operation not permitted' >&2\nexit 1\n")
        refusing.chmod(0o755)
        with pytest.raises(RealtimeError, match="CAP_SYS_NICE") as refused:
            lateness_block.check_rights(refusing, 0)
        assert refused.value.exit_code == 1
        assert "sched_setscheduler" in str(refused.value)

    def test_a_processor_that_is_not_there_is_named_by_the_witness(self, witness: Path) -> None:
        with pytest.raises(RealtimeError, match="sched_setaffinity"):
            lateness_block.check_rights(witness, 1000)


def test_a_processor_that_is_not_there_is_a_misuse(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["bench", "lateness", "--cpu", "100000"])
    assert ended.value.code == 2
    assert "--cpu 100000: must be one that this process may use: " in capsys.readouterr().err


def test_without_a_compiler_the_message_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(HapticdError, match="apt install gcc"):
        lateness_block.compile_witness(tmp_path)


@pytest.mark.parametrize("serve", [serve_daemon, serve_threaded])
def test_both_layouts_run_the_same_loop_on_the_common_grid(serve: Callable[..., None]) -> None:
    """What the harness compares is the loop with its publisher in another process, and in a thread beside it."""
    loop = RecordedLoop(serve, scene(loop='realtime = "off"'))
    try:
        ticks = loop.stop()
    finally:
        loop.kill()
    assert ticks.fault == ""
    assert len(ticks.seq) > 0
    assert all(deadline % MS == 0 for deadline in ticks.deadline_ns)
    assert list(ticks.seq) == list(range(ticks.seq[0], ticks.seq[0] + len(ticks.seq)))


def test_of_another_program_only_what_can_be_printed_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its command line is its own to choose, and may hold what a terminal obeys."""
    monkeypatch.setattr(measure, "_is_realtime", lambda _: True)
    monkeypatch.setattr(measure, "_is_ours", lambda *_: False)
    with subprocess.Popen(["late\n\x1b[2Jr", "60"], executable="/bin/sleep") as rival:
        try:
            assert f"{rival.pid} late  [2Jr 60" in measure.rivals()
        finally:
            rival.kill()
