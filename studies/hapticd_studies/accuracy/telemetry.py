"""What a batch of telemetry trades: ticks that wait against messages that cost."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import zmq

from hapticd.config.loading import LoadedConfig
from hapticd.device import DeviceInfo
from hapticd.telemetry.publisher import BATCH_NS, Publisher
from hapticd.tick.contact_record import WallRecord
from hapticd.tick.record import TickRecord

BATCHES = (1, 2, 5, 10, 20, 50)
_TICKS = 4000
_ROUNDS = 3


@dataclass(frozen=True, slots=True)
class BatchRow:
    """One size of batch.

    Attributes:
        batch_ticks: most ticks in a message.
        mean_wait_s, longest_wait_s: how long a tick waits for its message [s].
        cpu_us: processor time a tick, ZeroMQ's threads included, with one subscriber to everything [us].
        ratio: of that to the cheapest.
        default: whether it is the configuration's own.
    """

    batch_ticks: int
    mean_wait_s: float
    longest_wait_s: float
    cpu_us: float
    ratio: float
    default: bool


def measure_batches(loaded: LoadedConfig, progress: Callable[[str], object]) -> list[BatchRow]:
    """Publish ticks in batches of every size to a subscriber that hears everything, in turns."""
    own = loaded.config.telemetry.batch_ticks
    period_s = loaded.config.loop.period_s
    sizes = sorted({*BATCHES, own})
    fastest = dict.fromkeys(sizes, float("inf"))
    for _ in range(_ROUNDS):
        for size in sizes:
            progress(f"telemetry in {size}s")
            fastest[size] = min(fastest[size], _cpu_s(loaded, size))
    rows = []
    for size in sizes:
        waits = min(size, max(1, round(BATCH_NS * 1e-9 / period_s)))
        cpu_s = fastest[size]
        rows.append(
            BatchRow(
                batch_ticks=size,
                mean_wait_s=0.5 * (waits - 1) * period_s,
                longest_wait_s=(waits - 1) * period_s,
                cpu_us=cpu_s * 1e6,
                ratio=cpu_s / min(fastest.values()),
                default=size == own,
            )
        )
    return rows


def _cpu_s(loaded: LoadedConfig, size: int) -> float:
    """Processor time that publishing one tick takes [s]."""
    config = loaded.config.telemetry.model_copy(
        update={"batch_ticks": size, "tcp": None, "ipc": True, "every_ticks": 1}
    )
    period_ns = loaded.config.loop.period_ns
    walls = tuple(WallRecord(True, 12e3, 18.9, 0.25, 0, 0.0, 0.0, 0.0, 0.0) for _ in loaded.config.scene.walls)
    tick = TickRecord(
        seq=0, deadline_ns=0, late_us=12.5, busy_us=21.25, dt_s=period_ns * 1e-9, skipped=0, flags=1, law=0, buttons=0,
        gripper_m=0.0, energy_j=1.25e-3, spring_energy_j=3.5e-4, dissipated_j=9.25e-4, generated_j=2.5e-5,
        position_m=(-2.5e-4,), velocity_m_per_s=(1.25e-2,), force_n=(3.0625,), force_requested_n=(3.125,),
        orientation=(), walls=walls,
    )  # fmt: skip
    info = DeviceInfo("", "", ("x",), 1.0, 0.0, ((-1.0, 1.0),), 1e3, 0.0, None)
    with tempfile.TemporaryDirectory(prefix="hapticd-") as folder, zmq.Context() as context:
        path = Path(folder) / "telemetry"
        publisher = Publisher(config, path, info, 0)
        try:
            with context.socket(zmq.SUB) as heard:
                heard.setsockopt(zmq.RCVHWM, 0)
                heard.subscribe(b"hapticd/")
                heard.connect(f"ipc://{path}")
                while not publisher.counts.subscriptions:
                    publisher.service()
                    time.sleep(1e-3)
                ticks = [replace(tick, seq=at, deadline_ns=at * period_ns) for at in range(_TICKS)]
                started = time.process_time()
                for at in range(0, _TICKS, 5):  # the supervisor looks at the ring every few ticks
                    publisher.publish(ticks[at : at + 5])
                return (time.process_time() - started) / _TICKS
        finally:
            publisher.close()
