"""How late the loop wakes, and how much of that is the loop's own: the paired witness.

A trivial loop in C (`witness.c`) sleeps to the same deadlines on the same processor at a higher priority. Whatever the
machine does at an instant hits both, so per tick

    excess = lateness of the loop - lateness of the witness

is what the loop adds. The same C program in the place of the loop says what any loop adds. The daemon runs whole, with
a publisher that computes heavily in the supervisor process; the C loop has nothing beside it.
"""

from __future__ import annotations

import os
import random
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hapticd.measure import Bar, Conditions, MachineWatch, Progress, Quantiles, Verdict, doubtful, ratio
from hapticd_bench.lateness_block import PERIOD_NS, Block, Load, Loop, check_rights, compile_witness, run_block
from hapticd_bench.tick import CALM, judge_body

LATE_US = 200.0
"""An excess beyond this counts as late; so does a witness [us]."""

RESTLESS = 0.01
"""A run in which the witness itself is late in more than this share of ticks says nothing."""

ENOUGH_TICKS = 12_000
"""Joined ticks that a cell needs for its p99.9 and its share of late ticks to be judged."""

EXCESS_P50_BAR = 1.3
EXCESS_P99_BAR = 2.0
EXCESS_P999_BAR = 2.0
SAME_TICK_P999_BAR = 1.5
LATE_SHARE_BAR = 1e-3


@dataclass(frozen=True, slots=True)
class Cell:
    """All blocks of one loop under one load, pooled.

    Attributes:
        loop: which loop.
        load: what else ran.
        joined: ticks that both loop and witness ran.
        loop_skipped, witness_skipped: deadlines that each had to skip.
        excess_us: loop minus witness, tick by tick [us].
        excess_late: share of ticks with an excess above `LATE_US`.
        late_us, witness_us: lateness of the loop and of its witness in the joined ticks [us].
        witness_late: share of ticks in which the witness was later than `LATE_US`.
        loop_over_1ms: ticks that the loop began more than a period late.
        busy_us: tick bodies [us].
        others: processors that programs which have no part in this kept busy, mean of the blocks.
    """

    loop: Loop
    load: Load
    joined: int
    loop_skipped: int
    witness_skipped: int
    excess_us: Quantiles
    excess_late: float
    late_us: Quantiles
    witness_us: Quantiles
    witness_late: float
    loop_over_1ms: int
    busy_us: Quantiles
    others: float

    @property
    def inconclusive(self) -> bool:
        """Whether the machine was too restless for this cell to say anything."""
        return self.joined == 0 or self.witness_late > RESTLESS


@dataclass(frozen=True, slots=True)
class LatenessReport:
    """All of `hapticd bench lateness`.

    Attributes:
        conditions: the machine.
        cpu: processor on which loops and witnesses ran.
        seed: of the order of the blocks.
        blocks: a cell.
        block_s: length of each [s].
        cells: one a loop and load.
        bars: the daemon against the C loop, then whether the negative control fails.
        thread_bars: the same bars for the thread layout.
    """

    conditions: Conditions
    cpu: int
    seed: int
    blocks: int
    block_s: float
    cells: tuple[Cell, ...]
    bars: tuple[Bar, ...]
    thread_bars: tuple[Bar, ...]


def measure(
    blocks: int = 4,
    block_s: float = 5.0,
    negative_control: bool = True,
    cpu: int | None = None,
    seed: int | None = None,
    progress: Progress = lambda seconds: None,
) -> LatenessReport:
    """Measure every cell: {idle, two burners} x {C loop, daemon}, and the thread layout idle.

    Args:
        blocks: a cell.
        block_s: length of each [s].
        negative_control: measure the thread layout as well.
        cpu: processor to measure on; None is the last one that this process may use, as for the daemon.
        seed: of the order of the blocks; None draws one.
        progress: told `block_s` after each block.

    Raises:
        RealtimeError: the rights are missing.
        HapticdError: no compiler, or a loop did not run.
    """
    machine = MachineWatch()
    cpu = max(os.sched_getaffinity(0)) if cpu is None else cpu
    seed = random.randrange(1 << 31) if seed is None else seed
    order = plan(blocks, negative_control)
    random.Random(seed).shuffle(order)
    measured: dict[tuple[Loop, Load], list[Block]] = {cell: [] for cell in sorted(set(order))}
    with tempfile.TemporaryDirectory(prefix="hapticd-bench-") as directory:
        witness = compile_witness(Path(directory))
        check_rights(witness, cpu)
        for loop, load in order:
            measured[loop, load].append(run_block(witness, cpu, loop, load, block_s, machine))
            progress(block_s)
    cells = tuple(pool(loop, load, parts) for (loop, load), parts in measured.items())
    bars = judge(cells, "daemon")
    bars += [
        judge_body(f"daemon, {cell.load}", cell.busy_us.p99 * 1e3 / PERIOD_NS, True, cell.others)
        for cell in cells
        if cell.loop == "daemon"
    ]
    thread_bars = judge(cells, "thread")
    if negative_control:
        bars.append(judge_control(thread_bars))
    conditions = machine.end()
    return LatenessReport(
        conditions=conditions,
        cpu=cpu,
        seed=seed,
        blocks=blocks,
        block_s=block_s,
        cells=cells,
        bars=tuple(doubtful(bars, conditions)),
        thread_bars=tuple(doubtful(thread_bars, conditions)),
    )


