"""`hapticd.connect`: one object that watches a real daemon and commands it, over its real sockets."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest

from hapticd.client import (
    ClientError,
    Cycle,
    Event,
    EventCode,
    Position,
    RefusedConfigError,
    RefusedError,
    RefusedKeyError,
    SilenceError,
    Status,
    connect,
)
from hapticd.errors import InstanceError
from hapticd.keys.file import new_pair, write
from hapticd.keys.store import KeyDirectory
from tests.daemon.running import PATIENCE_S, Daemon
from tests.daemon.test_deaths import PRESSED
from tests.ports import free_port


@pytest.fixture
def daemon(monkeypatch: pytest.MonkeyPatch) -> Iterator[Daemon]:
    with Daemon(PRESSED).wait_ready() as running:
        monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(running.directory / "run"))
        yield running


@pytest.mark.usefixtures("daemon")
def test_a_hand_is_let_through_and_pushed_back_again() -> None:
    with connect(timeout_s=PATIENCE_S) as daemon:
        daemon.disarm()
        daemon.wait_for(EventCode.DISARMED, timeout_s=PATIENCE_S)
        through = daemon.wait_for(Position, lambda one: one.force_n == (0.0,), timeout_s=PATIENCE_S)
        assert not daemon.wait_for(Status, lambda one: not one.releasing, timeout_s=PATIENCE_S).armed
        daemon.arm()
        armed = daemon.wait_for(EventCode.ARMED, timeout_s=PATIENCE_S)
        assert armed.seq > through.seq
        daemon.wait_for(Position, lambda one: one.force_n[0] > 2.0, timeout_s=PATIENCE_S)


@pytest.mark.usefixtures("daemon")
def test_what_a_command_brings_about_is_never_missed() -> None:
    """The subscription is in force before `connect` returns, so that the event of the next command arrives."""
    for _ in range(20):
        with connect(topics=[Event]) as daemon:
            daemon.disarm()
            daemon.wait_for(EventCode.DISARMED, timeout_s=PATIENCE_S)
            daemon.arm()
            daemon.wait_for(EventCode.ARMED, timeout_s=PATIENCE_S)


@pytest.mark.usefixtures("daemon")
def test_leaving_a_loop_and_entering_it_again_loses_no_tick() -> None:
    with connect(topics=[Position], timeout_s=PATIENCE_S) as daemon:
        first = [record.seq for record in islice(daemon, 33)]
        reached = daemon.wait_for(Position, lambda one: one.seq >= first[-1] + 7).seq
        second = [record.seq for record in islice(daemon, 33)]
        third = [record.seq for record in daemon.receive(PATIENCE_S)]
    seqs = [*first, *range(first[-1] + 1, reached + 1), *second, *third]
    assert seqs == list(range(first[0], first[0] + len(seqs)))


@pytest.mark.usefixtures("daemon")
def test_only_the_topics_asked_for_are_iterated_and_the_status_is_there_all_the_same() -> None:
    with connect(topics=["position"], timeout_s=PATIENCE_S) as daemon:
        assert {type(record) for record in islice(daemon, 100)} == {Position}
        status = daemon.status()
        assert (status.law, status.every_ticks, status.simulated) == ("ring-damping", 1, True)
        assert status.seq >= 0
        assert status.timestamp > 0.0


def test_a_reload_waits_for_the_verdict(daemon: Daemon) -> None:
    with connect(topics=[Event]) as client:
        daemon.config.write_text(PRESSED + '[controller]\nlaw = "tdpa"\n')
        client.reload()
        assert client.wait_for(EventCode.SWITCHED, timeout_s=PATIENCE_S).fields["law"] == "tdpa"
        daemon.config.write_text(PRESSED.replace("12000.0", "-1.0"))
        with pytest.raises(RefusedConfigError, match=r"scene\.walls\[0\]\.stiffness_n_per_m = -1"):
            client.reload()
        assert client.wait_for(EventCode.REFUSED, timeout_s=PATIENCE_S).text.startswith("configuration refused")


@pytest.mark.usefixtures("daemon")
def test_a_refused_command_says_why() -> None:
    with connect() as daemon:
        for refused in (daemon.tare, daemon.calibrate):
            with pytest.raises(RefusedError, match="hapticd disarm"):
                refused()


@pytest.mark.usefixtures("daemon")
def test_a_tare_waits_for_the_ramp_of_a_disarming_just_before() -> None:
    with connect() as daemon:
        daemon.disarm()
        daemon.tare()
        assert daemon.wait_for(EventCode.TARED, timeout_s=PATIENCE_S).fields


def test_closing_changes_nothing_at_the_device_and_stop_ends_the_daemon(daemon: Daemon) -> None:
    with connect() as client:
        assert client.status().armed
    with connect() as client:
        assert client.status().armed
        client.stop()
        client.wait_for(EventCode.STOPPING, timeout_s=PATIENCE_S)
        assert daemon.wait_exit() == 0
        with pytest.raises(InstanceError, match="hapticd run"):
            client.arm()
    with pytest.raises(ClientError, match="closed; connect again"):
        client.receive()


def test_a_law_that_failed_is_cleared_before_the_device_is_armed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "lab").mkdir()
    law = tmp_path / "lab" / "failing.py"
    law.write_text(
        '"""Fails in contact."""\nfrom hapticd.law import LawParams\n'
        'class Params(LawParams):\n    """None."""\nclass State:\n    """None."""\n'
        'def start(state, params, snapshot):\n    """Nothing."""\n'
        'def step(state, params, tick):\n    """Divide by zero."""\n    return 1.0 / (tick.x_m - tick.x_m)\n'
    )
    with Daemon(PRESSED, pythonpath=tmp_path).wait_ready() as daemon:
        monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(daemon.directory / "run"))
        with connect() as client:
            daemon.config.write_text(PRESSED + '[controller]\nlaw = "lab.failing"\n')
            client.reload()
            client.wait_for(EventCode.LAW_FAILED, timeout_s=PATIENCE_S)
            with pytest.raises(RefusedError, match="hapticd clear"):
                client.arm()
            daemon.config.write_text(PRESSED)
            client.reload()
            client.clear()
            client.arm()
            client.wait_for(Status, lambda one: one.armed and not one.latched, timeout_s=PATIENCE_S)


def test_a_wait_that_is_in_vain_ends_with_what_was_waited_for(daemon: Daemon) -> None:
    with connect(topics=[Cycle]) as client, pytest.raises(ClientError, match=r"event 101: .* add Event"):
        client.wait_for(EventCode.ARMED)
    with connect(topics=[Event, Status]) as client:
        with pytest.raises(SilenceError, match=f"{daemon.endpoint}: event 110 did not come within 0.05 s"):
            client.wait_for(EventCode.TARED, timeout_s=0.05)
        os.kill(daemon.process.pid, signal.SIGSTOP)
        while client.receive(0.2):
            pass
        with pytest.raises(SilenceError, match=r"Status did not come within 0\.05 s"):
            client.wait_for(Status, timeout_s=0.05)
        os.kill(daemon.process.pid, signal.SIGCONT)


def test_no_daemon_is_an_error_that_says_how_to_start_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr("hapticd.client.daemon.TIMEOUT_S", 0.05)
    with pytest.raises(SilenceError, match="left/telemetry: no daemon answers; start it with `hapticd run`"):
        connect("left")


def test_elsewhere_a_listed_key_watches_and_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HAPTICD_KEYS_DIR", str(tmp_path / "keys"))
    monkeypatch.delenv("HAPTICD_KEYS", raising=False)
    directory = KeyDirectory(tmp_path / "keys")
    server = directory.make().public
    laptop, wall = new_pair(server), new_pair(server)
    directory.add("laptop", laptop)
    directory.add("wall", replace(wall, watch_only=True))
    for name, pair in (("laptop", laptop), ("wall", wall), ("stranger", new_pair(server))):
        write(tmp_path / name, pair)
    telemetry, control = (f"tcp://0.0.0.0:{free_port()}" for _ in range(2))
    tables = f'[telemetry]\ntcp = "{telemetry}"\n[control]\ntcp = "{control}"\n'
    here, there = telemetry.replace("0.0.0.0", "127.0.0.1"), control.replace("0.0.0.0", "127.0.0.1")
    with Daemon(PRESSED + tables).wait_ready():
        with connect(telemetry=here, control=there, keys=tmp_path / "laptop") as daemon:
            daemon.disarm()
            daemon.wait_for(EventCode.DISARMED, timeout_s=PATIENCE_S)
            assert daemon.status().driver == "loopback"
        with connect(telemetry=here, control=there, keys=str(tmp_path / "wall")) as daemon:
            assert daemon.status().driver == "loopback"
            with pytest.raises(RefusedKeyError, match="does not let your key in"):
                daemon.arm()
        with connect(telemetry=here, keys=tmp_path / "laptop") as daemon, pytest.raises(ClientError, match="control="):
            daemon.arm()
        with pytest.raises(RefusedKeyError, match="does not let your key in"):
            connect(telemetry=here, keys=tmp_path / "stranger")


def test_a_daemon_elsewhere_is_never_mixed_up_with_the_one_here() -> None:
    with pytest.raises(ClientError, match=r"topics=\[Position\]"):
        connect(topics=Position)  # type: ignore[arg-type]  # a list is what it takes
    with pytest.raises(ClientError, match="name the same daemon's telemetry endpoint as well"):
        connect(control="tcp://lab.example:9873")
