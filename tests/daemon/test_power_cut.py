"""The daemon's computer loses its power and comes back: who watches from another computer goes on by itself."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hapticd.keys.file import new_pair, write
from hapticd.keys.store import KeyDirectory
from tests.daemon.computers import two_computers
from tests.daemon.running import PATIENCE_S, Daemon
from tests.daemon.test_deaths import PRESSED

WATCH = """
import sys
from hapticd.client import Client, Position
with Client(sys.argv[1], topics=[Position], keys=sys.argv[2]) as client:
    for record in client:
        if isinstance(record, Position) and record.seq % 100 == 0:  # a gap has no time
            print(int(record.timestamp), flush=True)
"""


def power_off(daemon: Daemon) -> None:
    for pid in (daemon.control_pid(), daemon.process.pid):
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    daemon.process.wait()


def test_a_subscriber_recovers_by_itself_when_the_daemons_computer_is_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """S7: without a word on the line the subscriber held a connection that only it knew of, for ever."""
    monkeypatch.setenv("HAPTICD_KEYS_DIR", str(tmp_path / "keys"))
    keys = KeyDirectory(tmp_path / "keys")
    laptop = new_pair(keys.make().public)
    keys.add("laptop", laptop)
    own = tmp_path / "laptop.key_secret"
    write(own, laptop)
    config = PRESSED + '[telemetry]\ntcp = "tcp://0.0.0.0:9872"\n'
    with two_computers() as computers:
        command = [*computers.second, sys.executable, "-c", WATCH, f"tcp://{computers.address}:9872", str(own)]
        with (
            Daemon(config, prefix=computers.first) as daemon,
            subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as watching,
        ):
            assert watching.stdout is not None
            try:
                daemon.wait_ready()
                assert watching.stdout.readline()
                computers.cut_power()
                power_off(daemon)
                computers.switch_on_again()
                with Daemon(config, prefix=computers.first) as again:
                    again.wait_ready()
                    back_s = time.time()
                    os.set_blocking(watching.stdout.fileno(), False)
                    while time.time() < back_s + PATIENCE_S:
                        if any(int(line) > back_s for line in watching.stdout):
                            break
                        time.sleep(0.1)
                    else:
                        pytest.fail("the subscriber has heard nothing since")
                    sys.stdout.write(f"a record {time.time() - back_s:.1f} s after the daemon was back\n")
            finally:
                watching.kill()