def plan(blocks: int, negative_control: bool) -> list[tuple[Loop, Load]]:
    """Loop and load of every block, not yet in random order."""
    cells: list[tuple[Loop, Load]] = [("C", "idle"), ("C", "burners"), ("daemon", "idle"), ("daemon", "burners")]
    if negative_control:
        cells.append(("thread", "idle"))
    return cells * blocks


def pool(loop: Loop, load: Load, blocks: Sequence[Block]) -> Cell:
    """Join each block on its deadlines, and put all blocks of a cell together."""
    pairs = [
        (late_us, block.witness_us[deadline_ns])
        for block in blocks
        for deadline_ns, late_us in block.late_us.items()
        if deadline_ns in block.witness_us
    ]
    excess_us = [late_us - witness_us for late_us, witness_us in pairs]
    count = len(pairs) or 1
    return Cell(
        loop=loop,
        load=load,
        joined=len(pairs),
        loop_skipped=sum(block.loop_skipped for block in blocks),
        witness_skipped=sum(block.witness_skipped for block in blocks),
        excess_us=Quantiles.of(excess_us),
        excess_late=sum(excess > LATE_US for excess in excess_us) / count,
        late_us=Quantiles.of(late_us for late_us, _ in pairs),
        witness_us=Quantiles.of(witness_us for _, witness_us in pairs),
        witness_late=sum(witness_us > LATE_US for _, witness_us in pairs) / count,
        loop_over_1ms=sum(late_us * 1e3 > PERIOD_NS for late_us, _ in pairs),
        busy_us=Quantiles.of(busy for block in blocks for busy in block.busy_us),
        others=sum(block.others for block in blocks) / (len(blocks) or 1),
    )


def judge(cells: Sequence[Cell], loop: Loop) -> list[Bar]:
    """Hold a loop against the C loop under the same load."""
    by_name = {(cell.loop, cell.load): cell for cell in cells}
    bars = []
    for cell in cells:
        reference = by_name.get(("C", cell.load))
        if cell.loop != loop or reference is None:
            continue
        same_tick = ratio(cell.late_us.p999, cell.witness_us.p999)
        judged = (
            ("excess p50 / C loop's", ratio(cell.excess_us.p50, reference.excess_us.p50), EXCESS_P50_BAR, False),
            ("excess p99 / C loop's", ratio(cell.excess_us.p99, reference.excess_us.p99), EXCESS_P99_BAR, False),
            ("excess p99.9 / C loop's", ratio(cell.excess_us.p999, reference.excess_us.p999), EXCESS_P999_BAR, True),
            ("p99.9 lateness / witness's", same_tick, SAME_TICK_P999_BAR, True),
            ("share of excess > 200 us", cell.excess_late, reference.excess_late + LATE_SHARE_BAR, True),
        )
        for name, measured, limit, in_tail in judged:
            verdict: Verdict = "PASS" if measured <= limit else "FAIL"
            note = _doubt(cell, reference, in_tail)
            if note:
                verdict = "INCONCLUSIVE"
            elif verdict == "FAIL" and cell.others > CALM:
                # The witness shows what keeps a processor busy, but hardly what empties its caches.
                note = f"other programs kept {cell.others:.2f} processors busy"
            bars.append(Bar(f"{loop}, {cell.load}: {name}", measured, limit, verdict, note))
    return bars


def judge_control(thread_bars: Sequence[Bar]) -> Bar:
    """The layout that is known to be bad has to miss a bar; if it does not, this harness measures nothing."""
    failed = [bar for bar in thread_bars if bar.verdict == "FAIL"]
    verdict: Verdict = "PASS" if failed else "FAIL"
    if not failed and (not thread_bars or any(bar.verdict == "INCONCLUSIVE" for bar in thread_bars)):
        verdict = "INCONCLUSIVE"
    return Bar(
        "negative control: bars that the thread layout does not miss",
        len(thread_bars) - len(failed),
        len(thread_bars) - 1,
        verdict,
    )


def _doubt(cell: Cell, reference: Cell, in_tail: bool) -> str:
    """Why a figure says nothing, empty when it does."""
    for each in (cell, reference):
        if each.inconclusive:
            return f"the witness of the {each.loop} loop was late in {each.witness_late:.1%} of ticks"
        if in_tail and each.joined + each.loop_skipped < ENOUGH_TICKS:
            return f"{each.joined} ticks of the {each.loop} loop are too few"
    return ""
