"""What a tick costs, and how many of them a daemon runs."""

from hapticd.bench.tick.bars import CALM, judge, judge_body
from hapticd.bench.tick.block import stopwatch, timed
from hapticd.bench.tick.bodies import ROUNDS, Bodies, Body, Piece, measure_bodies
from hapticd.bench.tick.case import BAR, RATE_HZ, WARM_TICKS, Case, cases, scene
from hapticd.bench.tick.daemon import KeptRecords, RecordedLoop, Ticks, serve_daemon
from hapticd.bench.tick.rates import Rate, measure_rate
from hapticd.bench.tick.report import Report, duration_s, measure

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
    "Report",
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
