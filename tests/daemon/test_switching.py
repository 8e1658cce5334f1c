"""Hundreds of random switches, good and bad files, on a real daemon under a hand that presses 12 kN/m.

`pytest tests/daemon/test_switching.py -m nightly` does a thousand of them.
"""

from __future__ import annotations

import hashlib
import math
import os
import random
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgpack
import pytest
import zmq

from hapticd.tick.event import EventCode
from tests.daemon.running import PATIENCE_S, Daemon, Subscriber
from tests.daemon.test_deaths import PRESSED, Report, pressing

LIMIT_N = 12.0
LOWEST_LIMIT_N = 9.0
RAMP_TICKS = 50
RAMP_STEP_N = LIMIT_N / RAMP_TICKS

QUEUE = "telemetry.send_high_water = 20000\n"
"""A supervisor that a busy computer held up sends what waits at once, five messages a tick where batches are of one."""

DEVICE = PRESSED.split("[[scene.walls]]")[0]

LAWS = [
    ("none", ""),
    ("energy-cycle", ""),
    ("energy-cycle", "window = 1\ncap = 'fixed'"),
    ("energy-cycle", "rule = 'signed'\nwork = 'total'"),
    ("tdpa", ""),
    ("tdpa", "damping_cap_n_s_per_m = 0\nmin_speed_m_per_s = 0\nreset = 'never'"),
]

SCENES = {
    "a wall": ["stiffness_n_per_m = 12000.0"],
    "a damped wall": ["stiffness_n_per_m = 12000.0\ndamping_n_s_per_m = 2.0"],
    "an active wall": ["stiffness_n_per_m = 12000.0\ndamping_n_s_per_m = -1.0"],
    "a stiffer wall": ["stiffness_n_per_m = 20000.0"],
    "a wall that changes": [
        "stiffness_n_per_m = 12000.0\nchanges = [{ at_s = 0.02, stiffness_n_per_m = 20000.0 }, "
        "{ at_s = 0.04, damping_n_s_per_m = 1.0 }]"
    ],
    "two walls in one place": ["stiffness_n_per_m = 6000.0", "stiffness_n_per_m = 6000.0\ndamping_n_s_per_m = 1.0"],
    "a wall behind": [
        "stiffness_n_per_m = 12000.0",
        "stiffness_n_per_m = 12000.0\nfree_side = 'negative'\nposition_m = 0.05",
    ],
}

LIMITS = ["", "max_force_n = 9.0", "max_axis_force_n = 10.0\nsupervisor_stall_s = 20.0"]

BAD = [
    "[[[",
    "",  # filled in below: half of a good file
    '[controller]\nlaw = "tdap"\n',
    "[loop]\nrate_hz = 2000.0\n",
    "[velocity]\nsamples = 4\n",
    "[device.options]\nmass_kg = 1.0\n",
    "telemetry.tcp = 'tcp://127.0.0.1:19999'\n",
    "[[scene.walls]]\nstiffness_n_per_m = -1.0\n",
    "[[scene.walls]]\nstiffness_n_per_m = 1.0\n[[scene.walls]]\naxis = 'x'\nstiffness_n_per_m = 1.0\n",
    "[safety]\nmax_force_n = 50.0\n",
    "[safety]\nprofile = 'none'\n",
]


@dataclass(frozen=True)
class Choice:
    """A good configuration."""

    law: tuple[str, str]
    scene: str
    limit: str
    batch_ticks: int

    @property
    def text(self) -> str:
        walls = "".join(f"[[scene.walls]]\n{wall}\n" for wall in SCENES[self.scene])
        law, params = self.law
        return (
            f"{QUEUE}telemetry.batch_ticks = {self.batch_ticks}\n{DEVICE}\n{walls}[controller]\nlaw = '{law}'\n"
            f"[controller.params]\n{params}\n[safety]\n{self.limit}\n"
        )

    @property
    def hash(self) -> str:
        return hashlib.sha256(self.text.encode()).hexdigest()[:12]


def a_choice(rng: random.Random) -> Choice:
    return Choice(rng.choice(LAWS), rng.choice(list(SCENES)), rng.choice(LIMITS), rng.choice([1, 5, 20]))


def a_bad_text(rng: random.Random) -> str:
    bad = rng.choice(BAD)
    if not bad:
        good = a_choice(rng).text
        return good[: good.index("stiffness") + 12]
    if bad.startswith("telemetry"):
        return f"{QUEUE}{bad}{DEVICE}"
    return f"{QUEUE}{DEVICE if '[device.options]' not in bad else ''}\n{bad}"


