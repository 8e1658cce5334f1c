"""What a running daemon is told: over its control socket, by signal, by an edited file."""

from __future__ import annotations

import hashlib
import os
import random
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import msgpack
import pytest
import zmq

from hapticd.loop.memory import RECORDS
from hapticd.tick.event import EventCode
from tests.daemon.running import HAPTICD, PATIENCE_S, Daemon, Subscriber, all_records, wait_until
from tests.daemon.test_deaths import PRESSED, pressing

RAMP_TICKS = 50
PATIENCE_MS = int(PATIENCE_S * 1e3)

GOOD_LAW = '''
"""A law of a lab's own: the wall with constant damping."""
from pydantic import Field
from hapticd.law import LawParams
class Params(LawParams):
    """One."""
    damping_n_s_per_m: float = Field(8.0, ge=0)
class State:
    """Published."""
    damping_n_s_per_m: float
def start(state, params, snapshot):
    """Damp at once."""
    state.damping_n_s_per_m = params.damping_n_s_per_m
def step(state, params, tick):
    """F = F_contact - b v."""
    return tick.contact_n - params.damping_n_s_per_m * tick.velocity_m_per_s
'''

BROKEN_LAW = GOOD_LAW.replace("return tick.contact_n", "return 1.0 / (tick.x_m - tick.x_m) + tick.contact_n")
SOFT_LAW = GOOD_LAW.replace("return tick.contact_n", "return 0.5 * tick.contact_n")


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Daemon]:
    package = tmp_path / "mylab"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "good.py").write_text(GOOD_LAW)
    (package / "broken.py").write_text(BROKEN_LAW)
    (package / "soft.py").write_text(SOFT_LAW)
    with Daemon(PRESSED, pythonpath=tmp_path).wait_ready() as running:
        pressing(running)
        yield running


def heard(daemon: Daemon) -> Subscriber:
    """A subscriber that the daemon knows of, so that it misses nothing from now on."""
    subscriber = Subscriber(daemon.endpoint)
    next(subscriber.maps())
    return subscriber


def ask(daemon: Daemon, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(daemon.directory / "run")}
    return subprocess.run(
        [HAPTICD, *arguments], env=environment, capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )


def edit(daemon: Daemon, config: str) -> subprocess.CompletedProcess[str]:
    daemon.config.write_text(config)
    return ask(daemon, "reload")


def assert_ramped(daemon: Daemon, seq: int) -> None:
    """The force of a tick gives way to what is asked for behind it in even shares, and goes with the depth meanwhile.

    Args:
        daemon: whose hand stays in contact.
        seq: the last tick before the switch.
    """
    memory = daemon.memory()
    wait_until(lambda: memory.words[RECORDS] > seq + RAMP_TICKS + 10, "the end of the ramp")
    before, *after = (record for record in all_records(memory) if seq <= record.seq <= seq + RAMP_TICKS + 5)
    memory.close()
    for tick, record in enumerate(after):
        share = min(1.0, tick / RAMP_TICKS)
        old_n = before.force_n[0] * min(1.0, record.position_m[0] / before.position_m[0])
        ramped_n = (1.0 - share) * old_n + share * record.force_requested_n[0]
        assert record.force_n[0] == pytest.approx(ramped_n, abs=1e-9), tick
    assert abs(after[0].force_requested_n[0] - before.force_n[0]) > 1.0, "there is nothing to ramp"


def test_an_edited_law_takes_over_without_a_step(daemon: Daemon) -> None:
    with heard(daemon) as subscriber:
        assert edit(daemon, PRESSED + '[controller]\nlaw = "mylab.soft"\n').returncode == 0
        event = subscriber.until("hapticd/event", code=EventCode.SWITCHED)
        assert (event["law_before"], event["law"]) == ("ring-damping", "mylab.soft")
        assert_ramped(daemon, event["seq"])


def test_a_law_of_ones_own_is_imported_beside_the_loop(daemon: Daemon) -> None:
    with heard(daemon) as subscriber:
        assert edit(daemon, PRESSED + '[controller]\nlaw = "mylab.good"\n').returncode == 0
        assert subscriber.until("hapticd/event", code=EventCode.SWITCHED)["law"] == "mylab.good"
        assert subscriber.until("hapticd/damping", damping_n_s_per_m=[8.0])
        assert subscriber.until("hapticd/status", law="mylab.good")["armed"]


def test_a_wall_that_stiffens_in_the_file_stiffens_under_the_hand_by_a_ramp(daemon: Daemon) -> None:
    with heard(daemon) as subscriber:
        assert edit(daemon, PRESSED.replace("12000.0", "20000.0")).returncode == 0
        event = subscriber.until("hapticd/event", code=EventCode.SWITCHED)
        for topic, fields in subscriber.maps():
            if topic == "hapticd/position" and fields["seq"] > event["seq"] + 1000:
                assert fields["position_m"][0] == pytest.approx(-3.0 / 20000.0, abs=2.5e-5)
                break
        assert_ramped(daemon, event["seq"])


@pytest.mark.parametrize(
    ("broken", "named"),
    [
        (PRESSED.replace("12000.0", "-1.0"), "scene.walls[0].stiffness_n_per_m"),
        (PRESSED + '[controller]\nlaw = "energy-cicle"\n', "energy-cycle"),
        (PRESSED + "[loop]\nrate_hz = 2000.0\n", "restart"),
        (PRESSED + "[safety]\nmax_force_n = 50.0\n", "12 N"),
        (PRESSED + '[[scene.walls]]\naxis = "x"\nstiffness_n_per_m = 1.0\n', "scene.walls[1].axis"),
        ("[[[", "line 1"),
    ],
)
def test_a_file_that_cannot_be_used_changes_nothing_and_names_the_place(
    daemon: Daemon, broken: str, named: str
) -> None:
    with heard(daemon) as subscriber:
        before = subscriber.until("hapticd/status")
        answer = edit(daemon, broken)
        assert answer.returncode == 2
        assert named in answer.stderr
        assert "Traceback" not in answer.stderr
        refused = subscriber.until("hapticd/event", code=EventCode.REFUSED)
        wait_until(lambda: f"WARNING {refused['text']}" in daemon.output(), "the log")
        after = subscriber.until("hapticd/status")
        assert after["config_hash"] == before["config_hash"]
        assert after["armed"]


