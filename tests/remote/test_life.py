"""The process that hears clients lives while it is needed and no longer; and whom it lets in from elsewhere."""

from __future__ import annotations

import os
import re
import signal
import subprocess
from pathlib import Path

import msgpack
import pytest
import zmq

import hapticd
from hapticd.client import ClientError, RefusedKeyError, RemotePort
from hapticd.client.commands import RefusedError
from hapticd.keys.file import Key, new_pair, write
from hapticd.keys.store import KeyDirectory
from hapticd.tick.event import EventCode
from tests.daemon.running import HAPTICD, Daemon, Subscriber, gone, wait_until
from tests.ports import free_port
from tests.remote.stage import CONFIG, driven, hold, remote_pid, runtime

NOTHING_TO_DRIVE = CONFIG[: CONFIG.index("[[scene.couplings]]")]
MORE = CONFIG + '[[scene.forces]]\nname = "field"\nmax_force_n = 1.0\n'


def test_it_comes_and_goes_with_what_clients_may_drive_and_keeps_their_names(monkeypatch: pytest.MonkeyPatch) -> None:
    with Daemon(NOTHING_TO_DRIVE).wait_ready() as daemon:
        monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(daemon.directory / "run"))
        with hapticd.connect() as client:
            assert remote_pid(daemon) == 0
            with pytest.raises(ClientError, match='no "tool" in the scene: nothing in it is for clients to drive'):
                client.remote("tool")

            daemon.config.write_text(CONFIG)
            client.reload()
            wait_until((runtime(daemon) / "state").exists, "its sockets")
            first = remote_pid(daemon)
            with client.remote("tool") as tool:
                hold(tool, 0.001)
                daemon.config.write_text(MORE)
                client.reload()
                hold(tool, 0.002)
                with client.remote("field") as field:
                    wait_until(lambda: pushes(field), "the force to be felt")
                assert client.status().remote_name == ("tool", "field")
                wait_until(lambda: shows_both_while_driven(tool), "a status of what is driven, each second one")
            assert remote_pid(daemon) == first

            daemon.config.write_text(CONFIG + "[remote]\nlease_s = 7.5\n")
            client.reload()
            with driven(daemon) as tool, driven(daemon) as other:
                hold(tool, 0.001)
                other.move([0.0])
                with pytest.raises(RefusedError, match=r"until it lets go or is silent for 7\.5 s"):
                    hold(other, 0.0)
            daemon.config.write_text(NOTHING_TO_DRIVE)
            client.reload()
            wait_until(lambda: gone(first), "the process to end")
            assert sorted(path.name for path in runtime(daemon).iterdir()) == ["control", "lock", "telemetry"]


def pushes(field: RemotePort) -> bool:
    """Whether a force is in force; it is let go soon after it was said."""
    field.push([0.5])
    return field.state(20.0).ports["field"].seq > 0


def shows_both_while_driven(tool: RemotePort) -> bool:
    """Whether `hapticd status` knows the driver; what it shows was counted up to two seconds ago."""
    with subprocess.Popen([HAPTICD, "status"], stdout=subprocess.PIPE, text=True) as asking:
        while asking.poll() is None:  # who is silent for long drives it no more
            hold(tool, 0.002)
        assert asking.stdout is not None
        shown = asking.stdout.read()
    assert asking.returncode == 0
    assert re.search(r"^  force field: (driven by .+|no client), \d+ messages, 0 refused$", shown, re.M)
    driver = rf"user {os.getuid()}, process {os.getpid()}"
    return bool(re.search(rf"^  coupling tool: driven by {driver}, [1-9]\d* messages, 0 refused$", shown, re.M))


def classes(pid: int) -> set[int]:
    """Scheduling classes of a process's threads."""
    return {os.sched_getscheduler(int(task.name)) for task in Path(f"/proc/{pid}/task").iterdir()}


