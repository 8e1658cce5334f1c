"""An ordinary stop: a driver may take its time to let go of its device, but no force may stand meanwhile."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hapticd.client.commands import command
from hapticd.config.loading import parse
from hapticd.supervisor import daemon as supervising
from tests.daemon.running import HAPTICD, Daemon, gone, wait_until
from tests.daemon.test_deaths import PRESSED, nothing_left, pressing
from tests.faults.rig import Rig

DRIVERS = '''
"""A device that is let go of slowly, and one that hangs while its force is ramped out."""
import atexit
import os
import sys
import time
from pathlib import Path
from hapticd_drivers.loopback import Loopback
class Slow(Loopback):
    """Ten times as long as a loop may stand still."""
    def _close(self):
        time.sleep(1.0)
        super()._close()
class Stuck(Loopback):
    """Once the file is there."""
    def _write(self, force_n):
        if abs(force_n[0]) < 2.0 and Path(__file__).with_name("stuck").exists():
            time.sleep(60.0)
        super()._write(force_n)
class Noting(Loopback):
    """Notes how the loop's process is scheduled while it lets go, and when it ends."""
    def _close(self):
        if Path(sys.argv[0]).stem == "process":
            self._note()
            atexit.register(self._note)
        super()._close()
    def _note(self):
        with Path(__file__).with_name("classes").open("a") as file:
            print(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, file=file)
class Clinging(Loopback):
    """Does not let go in the programs that the file names."""
    def _disable(self):
        clings = Path(__file__).with_name("clings")
        if clings.exists() and Path(sys.argv[0]).stem in clings.read_text().split():
            raise OSError("no answer")
        super()._disable()
class Stubborn(Loopback):
    """Takes longer to let go than the daemon waits, and will not from outside either."""
    def _disable(self):
        if not Path(__file__).with_name("clings").exists():
            super()._disable()
        elif Path(sys.argv[0]).stem == "process":
            time.sleep(60.0)
        else:
            time.sleep(1.0)
            raise OSError("no answer")