def test_who_does_not_wait_learns_it_from_the_events(daemon: Daemon) -> None:
    with heard(daemon) as subscriber:
        daemon.config.write_text("[[[")
        done = ask(daemon, "reload", "--no-wait")
        assert (done.returncode, done.stderr) == (0, "")
        assert "line 1" in subscriber.until("hapticd/event", code=EventCode.REFUSED)["text"]


def test_a_pipe_in_the_place_of_the_file_is_refused_and_not_waited_for(daemon: Daemon) -> None:
    daemon.config.unlink()
    os.mkfifo(daemon.config)
    refused = ask(daemon, "reload")
    assert refused.returncode == 2
    assert "is a pipe or a device" in refused.stderr
    assert ask(daemon, "disarm").returncode == 0


def test_disarm_lets_the_hand_through_and_arm_brings_the_wall_back(daemon: Daemon) -> None:
    with Subscriber(daemon.endpoint) as subscriber:
        assert ask(daemon, "disarm").returncode == 0
        assert subscriber.until("hapticd/status", armed=False, releasing=False, latched=False)
        assert subscriber.until("hapticd/position", force_n=[0.0])
        assert ask(daemon, "arm").returncode == 0
        assert subscriber.until("hapticd/status", armed=True)


def test_a_law_that_raises_is_latched_until_cleared_and_armed_again(daemon: Daemon) -> None:
    with heard(daemon) as subscriber:
        assert edit(daemon, PRESSED + '[controller]\nlaw = "mylab.broken"\n').returncode == 0
        event = subscriber.until("hapticd/event", code=EventCode.LAW_FAILED)
        assert "ZeroDivisionError" in event["text"]
        assert subscriber.until("hapticd/status", latched=True, armed=False, releasing=False)
        refused = ask(daemon, "arm")
        assert refused.returncode == 1
        assert "hapticd clear" in refused.stderr
        assert edit(daemon, PRESSED).returncode == 0
        assert ask(daemon, "clear").returncode == 0
        assert ask(daemon, "arm").returncode == 0
        assert subscriber.until("hapticd/status", armed=True, latched=False, fallback=False)


def test_no_daemon_is_one_line(tmp_path: Path) -> None:
    environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(tmp_path)}
    answer = subprocess.run(
        [HAPTICD, "arm"], env=environment, capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert answer.returncode == 1
    assert answer.stderr.count("\n") == 1
    assert "hapticd run" in answer.stderr


def test_whatever_arrives_at_the_control_socket_is_refused_and_the_daemon_goes_on(daemon: Daemon) -> None:
    rng = random.Random(7)
    context = zmq.Context()
    socket = context.socket(zmq.DEALER)
    socket.setsockopt(zmq.LINGER, 0)
    socket.connect(f"ipc://{daemon.directory}/run/default/control")
    hostile = [
        [b""],
        [b"\xc1"],
        [b"\x91" * 5000],
        [msgpack.packb({"do": 7})],
        [msgpack.packb({"do": "explode" * 100})],
        [msgpack.packb(["arm"])],
        [msgpack.packb({1: 2})],
        [msgpack.packb({"do": "arm"}), b"more"],
        *([rng.randbytes(rng.randrange(200))] for _ in range(500)),
    ]
    for frames in hostile:
        socket.send_multipart(frames)
        assert socket.poll(PATIENCE_MS)
        assert not msgpack.unpackb(socket.recv())["ok"]
    socket.send(msgpack.packb({"do": "status"}))
    assert socket.poll(PATIENCE_MS)
    answer = msgpack.unpackb(socket.recv())
    assert answer["ok"]
    assert answer["status"]["armed"]
    socket.close()
    context.term()


def test_a_request_that_the_loop_never_sees_is_answered_when_the_daemon_ends(daemon: Daemon) -> None:
    with zmq.Context() as context, context.socket(zmq.DEALER) as socket:
        socket.connect(f"ipc://{daemon.directory}/run/default/control")
        socket.send(msgpack.packb({"do": "status"}))
        assert socket.poll(PATIENCE_MS)
        socket.recv()
        control = daemon.control_pid()
        daemon.process.send_signal(signal.SIGSTOP)
        os.kill(control, signal.SIGSTOP)
        socket.send(msgpack.packb({"do": "arm"}))
        daemon.process.send_signal(signal.SIGCONT)
        assert socket.poll(PATIENCE_MS)
        answer = msgpack.unpackb(socket.recv())
    assert not answer["ok"]
    assert "stopped" in answer["text"]
    assert daemon.wait_exit() == 1


def test_what_is_asked_while_it_starts_is_answered_by_what_it_runs() -> None:
    with Daemon("") as daemon, zmq.Context() as context, context.socket(zmq.DEALER) as socket:
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.RECONNECT_IVL, 1)
        socket.connect(f"ipc://{daemon.directory}/run/default/control")
        socket.send(msgpack.packb({"do": "status"}))
        assert socket.poll(PATIENCE_MS)
        status = msgpack.unpackb(socket.recv())["status"]
        assert status["config_hash"] == hashlib.sha256(b"").hexdigest()[:12]
