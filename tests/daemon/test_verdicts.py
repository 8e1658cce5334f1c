"""What a client hears is what happens: verdicts that take their time, requests that come too late."""

from __future__ import annotations

import contextlib
import itertools
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import msgpack
import pytest
import zmq

from hapticd.client.commands import RefusedConfigError, RefusedError, command
from hapticd.errors import InstanceError
from hapticd.tick.event import EventCode
from tests.daemon.running import HAPTICD, PATIENCE_S, Daemon, Subscriber, wait_until
from tests.daemon.test_commands import GOOD_LAW
from tests.daemon.test_deaths import PRESSED

IMPORT_S = 10.0
WATCHDOG_S = 4.0
SLOW_LAW = GOOD_LAW.replace("from pydantic", f"import time\ntime.sleep({IMPORT_S})\nfrom pydantic")
SLOW_AND_BROKEN = SLOW_LAW.replace(str(IMPORT_S), "6.0").replace("class Params", "1 / 0\nclass Params")
SLOW_IN_THE_LOOP = GOOD_LAW.replace(
    "from pydantic",
    "import pathlib, sys, time\n"
    "if sys.argv[0].endswith('process.py'):\n"
    "    pathlib.Path(__file__).with_name('importing').touch()\n"
    "    time.sleep(8.0)\n"
    "from pydantic",
)


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    package = tmp_path / "mylab"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "slow.py").write_text(SLOW_LAW)
    (package / "broken.py").write_text(SLOW_AND_BROKEN)
    (package / "late.py").write_text(SLOW_IN_THE_LOOP)
    return package


@pytest.fixture
def daemon(lab: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Daemon]:
    watched = ("env", f"WATCHDOG_USEC={WATCHDOG_S * 1e6:.0f}")
    with Daemon(PRESSED, prefix=watched, pythonpath=lab.parent).wait_ready() as running:
        monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(running.directory / "run"))
        yield running


def reload(daemon: Daemon, law: str) -> subprocess.Popen[str]:
    daemon.config.write_text(f'{PRESSED}[controller]\nlaw = "mylab.{law}"\n')
    environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(daemon.directory / "run")}
    return subprocess.Popen([HAPTICD, "reload"], env=environment, stderr=subprocess.PIPE, text=True)


def test_a_law_that_imports_for_ten_seconds_is_waited_for_and_the_watchdog_fed(daemon: Daemon) -> None:
    """S3: after 3 s the client said failure and the file took force; after 6 s systemd ended an armed service."""
    with reload(daemon, "slow") as asking:
        fed_s = [time.monotonic()]
        while asking.poll() is None:
            daemon.notified("WATCHDOG=1")
            fed_s.append(time.monotonic())
            with contextlib.suppress(RefusedError):
                command("disarm", timeout_s=PATIENCE_S)
            if len(fed_s) == 3:
                assert command("status")["status"]["law"] == "ring-damping"
        assert asking.returncode == 0, asking.stderr.read() if asking.stderr else ""
    assert command("status")["status"]["law"] == "mylab.slow"
    pauses_s = [after - before for before, after in itertools.pairwise(fed_s)]
    sys.stdout.write(f"watchdog fed after at most {max(pauses_s):.2f} s\n")
    assert fed_s[-1] - fed_s[0] > IMPORT_S
    assert max(pauses_s) < WATCHDOG_S


def test_a_law_that_fails_late_is_refused_late_and_changes_nothing(daemon: Daemon) -> None:
    wait_until(lambda: command("status")["status"]["config_hash"] != "", "the first status")
    before = command("status")["status"]["config_hash"]
    with reload(daemon, "broken") as asking:
        _, said = asking.communicate(timeout=PATIENCE_S)
    assert asking.returncode == RefusedConfigError.exit_code
    assert "ZeroDivisionError" in said
    assert command("status")["status"]["config_hash"] == before


