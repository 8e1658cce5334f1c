"""A supervisor that is killed while its loop cannot let go: the helper outlives both, and takes the force away."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hapticd.loop.memory import RECORDS, SharedMemory
from hapticd.supervisor.orphans import kill_orphans
from hapticd.tick.event import EventCode
from tests.daemon.running import Daemon, child_pid, gone, wait_until
from tests.faults.rig import Rig, anew_where_late, events_until

SAID = "ERROR   the daemon was killed under force: the device is without force"


def stands_still(memory: SharedMemory) -> bool:
    before = memory.words[RECORDS]
    time.sleep(0.1)
    return memory.words[RECORDS] == before


def helper_pid(daemon: Daemon) -> int:
    return child_pid(daemon.process.pid, "hapticd.supervisor.force_release")


@pytest.mark.parametrize("stopped", [True, False], ids=["stopped", "hanging"])
def test_the_force_of_a_loop_that_does_not_notice_is_taken_away(stopped: bool) -> None:
    """The helper took the end of its supervisor for "not needed", and the device kept the force."""
    with Rig() as rig:
        rig.pressed()
        control, helper = rig.daemon.control_pid(), helper_pid(rig.daemon)
        rig.daemon.process.send_signal(signal.SIGSTOP)  # or it would see to the loop itself
        if stopped:
            os.kill(control, signal.SIGSTOP)
        else:
            memory = rig.daemon.memory()
            rig.order("hang-write")
            wait_until(lambda: stands_still(memory), "the loop to hang")
            memory.close()
        assert rig.felt().force_n != 0.0
        rig.daemon.process.kill()
        rig.daemon.process.wait()
        wait_until(lambda: gone(helper), "the end of the helper")
        assert gone(control)
        assert rig.felt().force_n == 0.0
        assert SAID in rig.daemon.output()


def test_a_device_that_the_loop_has_let_go_of_is_left_alone() -> None:
    """Another daemon may have it by then."""
    with Rig() as rig:
        rig.pressed()
        rig.order("")
        control, helper = rig.daemon.control_pid(), helper_pid(rig.daemon)
        rig.daemon.process.kill()
        rig.daemon.process.wait()
        wait_until(lambda: gone(control), "the end of the loop")
        assert rig.released().force_n == 0.0
        wait_until(lambda: gone(helper), "the end of the helper")
        assert rig.felt().opened == 0
        assert "killed under force" not in rig.daemon.output()


@anew_where_late
@pytest.mark.parametrize("loop_first", [True, False])
def test_a_loop_that_is_killed_with_its_supervisor_leaves_no_force(loop_first: bool) -> None:
    """There was no loop left to be killed, which the helper took for one that had let go."""
    with Rig() as rig:
        rig.pressed()
        rig.order("")
        wait_until(lambda: rig.felt().opened == 0, "what is felt to begin anew")
        control, helper = rig.daemon.control_pid(), helper_pid(rig.daemon)
        pids = [rig.daemon.process.pid, control]
        for pid in pids:  # or the second may have let go by the time that it is killed
            os.kill(pid, signal.SIGSTOP)
        for pid in reversed(pids) if loop_first else pids:
            os.kill(pid, signal.SIGKILL)
        rig.daemon.process.wait()
        assert rig.released().opened == 1
        assert rig.felt().force_n == 0.0
        wait_until(lambda: gone(helper), "the end of the helper")
        assert SAID in rig.daemon.output()


@anew_where_late
def test_what_the_supervisor_has_seen_to_no_helper_sees_to_again() -> None:
    with Rig() as rig, rig.pressed().subscriber() as subscriber:
        rig.order("unplugged")
        events_until(subscriber, EventCode.DEVICE_LOST)
        helper = helper_pid(rig.daemon)
        opened = rig.felt().opened
        rig.daemon.process.kill()
        rig.daemon.process.wait()
        wait_until(lambda: gone(helper), "the end of the helper")
        assert rig.felt().opened == opened


HANGING = """
import sys
import time
from pathlib import Path
from hapticd_drivers.loopback import Loopback
class Hanging(Loopback):
    def _open(self):
        if Path(sys.argv[0]).stem == "force_release":
            time.sleep(3600.0)
        return super()._open()
"""


def test_a_helper_that_hangs_in_the_driver_does_not_stay(tmp_path: Path) -> None:
    """It would have the device, and no one would end it."""
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab/__init__.py").touch()
    (tmp_path / "lab/hanging.py").write_text(HANGING)
    with Daemon('[device]\ndriver = "lab.hanging"\n', pythonpath=tmp_path).wait_ready() as daemon:
        control, helper = daemon.control_pid(), helper_pid(daemon)
        daemon.process.send_signal(signal.SIGSTOP)
        os.kill(control, signal.SIGSTOP)
        daemon.process.kill()
        daemon.process.wait()
        wait_until(lambda: gone(control), "the end of the loop")
        try:
            wait_until(lambda: gone(helper), "the end of the helper")
        finally:
            if not gone(helper):
                os.kill(helper, signal.SIGKILL)


def test_the_helper_is_bound_to_no_processor() -> None:
    """On that of a real-time loop that never waits it would not run."""
    with Daemon("").wait_ready() as daemon:
        assert os.sched_getaffinity(helper_pid(daemon)) == os.sched_getaffinity(0)


def test_no_process_but_a_loop_of_that_supervisor_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A loop whose socket had the dead supervisor's number was killed: in a container both are small."""
    monkeypatch.setattr("hapticd.supervisor.orphans.END_TIMEOUT_S", 0.0)
    waits = [sys.executable, "-c", "input()", "hapticd.loop.process", "--socket", "99999991", "--parent"]
    with (
        subprocess.Popen([*waits, "99999991"], stdin=subprocess.PIPE) as theirs,
        subprocess.Popen([*waits, "99999992"], stdin=subprocess.PIPE) as other,
    ):
        assert kill_orphans(99999991)
        assert theirs.wait() == -signal.SIGKILL
        assert not kill_orphans(99999991)
        assert other.poll() is None
        other.kill()