def test_it_is_real_time_where_the_loop_is_and_not_while_it_is_flooded() -> None:
    with Daemon(CONFIG).wait_ready() as daemon, driven(daemon) as tool:
        hold(tool, 0.001)
        loop = os.sched_getscheduler(daemon.control_pid()) & ~os.SCHED_RESET_ON_FORK
        alone = len(os.sched_getaffinity(0)) == 1
        pid = remote_pid(daemon)
        assert classes(pid) == {os.SCHED_OTHER if alone else loop}
        assert os.sched_getparam(pid).sched_priority <= 1 < os.sched_getparam(daemon.control_pid()).sched_priority
        context = zmq.Context()
        with context, context.socket(zmq.DEALER) as flood:
            flood.connect(f"ipc://{runtime(daemon)}/scene")
            flood.setsockopt(zmq.LINGER, 0)

            def is_ordinary() -> bool:
                for _ in range(1000):
                    flood.send(msgpack.packb({"name": "tool", "seq": 1}))
                return classes(pid) == {os.SCHED_OTHER}

            wait_until(is_ordinary, "an ordinary process")
        wait_until(lambda: classes(pid) == {os.SCHED_OTHER if alone else loop}, "the flood to be over")


def test_a_killed_supervisor_leaves_no_process_behind() -> None:
    with Daemon(CONFIG).wait_ready() as daemon:
        pid = remote_pid(daemon)
        with driven(daemon) as tool:
            hold(tool, 0.001)
        daemon.process.kill()
        daemon.process.wait()
        wait_until(lambda: gone(pid), "the process to end")


@pytest.mark.nightly
def test_one_that_hangs_is_replaced() -> None:
    with Daemon(CONFIG).wait_ready() as daemon, Subscriber(daemon.endpoint, "hapticd/") as subscriber:
        subscriber.until("hapticd/status")
        pid = remote_pid(daemon)
        with driven(daemon) as tool:
            hold(tool, 0.001)
            os.kill(pid, signal.SIGSTOP)
            subscriber.until("hapticd/event", code=EventCode.REMOTE_STALE)
            lost = subscriber.until("hapticd/event", code=EventCode.REMOTE_LOST)
            assert "stood still for more than 5 s" in lost["text"]
            hold(tool, 0.001)
            assert gone(pid)


@pytest.fixture
def keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The daemon's keys, a client that may drive and one that may only watch."""
    place = tmp_path / "keys"
    monkeypatch.setenv("HAPTICD_KEYS_DIR", str(place))
    directory = KeyDirectory(place)
    server = directory.make()
    for name, watch_only in (("driver", False), ("watcher", True)):
        pair = new_pair()
        write(tmp_path / f"{name}.key_secret", Key(pair.public, pair.secret, server.public))
        directory.add(name, Key(pair.public, watch_only=watch_only))
    return tmp_path


def test_from_elsewhere_those_drive_whose_key_is_listed_for_it(keys: Path) -> None:
    scene, state, telemetry = (f"tcp://127.0.0.1:{free_port()}" for _ in range(3))
    remote = f'[remote]\nscene_tcp = "{scene}"\nstate_tcp = "{state}"\n[telemetry]\ntcp = "{telemetry}"\n'
    with Daemon(CONFIG + remote).wait_ready() as daemon:
        assert remote_pid(daemon)
        with hapticd.connect(telemetry=telemetry, keys=None) as client:
            with pytest.raises(ClientError, match=r"remote\.scene_tcp and remote\.state_tcp"):
                client.remote("tool")
            with pytest.raises(RefusedKeyError, match="takes keys"):
                client.remote("tool", scene=scene, state=state)
        with RemotePort("tool", scene, state, keys / "driver.key_secret") as tool:
            hold(tool, 0.001)
        with pytest.raises(RefusedKeyError, match="does not let your key in"):
            RemotePort("tool", scene, state, keys / "watcher.key_secret")