def test_what_is_asked_behind_a_long_switch_never_happens_after_the_asker_was_told_no(
    daemon: Daemon, lab: Path
) -> None:
    """S4: `hapticd arm` said failed, and the device armed fifteen seconds later."""
    command("disarm")
    with Subscriber(daemon.endpoint) as subscriber:
        subscriber.until("hapticd/status", armed=False, releasing=False)
        with reload(daemon, "late") as asking:
            wait_until((lab / "importing").exists, "the import in the loop")
            with pytest.raises(RefusedError, match="not done, and it will not be"):
                command("arm")
            assert asking.wait(PATIENCE_S) == 0
        events = []
        for topic, fields in subscriber.maps():
            if topic == "hapticd/event":
                events.append(fields["code"])
            if topic == "hapticd/status" and EventCode.SWITCHED in events and fields["law"] == "mylab.late":
                break
        until = time.monotonic() + 2.0
        for topic, fields in subscriber.maps():
            assert topic != "hapticd/event" or fields["code"] != EventCode.ARMED
            assert topic != "hapticd/status" or not fields["armed"]
            if time.monotonic() > until:
                break
        command("arm")
        subscriber.until("hapticd/status", armed=True)


def test_a_request_whose_time_has_passed_when_it_arrives_is_not_done(daemon: Daemon) -> None:
    command("disarm")
    with zmq.Context() as context, context.socket(zmq.DEALER) as socket:
        socket.connect(f"ipc://{daemon.directory}/run/default/control")
        socket.send(msgpack.packb({"do": "arm", "by_ns": time.monotonic_ns() - 1}))
        assert socket.poll(int(PATIENCE_S * 1e3))
        answer = msgpack.unpackb(socket.recv())
    assert not answer["ok"]
    assert "not done" in answer["text"]
    assert not command("status")["status"]["armed"]


def test_a_daemon_that_stands_still_is_not_said_to_be_missing(daemon: Daemon) -> None:
    """The advice was to start what is running."""
    daemon.process.send_signal(19)
    try:
        done = subprocess.run([HAPTICD, "arm"], capture_output=True, text=True, check=False)
    finally:
        daemon.process.send_signal(18)
    assert done.returncode == 1
    assert "a daemon runs there and does not answer" in done.stderr
    assert "hapticd run" not in done.stderr


def test_the_log_says_who_asked(daemon: Daemon) -> None:
    """S10: that the device was armed stood there, and not by whom."""
    command("arm")
    asked = f"arm: asked by user {os.geteuid()}, process {os.getpid()}"
    wait_until(lambda: asked in daemon.output(), "who asked, in the log")


def test_without_a_daemon_a_command_does_not_wait_for_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """S10: it took 5.2 s to say so; now it opens no socket for it."""
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(zmq, "Context", lambda: pytest.fail("it tries to reach a daemon"))
    with pytest.raises(InstanceError, match=r"no daemon answers on .*: start it with `hapticd run`"):
        command("arm")


def test_a_configuration_may_have_any_name_that_a_file_may_have(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """S10: a path that is not UTF-8 was a defect at the start."""
    config = os.fsdecode(bytes(tmp_path) + b"/l\xe4b.toml")
    Path(config).write_text(PRESSED)
    environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(tmp_path / "run"), "HAPTICD_STATE_DIR": str(tmp_path)}
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(tmp_path / "run"))
    with subprocess.Popen([HAPTICD, "run", "--config", config], env=environment, stderr=subprocess.PIPE) as running:
        try:
            wait_until((tmp_path / "run/default/control").exists, "the daemon")
            assert command("status")["status"]["config_file"] in ("", config)
            command("reload", wait=True)
            assert command("status")["status"]["config_file"] == config
            with Subscriber(f"ipc://{tmp_path}/run/default/telemetry", "hapticd/status") as subscriber:
                assert subscriber.until("hapticd/status", law="ring-damping")["config_file"].endswith("b.toml")
            command("stop")
            assert running.wait(PATIENCE_S) == 0
        finally:
            running.kill()
