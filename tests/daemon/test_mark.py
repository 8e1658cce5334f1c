"""`hapticd mark`: a marker is an event in the stream, armed or not; what is no marker is refused."""

from __future__ import annotations

import os
import subprocess

import pytest

from hapticd.client import EventCode, RefusedError, connect
from tests.daemon.running import HAPTICD, Daemon

CONFIG = """
[device]
driver = "loopback"
[[scene.walls]]
axis = "z"
free_side = "positive"
stiffness_n_per_m = 1000.0
"""


def test_a_marker_is_an_event_armed_or_not_and_a_receipt_has_the_whole_file(monkeypatch: pytest.MonkeyPatch) -> None:
    with Daemon(CONFIG) as daemon:
        daemon.wait_ready()
        monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(daemon.directory / "run"))
        with connect(timeout_s=30.0) as client:
            client.mark("trial 3: Übung ✓")
            assert client.wait_for(EventCode.MARKED, timeout_s=30.0).text == "trial 3: Übung ✓"
            client.disarm()
            client.wait_for(EventCode.DISARMED, timeout_s=30.0)
            done = subprocess.run([HAPTICD, "mark", "by hand"], env=os.environ, check=False)
            assert done.returncode == 0
            assert client.wait_for(EventCode.MARKED, timeout_s=30.0).text == "by hand"
            for wrong in ("", "  ", "two\nlines", "\x1b[2J", "x" * 201):
                with pytest.raises(RefusedError, match="a marker"):
                    client.mark(wrong)
            with pytest.raises(RefusedError, match="a marker"):
                client._ask("mark", text=["no", "text"])
            client.mark("x" * 200)
            assert len(client.wait_for(EventCode.MARKED, timeout_s=30.0).text) == 200

            receipt = client.receipt()
            assert receipt["config_text"] == CONFIG
            assert receipt["config_hash"] == client.status().config_hash
            assert receipt["kernel"].startswith("Linux")
