"""What telemetry costs: encoding and publishing ticks, with subscribers that read everything.

    hapticd bench telemetry [--seconds 5] [--quick] [--json]

Ticks are published at 1 kHz in the shipped batches while subscribers in another process read all topics and count
what they miss. The reference beside it, msgpack packing sixteen numbers, says what this machine is worth.
"""

from __future__ import annotations

import itertools
import math
import multiprocessing
import sys
import tempfile
import time
import timeit
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import msgpack
import zmq

from hapticd.config.models import TelemetryConfig
from hapticd.device import DeviceInfo
from hapticd.telemetry.clock import measure_epoch_offset_ns
from hapticd.telemetry.publisher import Publisher
from hapticd.telemetry.records import Status
from hapticd.telemetry.wire import Topic
from hapticd.tick.contact_record import WallRecord
from hapticd.tick.flags import Flag
from hapticd.tick.record import TickRecord

RATE_HZ = 1000
PERIOD_NS = 1_000_000
_TICKS_A_CALL = 5  # the supervisor looks at the ring every few ticks
_STIFFNESS_N_PER_M = 12000.0
_STROKE_S = 1.6  # one press and release of the synthetic hand


@dataclass(frozen=True, slots=True)
class PublishCost:
    """What publishing cost with some subscribers.

    Attributes:
        subscribers: that read all topics.
        ticks: published at 1 kHz.
        call_us: time that the publisher's caller spent, per tick, mean [us].
        worst_call_us: longest single call [us].
        cpu_us: processor time of the whole process, ZeroMQ's thread included, per tick [us].
        bytes_per_tick: payload of all topics.
        missing: ticks that any subscriber did not get.
        reference_us: packing sixteen floats with msgpack, in the same run [us].
    """

    subscribers: int
    ticks: int
    call_us: float
    worst_call_us: float
    cpu_us: float
    bytes_per_tick: float
    missing: int
    reference_us: float

    @property
    def ratio(self) -> float:
        """Processor time per tick in units of the reference."""
        return self.cpu_us / self.reference_us


def synthetic_info() -> DeviceInfo:
    """A device as `synthetic_records` have it: one axis, nothing else."""
    return DeviceInfo(
        model="synthetic",
        serial="",
        axes=("z",),
        max_force_n=12.0,
        resolution_m=1e-5,
        workspace_m=((-0.05, 0.05),),
        nominal_rate_hz=float(RATE_HZ),
        safe_damping_n_s_per_m=4.0,
        host_silence_ms=None,
        simulated=True,
    )


def synthetic_records(start_ns: int, first: int = 0) -> Iterator[TickRecord]:
    """Endless ticks of a hand that presses into a wall, bounces a little and lets go, at 1 kHz.

    Args:
        start_ns: deadline of tick 0 [ns of CLOCK_MONOTONIC].
        first: tick number to begin with.
    """
    seq = first
    while True:
        yield _tick(seq, start_ns + seq * PERIOD_NS)
        seq += 1


def measure(subscribers: int, seconds: float = 5.0) -> PublishCost:
    """Publish in real time for a while and see what it costs."""
    with tempfile.TemporaryDirectory(prefix="hapticd-bench-") as directory:
        offset_ns = measure_epoch_offset_ns()
        publisher = Publisher(TelemetryConfig(), Path(directory) / "telemetry", synthetic_info(), offset_ns)
        spawn = multiprocessing.get_context("spawn")
        ours, theirs = spawn.Pipe()
        reader = spawn.Process(target=_subscribe, args=(publisher.endpoints[0], subscribers, theirs))
        reader.start()
        try:
            publisher.status(Status(version="bench").as_map())
            while publisher.counts.subscriptions < subscribers:
                publisher.service()
                time.sleep(0.001)
            reference_us = _reference_us()
            call_us, worst_call_us, cpu_us, ticks = _publish(publisher, round(seconds * RATE_HZ))
            ours.send(ticks)
            received: int = ours.recv() if ours.poll(10.0) else 0
        finally:
            bytes_sent = publisher.counts.payload_bytes
            publisher.close()
            reader.join(5.0)
            reader.kill()
    missing = ticks * subscribers - received
    return PublishCost(subscribers, ticks, call_us, worst_call_us, cpu_us, bytes_sent / ticks, missing, reference_us)


