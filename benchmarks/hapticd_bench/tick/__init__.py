"""What a tick costs, and how many of them a daemon runs."""

from hapticd_bench.tick.bars import CALM, judge, judge_body
from hapticd_bench.tick.block import stopwatch, timed
from hapticd_bench.tick.bodies import ROUNDS, Bodies, Body, Piece, measure_bodies
from hapticd_bench.tick.case import BAR, RATE_HZ, WARM_TICKS, Case, cases, scene
from hapticd_bench.tick.daemon import KeptRecords, RecordedLoop, Ticks, serve_daemon
from hapticd_bench.tick.rates import Rate, measure_rate
from hapticd_bench.tick.report import TickReport, duration_s, measure

__all__ = [
    "BAR",
    "CALM",
    "RATE_HZ",
    "ROUNDS",
    "WARM_TICKS",
    "Bodies",
    "Body",
    "Case",
    "KeptRecords",
    "Piece",
    "Rate",
    "RecordedLoop",
    "TickReport",
    "Ticks",
    "cases",
    "duration_s",
    "judge",
    "judge_body",
    "measure",
    "measure_bodies",
    "measure_rate",
    "scene",
    "serve_daemon",
    "stopwatch",
    "timed",
]