'''

NO_ANSWER = f"OSError: no answer (slow_devices.py:{DRIVERS[: DRIVERS.index('raise OSError')].count(chr(10)) + 1})"


@pytest.fixture
def laboratory(tmp_path: Path) -> Path:
    (tmp_path / "slow_devices.py").write_text(DRIVERS)
    package = tmp_path / "slow_devices-1.0.dist-info"
    package.mkdir()
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: slow-devices\nVersion: 1.0\n")
    names = ("slow", "stuck", "stubborn", "noting", "clinging")
    points = "[hapticd.drivers]\n" + "".join(f"{name} = slow_devices:{name.capitalize()}\n" for name in names)
    (package / "entry_points.txt").write_text(points)
    return tmp_path


def test_a_driver_that_is_slow_to_let_go_is_waited_for(laboratory: Path) -> None:
    with Daemon(PRESSED + '[device]\ndriver = "slow"\n', pythonpath=laboratory).wait_ready() as daemon:
        pressing(daemon)
        daemon.process.send_signal(signal.SIGTERM)
        assert daemon.wait_exit() == 0, daemon.output()
        assert nothing_left(daemon)


def test_a_loop_that_hangs_while_it_ramps_the_force_out_is_not_waited_for(laboratory: Path) -> None:
    with Daemon(PRESSED + '[device]\ndriver = "stuck"\n', pythonpath=laboratory).wait_ready() as daemon:
        pressing(daemon)
        (laboratory / "stuck").touch()
        daemon.process.send_signal(signal.SIGTERM)
        assert daemon.wait_exit() == 1
        assert "stood still for more than 0.1 s; the device is without force" in daemon.output()
        assert nothing_left(daemon)


def test_the_end_of_a_loop_holds_up_no_other_on_its_processor(laboratory: Path) -> None:
    """To leave Python and to give the memory back takes 7 ms, which none of the same real-time class gets between."""
    with Daemon(PRESSED + '[device]\ndriver = "noting"\n', pythonpath=laboratory).wait_ready() as daemon:
        daemon.process.send_signal(signal.SIGTERM)
        assert daemon.wait_exit() == 0, daemon.output()
    classes = (laboratory / "classes").read_text().split()
    assert classes == [str(os.SCHED_FIFO), str(os.SCHED_OTHER)]


def test_a_loop_that_has_to_be_killed_at_the_end_leaves_no_force_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Whatever the daemon ends for, such as an error of its own."""
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(tmp_path))
    daemon = supervising.Daemon(parse('[loop]\nrealtime = "off"\n', "lab.toml"), "default")
    daemon.state.loop.process.send_signal(signal.SIGSTOP)
    daemon._undo.close()
    assert daemon.state.loop.exit_code == -signal.SIGKILL
    assert "was killed; the device is without force" in caplog.text


def test_no_fault_record_is_waited_for_before_the_force_is_taken_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A stop while the loop hangs in the driver of a lost device: the force stood for as long as a slow disk took."""
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(tmp_path))
    daemon = supervising.Daemon(parse('[loop]\nrealtime = "off"\n', "lab.toml"), "default")
    loop = daemon.state.loop
    loop.process.send_signal(signal.SIGSTOP)
    daemon.state.recovery.begin(loop, "unplugged")
    daemon.stop("SIGTERM")
    seen: list[tuple[int | None, bool]] = []

    def close(*_arguments: object) -> None:
        seen.append((loop.exit_code, "was killed; the device is without force" in caplog.text))

    monkeypatch.setattr(daemon.state.event_log, "close", close)
    assert daemon.run() == 0
    assert seen == [(-signal.SIGKILL, True)]
    assert caplog.text.count("the device is without force") == 1


@pytest.mark.parametrize(
    ("programs", "said"),
    [
        ("process", "; the device is without force"),
        (
            "process force_release hapticd",
            f"; the device did not let go: _disable: {NO_ANSWER}; without the helper, the device did not let go: "
            f"_disable: {NO_ANSWER}",
        ),
    ],
)
def test_a_force_that_the_loop_could_not_take_away_is_taken_away_from_outside(
    laboratory: Path, programs: str, said: str
) -> None:
    """The daemon said `stopped`, and its helper `the device is without force`, whatever the driver had raised."""
    with Daemon(PRESSED + '[device]\ndriver = "clinging"\n', pythonpath=laboratory).wait_ready() as daemon:
        pressing(daemon)
        (laboratory / "clings").write_text(programs)
        daemon.process.send_signal(signal.SIGTERM)
        assert daemon.wait_exit() == 1, daemon.output()
        assert f"the control loop could not take the force away{said}\n" in daemon.output()
        assert nothing_left(daemon)


@contextmanager
def stopping(daemon: Daemon) -> Iterator[subprocess.Popen[str]]:
    """`hapticd stop` under way."""
    environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(daemon.directory / "run")}
    with subprocess.Popen([HAPTICD, "stop"], env=environment, stdout=-1, stderr=-1, text=True) as asking:
        yield asking


@pytest.mark.parametrize("driver", ["clinging", "stubborn"])
def test_all_who_ask_to_stop_a_device_that_does_not_let_go_hear_that_the_force_may_be_there(
    laboratory: Path, driver: str
) -> None:
    """It exited with 0 and said nothing, and somebody put a hand on the device."""
    with Daemon(PRESSED + f'[device]\ndriver = "{driver}"\n', pythonpath=laboratory).wait_ready() as daemon:
        pressing(daemon)
        (laboratory / "clings").write_text("process force_release hapticd")
        daemon.process.send_signal(signal.SIGSTOP)  # until both have asked
        with stopping(daemon) as one, stopping(daemon) as other:
            time.sleep(2.0)
            daemon.process.send_signal(signal.SIGCONT)
            for asking in (one, other):
                said, problem = asking.communicate()
                assert (asking.returncode, said) == (1, "")
                assert "the force may still be there: the device did not let go" in problem
                assert "OSError: no answer" in problem
        assert daemon.wait_exit() == 1, daemon.output()


def test_who_asks_to_stop_a_device_that_is_let_go_of_from_outside_hears_that_all_is_well(laboratory: Path) -> None:
    with Daemon(PRESSED + '[device]\ndriver = "clinging"\n', pythonpath=laboratory).wait_ready() as daemon:
        pressing(daemon)
        (laboratory / "clings").write_text("process")
        with stopping(daemon) as asking:
            assert asking.communicate() == ("", "")
        assert asking.returncode == 0
        assert daemon.wait_exit() == 1, daemon.output()


def test_who_asks_while_the_daemon_ends_is_answered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fault record on a slow disk holds the end up for 3 s; the force is gone by then."""
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(tmp_path))
    daemon = supervising.Daemon(parse('[loop]\nrealtime = "off"\n', "lab.toml"), "default")
    daemon.stop("SIGTERM")
    asking = threading.Thread(target=command, args=("stop",))

    def close(*_arguments: object) -> None:
        asking.start()
        time.sleep(1.0)

    monkeypatch.setattr(daemon.state.event_log, "close", close)
    failed: list[object] = []
    monkeypatch.setattr(threading, "excepthook", failed.append)
    assert daemon.run() == 0
    asking.join()
    assert not failed


def test_who_waits_for_a_daemon_that_is_killed_hears_of_it_and_not_that_it_does_not_answer(laboratory: Path) -> None:
    with Daemon(PRESSED + '[device]\ndriver = "slow"\n', pythonpath=laboratory).wait_ready() as daemon:
        with stopping(daemon) as asking:
            wait_until(lambda: "stop: asked by" in daemon.output(), "the request")
            daemon.process.kill()
            _, problem = asking.communicate()
        assert asking.returncode == 1
        assert "the daemon ended, or its connection, before it answered" in problem
        assert "what became of the force" in problem


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_who_asks_a_daemon_to_end_again_and_again_does_not_keep_it_from_taking_the_force_away(number: int) -> None:
    """Where the loop hangs in the driver of a lost device: a second Ctrl-C ended the daemon, and the force stayed."""
    with Rig() as rig:
        rig.pressed()
        rig.order("hang-disable")
        wait_until(lambda: "device lost" in rig.daemon.output(), "the loss of the device")
        control = rig.daemon.control_pid()

        def ended() -> bool:
            rig.daemon.process.send_signal(number)
            time.sleep(0.05)
            return rig.daemon.process.poll() is not None

        wait_until(ended, "the end of the daemon")
        assert rig.felt().force_n == 0.0
        wait_until(lambda: gone(control), "the end of the loop")
