"""`hapticd status` finds every daemon that lives and says of each what an engineer asks first."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import msgpack
import pytest
import typer
import zmq

from hapticd.cli.status import status as show
from hapticd.client.commands import command
from tests.daemon.running import HAPTICD, PATIENCE_S, Daemon, Subscriber, wait_until
from tests.daemon.test_deaths import PRESSED, pressing


def status(runtime: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(runtime)}
    return subprocess.run([HAPTICD, "status", *arguments], env=environment, capture_output=True, text=True, check=False)


@contextlib.contextmanager
def locked(directory: Path) -> Iterator[None]:
    """As a daemon holds its lock."""
    with (directory / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def test_every_daemon_that_lives_is_shown_and_what_a_killed_one_left_is_not(tmp_path: Path) -> None:
    began_s = time.time()
    with Daemon("[telemetry]\nevery_ticks = 5\n").wait_ready() as daemon:
        runtime = daemon.directory / "run"
        (runtime / "killed").mkdir()
        (runtime / "killed" / "lock").write_text("4711\n")
        environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(runtime), "HAPTICD_STATE_DIR": str(tmp_path)}
        config = tmp_path / "left.toml"
        config.write_text('[controller]\nlaw = "tdpa"\n')
        with subprocess.Popen(
            [HAPTICD, "run", "--config", str(config), "--instance", "left"], env=environment, stderr=subprocess.DEVNULL
        ) as left:
            try:
                wait_until((runtime / "left/control").exists, "the other daemon")
                shown = json.loads(status(runtime, "--json").stdout)
                one, other = shown["instances"]
                assert (shown["schema"], one["name"], other["name"]) == (1, "default", "left")
                assert (one["status"]["law"], other["status"]["law"]) == ("ring-damping", "tdpa")
                assert began_s - 1.0 < one["status"]["started_timestamp"] < time.time()
                assert 0.0 <= one["late_share"] <= 1.0
                said = [one["status"], command("receipt", connect=f"ipc://{runtime}/default/control")["receipt"]]
                for each in said:  # as telemetry has it
                    assert began_s - 1.0 < each["timestamp"] < time.time() + 1.0
                    assert (each["every_ticks"], each["seq"] > 0) == (5, True)
                plain = status(runtime)
                assert plain.returncode == 0
                assert plain.stdout.startswith("default: armed, law ring-damping, ")
                assert "\nleft: " in plain.stdout
                assert status(runtime, "--instance", "left").stdout.startswith("left: ")
                stop = [HAPTICD, "stop", "--instance", "left"]
                assert subprocess.run(stop, env=environment, check=False).returncode == 0
                assert status(runtime, "--instance", "left").returncode == 1, "when it returns the daemon has ended"
                assert left.wait(PATIENCE_S) == 0
            finally:
                left.send_signal(signal.SIGTERM)


def test_a_daemon_of_the_release_before_that_went_on_through_an_upgrade_is_shown(tmp_path: Path) -> None:
    """What its status does not have yet ended the command as a defect, with all other daemons unseen."""
    said = {"schema": 1, "version": "0.2.0", "armed": True, "latched": False, "law": "energy-cycle", "device": "omega7"}
    said |= {"rate_hz": 1000.0, "late_histogram": [9, 1], "fault_code": 0, "fallback": False, "simulated": True}
    said |= {"started_timestamp": 1.7e9}
    (tmp_path / "old").mkdir()
    with locked(tmp_path / "old"), zmq.Context() as context, context.socket(zmq.ROUTER) as old:
        old.bind(f"ipc://{tmp_path}/old/control")
        command = [HAPTICD, "status"]
        environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(tmp_path), "TZ": "XYZ-5:30"}
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as asked:
            identity, _ = old.recv_multipart()
            old.send_multipart((identity, msgpack.packb({"ok": True, "text": "", "status": said})))
            shown, _ = asked.communicate()
    assert shown.splitlines() == [
        "old: armed, law energy-cycle, ? of 1000 Hz, 0 % late",
        "  omega7, simulated, since 2023-11-15 03:43:20 +0530",
    ]


@pytest.mark.parametrize("fault", [False, True])
def test_a_force_that_is_being_ramped_out_is_not_called_disarmed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], fault: bool
) -> None:
    """It stood there at 4.9 N, for as long as the ramp took."""
    config = f"{PRESSED}[safety]\nramp_s = 1.0\n"
    with Daemon(config).wait_ready() as daemon, Subscriber(daemon.endpoint, "hapticd/status") as subscriber:
        monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(daemon.directory / "run"))

        def said() -> str:
            with pytest.raises(typer.Exit):
                show()
            return capsys.readouterr().out

        pressing(daemon)
        if fault:
            daemon.config.write_text(f"{config}max_speed_m_per_s = 1e-6\n")
        assert daemon.ask("reload" if fault else "disarm") == ""
        subscriber.until("hapticd/status", armed=False, releasing=True, latched=fault)
        assert said().startswith("default: " + ("stopped by a fault, releasing, law" if fault else "releasing, law"))
        subscriber.until("hapticd/status", armed=False, releasing=False, latched=fault)
        assert said().startswith("default: " + ("stopped by a fault, law" if fault else "disarmed, law"))


def test_without_a_daemon_it_says_how_to_start_one(tmp_path: Path) -> None:
    done = status(tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert "hapticd run" in done.stderr