class Asker:
    """Asks the control socket without a process a question."""

    def __init__(self, daemon: Daemon) -> None:
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.DEALER)
        self._socket.connect(f"ipc://{daemon.directory}/run/default/control")

    def __enter__(self) -> Asker:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close(0)
        self._context.term()

    def __call__(self, do: str, **fields: Any) -> dict[str, Any]:
        self._socket.send(msgpack.packb({"do": do, **fields}))
        assert self._socket.poll(int(PATIENCE_S * 1e3)), f"no answer to {do}"
        answer: dict[str, Any] = msgpack.unpackb(self._socket.recv())
        return answer


@dataclass
class Tape:
    """What subscribers were told, by tick."""

    position_m: dict[int, float] = field(default_factory=dict)
    force_n: dict[int, float] = field(default_factory=dict)
    asked_n: dict[int, float] = field(default_factory=dict)
    deadline_ns: dict[int, int] = field(default_factory=dict)
    switched: dict[int, str] = field(default_factory=dict)  # configuration by the last tick before it
    faults: list[str] = field(default_factory=list)
    invalid: int = 0


@contextmanager
def taped(daemon: Daemon) -> Iterator[Tape]:
    """Everything that is published meanwhile."""
    tape = Tape()
    stop = threading.Event()

    def listen() -> None:
        topics = [f"hapticd/{name}" for name in ("position", "timing", "event", "damping", "energy")]
        with Subscriber(daemon.endpoint, *topics) as subscriber:
            while not stop.is_set():
                for topic, fields in subscriber.maps(0.2):
                    tape.invalid += "invalid" in fields
                    seq = fields["seq"]
                    if topic == "hapticd/position":
                        tape.position_m[seq] = fields["position_m"][0]
                        tape.force_n[seq] = fields["force_n"][0]
                        tape.asked_n[seq] = fields["force_requested_n"][0]
                    elif topic == "hapticd/timing":
                        tape.deadline_ns[seq] = fields["deadline_ns"]
                    elif topic == "hapticd/event" and fields["code"] == EventCode.SWITCHED:
                        tape.switched[seq] = fields["config"]
                    elif topic == "hapticd/event" and 200 <= fields["code"] < 300:
                        tape.faults.append(fields["text"])
                    if stop.is_set():
                        break

    listener = threading.Thread(target=listen)
    listener.start()
    try:
        yield tape
    finally:
        stop.set()
        listener.join()


@dataclass(frozen=True)
class Holding:
    """What a process holds.

    Attributes:
        memory_kib: its own. Shared pages are left out: those of the ring of records count for the supervisor only once
            it has read them, 12 MiB in its first seconds, whether anything is switched or not.
        descriptors: open ones.
    """

    memory_kib: int
    descriptors: int

    @classmethod
    def of(cls, pid: int) -> Holding:
        resident, shared = map(int, Path(f"/proc/{pid}/statm").read_text().split()[1:3])
        return cls(
            (resident - shared) * os.sysconf("SC_PAGE_SIZE") // 1024, len(list(Path(f"/proc/{pid}/fd").iterdir()))
        )


def explained_n(before: Choice, after: Choice, leaving: bool, tape: Tape, seq: int) -> tuple[float, float]:
    """Force that a switch just behind a tick may lead to, and how far off it may be [N].

    All walls that are pressed stand at x = 0. What is switched goes on from the force that was applied, which is let
    out with the depth; what is touched in that very tick asks for what it asks for, within a limit that may be the
    lower one or on its way; what is not switched goes on, perhaps in the middle of an earlier ramp. A wall that left
    with an earlier switch lets out with the depth as well, with that from which it left.
    """
    now_m, next_m = -tape.position_m[seq], -tape.position_m[seq + 1]
    asked_n = clipped(tape.asked_n[seq + 1])
    if next_m <= 0.0:
        return 0.0, 0.0
    if now_m <= 0.0:
        held_n = clipped(asked_n, LOWEST_LIMIT_N)
        return 0.5 * (held_n + asked_n), 0.5 * abs(asked_n - held_n) + RAMP_STEP_N
    let_out_n = LIMIT_N * max(0.0, 1.0 - next_m / now_m)
    if goes_on(before, after):
        return tape.force_n[seq], abs(asked_n - clipped(tape.asked_n[seq])) + let_out_n + 3.0 * RAMP_STEP_N
    return tape.force_n[seq] * min(1.0, next_m / now_m), RAMP_STEP_N + (let_out_n if leaving else 0.0)