def _publish(publisher: Publisher, ticks: int) -> tuple[float, float, float, int]:
    """Publish in real time.  -> call us per tick, worst call us, cpu us per tick, ticks."""
    records = list(itertools.islice(synthetic_records(0), ticks))
    spent = worst = 0
    start = time.monotonic_ns()
    cpu = time.process_time_ns()
    for at in range(0, ticks, _TICKS_A_CALL):
        due = records[at : at + _TICKS_A_CALL]
        for record in due:
            record.deadline_ns += start
        time.sleep(max(0, due[-1].deadline_ns - time.monotonic_ns()) * 1e-9)
        before = time.perf_counter_ns()
        publisher.publish(due)
        publisher.flush(time.monotonic_ns())
        took = time.perf_counter_ns() - before
        spent += took
        worst = max(worst, took)
    cpu = time.process_time_ns() - cpu
    publisher.flush(sys.maxsize)
    return spent / ticks / 1000, worst / 1000, cpu / ticks / 1000, ticks


def _reference_us() -> float:
    packer = msgpack.Packer()
    numbers = [1.0 / (index + 1) for index in range(16)]
    return min(timeit.repeat(lambda: packer.pack(numbers), number=2000, repeat=5)) / 2000 * 1e6


def _subscribe(endpoint: str, count: int, parent: Connection) -> None:
    """Read with `count` sockets until it hears how many ticks there were; say how many position ticks came."""
    context = zmq.Context()
    poller = zmq.Poller()
    received: dict[zmq.Socket[bytes], int] = {}
    for _ in range(count):
        socket = context.socket(zmq.SUB)
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.SUBSCRIBE, b"hapticd/")
        socket.connect(endpoint)
        poller.register(socket, zmq.POLLIN)
        received[socket] = 0
    ticks: int | None = None
    quiet_at = math.inf
    while time.monotonic() < quiet_at and (ticks is None or min(received.values(), default=ticks) < ticks):
        for socket, _ in poller.poll(100):
            topic, payload = socket.recv_multipart()
            if topic == Topic.POSITION.encode():
                received[socket] += len(msgpack.unpackb(payload))
        if ticks is None and parent.poll():
            ticks = parent.recv()
            quiet_at = time.monotonic() + 2.0
    parent.send(sum(received.values()))
    context.destroy(linger=0)


def _tick(seq: int, deadline_ns: int) -> TickRecord:
    t_s = seq / RATE_HZ
    stroke, phase = divmod(t_s, _STROKE_S)
    pressing = phase < _STROKE_S * 0.6
    ringing = 2.5e-4 * math.exp(-phase * 6.0) * math.sin(phase * 180.0) if pressing else 0.0
    away_m = 4e-3 * math.sin(math.pi * (phase / _STROKE_S - 0.6) / 0.4) if not pressing else 0.0
    x_m = -4e-4 * math.sin(math.pi * phase / (_STROKE_S * 0.6)) + ringing if pressing else away_m
    inside = x_m < 0.0
    wanted_n = -_STIFFNESS_N_PER_M * x_m if inside else 0.0
    applied_n = min(wanted_n, 12.0)
    damping = 24.0 * (1.0 - math.exp(-t_s / 3.0))
    cycle = int(t_s * 9.0)
    wall = WallRecord(inside, 12e3, damping, 0.253, cycle, 1.1e-3, 2e-5 if cycle % 5 == 0 else 0.0, damping, 0.111)
    stored_j = 0.5 * _STIFFNESS_N_PER_M * x_m * x_m if inside else 0.0
    made_j = 2e-5 * (cycle // 5)
    dissipated_j = 3e-3 * stroke + 2e-3 * phase
    flags = int(Flag.ARMED) | (int(Flag.LIMITED) if wanted_n > applied_n else 0)
    late_us = 6.0 + 4.0 * math.sin(seq * 0.7) + (900.0 if seq % 1777 == 0 else 0.0)
    return TickRecord(
        seq=seq,
        deadline_ns=deadline_ns,
        late_us=late_us,
        busy_us=14.0,
        dt_s=1.0 / RATE_HZ,
        skipped=0,
        flags=flags,
        law=1,
        buttons=0,
        gripper_m=0.0,
        energy_j=stored_j + dissipated_j - made_j,
        spring_energy_j=stored_j,
        dissipated_j=dissipated_j,
        generated_j=made_j,
        position_m=(x_m,),
        velocity_m_per_s=(0.0,),
        force_n=(applied_n,),
        force_requested_n=(wanted_n,),
        orientation=(),
        walls=(wall,),
    )
