"""States of daemons as families of Prometheus metrics, in SI units; docs/metrics.md says what each is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Final

from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    InfoMetricFamily,
    Metric,
)

from hapticd.telemetry.records import LATE_EDGES_US, Status, late_ticks

DAEMON: Final = "daemon"
"""The label that says which; Prometheus itself uses `instance` for what it scrapes."""

Daemons = Sequence[tuple[str, Status | None]]
"""Every daemon by its name, with its state; None for one that does not answer."""

_GAUGES: Final[dict[str, tuple[str, Callable[[Status], float]]]] = {
    "start_time_seconds": ("When the daemon started, since the epoch.", lambda s: s.started_timestamp),
    "armed": ("Forces are let through.", lambda s: s.armed),
    "releasing": ("The force is being ramped out.", lambda s: s.releasing),
    "latched": ("Stopped by a fault until cleared.", lambda s: s.latched),
    "fallback": ("The law failed, damping stands in for it.", lambda s: s.fallback),
    "device_present": ("The device is there.", lambda s: not s.device_lost_timestamp),
    "device_calibrated": ("The device knows where it is.", lambda s: s.calibrated),
    "realtime": ("Scheduling and memory are as the loop needs them.", lambda s: s.realtime),
    "rate_hertz": ("Ticks a second that the loop ran lately.", lambda s: s.measured_rate_hz),
    "rate_set_hertz": ("Ticks a second that the loop is set to.", lambda s: s.rate_hz),
    "late_ratio": (
        "Share of all ticks that started 160 us late or later.",
        lambda s: late_ticks(s.late_histogram) / (s.ticks or 1),
    ),
    "lateness_max_seconds": ("How late the latest tick started.", lambda s: s.late_max_us * 1e-6),
    "busy_max_seconds": ("How long the longest tick body took.", lambda s: s.busy_max_us * 1e-6),
    "force_limit_newtons": ("Largest force that the guard lets through; 0 for no limit.", lambda s: s.max_force_n),
    "warnings": ("How many things stand that should be known.", lambda s: len(s.warnings)),
    "last_fault_code": ("Code of the last fault; 0 when there was none.", lambda s: s.fault_code),
    "last_fault_timestamp_seconds": ("When it happened, since the epoch; 0 for never.", lambda s: s.fault_timestamp),
}

_COUNTERS: Final[dict[str, tuple[str, Callable[[Status], float]]]] = {
    "ticks": ("Ticks that the loop ran.", lambda s: s.ticks),
    "late_ticks": ("Ticks that started 160 us late or later.", lambda s: late_ticks(s.late_histogram)),
    "overruns": ("Deadlines that the loop skipped.", lambda s: s.overruns),
    "ring_drops": ("Ticks that the publisher was too slow to fetch.", lambda s: s.ring_drops),
    "event_drops": ("Events that it was too slow to fetch.", lambda s: s.event_drops),
    "faults": ("Faults.", lambda s: s.faults),
    "fault_records": ("Fault records written.", lambda s: s.fault_records),
    "requests_refused": ("Requests on the control socket that were not done.", lambda s: s.requests_refused),
}


def families(daemons: Daemons) -> Iterator[Metric]:
    """One family a quantity, with a sample for each daemon."""
    up = GaugeMetricFamily("hapticd_up", "The daemon answers.", labels=[DAEMON])
    for name, status in daemons:
        up.add_metric([name], status is not None)
    yield up
    answering = [(name, status) for name, status in daemons if status is not None]
    yield from _infos(answering)
    for key, (meaning, value) in _GAUGES.items():
        gauge = GaugeMetricFamily(f"hapticd_{key}", meaning, labels=[DAEMON])
        for name, status in answering:
            gauge.add_metric([name], value(status))
        yield gauge
    for key, (meaning, value) in _COUNTERS.items():
        counter = CounterMetricFamily(f"hapticd_{key}", meaning, labels=[DAEMON])
        for name, status in answering:
            counter.add_metric([name], value(status))
        yield counter
    yield _lateness(answering)
    yield _kept_by_drivers(answering)


def _infos(daemons: Sequence[tuple[str, Status]]) -> Iterator[Metric]:
    what: dict[str, tuple[str, Callable[[Status], dict[str, str]]]] = {
        "daemon": ("What runs.", lambda s: {"version": s.version, "config_hash": s.config_hash}),
        "law": ("The law in force.", lambda s: {"law": s.law}),
        "device": (
            "The device.",
            lambda s: {
                "driver": s.driver, "device": s.device, "serial": s.serial, "simulated": str(s.simulated).lower()
            },
        ),
    }  # fmt: skip
    for key, (meaning, fields) in what.items():
        info = InfoMetricFamily(f"hapticd_{key}", meaning, labels=[DAEMON])
        for name, status in daemons:
            info.add_metric([name], fields(status))
        yield info


def _lateness(daemons: Sequence[tuple[str, Status]]) -> Metric:
    histogram = HistogramMetricFamily("hapticd_lateness_seconds", "How late ticks started.", labels=[DAEMON])
    edges = [*(f"{edge_us * 1e-6:.6g}" for edge_us in LATE_EDGES_US), "+Inf"]
    for name, status in daemons:
        so_far, buckets = 0, []
        for edge, count in zip(edges, status.late_histogram, strict=True):
            so_far += count
            buckets.append((edge, float(so_far)))
        histogram.add_metric([name], buckets, sum_value=status.late_sum_us * 1e-6)
    return histogram


def _kept_by_drivers(daemons: Sequence[tuple[str, Status]]) -> Metric:
    kept = GaugeMetricFamily(
        "hapticd_device_metric", "Numbers that the driver keeps, since it was opened.", labels=[DAEMON, "metric"]
    )
    for name, status in daemons:
        for metric, value in status.device_metrics.items():
            kept.add_metric([name, metric], value)
    return kept