def goes_on(before: Choice, after: Choice) -> bool:
    """Whether neither the law nor the wall that is pressed was switched."""
    return before.law == after.law and SCENES[before.scene][0] == SCENES[after.scene][0]


def clipped(force_n: float, limit_n: float = LIMIT_N) -> float:
    return max(-limit_n, min(limit_n, force_n))


def switch_at_random(daemon: Daemon, count: int, record_property: Report) -> None:
    """So many switches, a fifth of them to files that cannot be used, and all that must hold of them."""
    rng = random.Random(20)
    texts = {}
    held: list[tuple[Holding, Holding]] = []
    pids = daemon.process.pid, daemon.control_pid()
    with Asker(daemon) as ask, taped(daemon) as tape:
        first = ask("status")["status"]
        now = first["config_hash"]
        for number in range(count):
            if number in (count // 2, count - 1):
                held.append((Holding.of(pids[0]), Holding.of(pids[1])))
            bad = rng.random() < 0.2
            choice = a_choice(rng)
            daemon.config.write_text(a_bad_text(rng) if bad else choice.text)
            answer = ask("reload", wait=True)
            assert answer["ok"] != bad, (answer, daemon.config.read_text())
            now = now if bad else choice.hash
            texts[choice.hash] = choice
            status = ask("status")["status"]
            assert (status["config_hash"], status["armed"]) == (now, True)
            threading.Event().wait(rng.uniform(0.0, 0.03))
        last = ask("status")["status"]
        threading.Event().wait(0.2)  # what was published on the way here

    assert tape.faults == []
    assert tape.invalid == 0
    assert all(map(math.isfinite, tape.force_n.values()))
    assert len(tape.switched) > 0.6 * count
    ticks = sorted(tape.deadline_ns)
    assert ticks == list(range(ticks[0], ticks[-1] + 1)), "every tick that was run is published"

    # No step: the force goes on from where it was, as the depth did.
    largest_n = 0.0
    before = None
    left = -math.inf
    for seq, name in sorted(tape.switched.items()):
        after = texts[name]
        if before is not None and seq in tape.force_n and seq + 1 in tape.force_n:
            expected_n, ramp_n = explained_n(before, after, seq - left < 2 * RAMP_TICKS, tape, seq)
            step_n = abs(tape.force_n[seq + 1] - expected_n)
            if not goes_on(before, after):
                largest_n = max(largest_n, step_n - max(0.0, ramp_n - RAMP_STEP_N))
            assert step_n <= ramp_n + 1e-9, (seq, before, after)
            if len(SCENES[before.scene]) > len(SCENES[after.scene]):
                left = seq
        before = after

    # No tick missed for it: as few where a switch is built and taken as in as many ticks elsewhere.
    missed = {seq for seq in ticks[:-1] if tape.deadline_ns[seq + 1] - tape.deadline_ns[seq] > 1_500_000}
    at_switches = sum(bool(missed & set(range(seq - 7, seq + 1))) for seq in tape.switched)
    elsewhere = sum(bool(missed & set(range(seq - 17, seq - 9))) for seq in tape.switched)
    grown = [
        (after.memory_kib - before.memory_kib, after.descriptors - before.descriptors)
        for before, after in zip(*held, strict=True)
    ]
    for name, value in (
        ("switches", len(tape.switched)),
        ("ticks", len(ticks)),
        ("largest_step_beyond_motion_n", largest_n),
        ("deadlines_missed", last["overruns"] - first["overruns"]),
        ("switches_with_a_missed_deadline", at_switches),
        ("as_many_other_stretches_with_one", elsewhere),
        ("supervisor_grew_kib", grown[0][0]),
        ("control_grew_kib", grown[1][0]),
    ):
        record_property(name, value)
    assert at_switches <= 3 * elsewhere + 0.05 * len(tape.switched)
    assert [descriptors for _, descriptors in grown] == [0, 0]
    assert grown[0][0] <= 2048
    assert grown[1][0] <= 512


def test_a_hundred_random_switches_under_a_pressing_hand_cost_no_tick_no_step_and_no_memory(
    record_property: Report,
) -> None:
    with Daemon(QUEUE + PRESSED).wait_ready() as daemon:
        pressing(daemon)
        switch_at_random(daemon, 100, record_property)


@pytest.mark.nightly
def test_a_thousand_of_them(record_property: Report) -> None:
    with Daemon(QUEUE + PRESSED).wait_ready() as daemon:
        pressing(daemon)
        switch_at_random(daemon, 1000, record_property)
