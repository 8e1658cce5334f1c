"""A daemon that is started anew puts no force on that was taken away before, whatever arms by itself."""

from __future__ import annotations

import os
import queue
import signal
import tracemalloc
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import Mock

import msgpack
import pytest
import zmq

from hapticd.config.loading import LoadedConfig, parse
from hapticd.errors import HapticdError
from hapticd.loop.memory import DISARM, FIELDS, LAW_CODE, MAY_ARM, PORT_LAW_CODE
from hapticd.loop.resume import FROM_START, ResumeState
from hapticd.supervisor import arm_hold
from hapticd.supervisor.arm_hold import EDITED, UNKEPT, ArmHold
from hapticd.supervisor.daemon import Daemon
from hapticd.tick.event import EventCode
from hapticd.tick.flags import Flag
from tests.daemon.running import PATIENCE_S, wait_until
from tests.faults.rig import Rig, anew_where_late, events_until
from tests.remote.stage import remote_pid

HELD = "stays disarmed: it was disarmed, or a fault had stopped it, when the daemon before ended"


def disarmed(rig: Rig) -> None:
    assert rig.ask("disarm")["ok"]
    os.kill(rig.daemon.control_pid(), signal.SIGKILL)


def disarmed_and_stopped(rig: Rig) -> None:
    assert rig.ask("disarm")["ok"]
    assert rig.ask("stop")["ok"]


def ask_at_once(rig: Rig, *requests: str) -> None:
    with zmq.Context() as context, context.socket(zmq.DEALER) as control:
        control.linger = 0
        control.connect(f"ipc://{rig.daemon.directory}/run/default/control")
        for do in requests:
            control.send(msgpack.packb({"do": do}))
        for _ in requests:
            assert control.poll(int(PATIENCE_S * 1e3)), rig.daemon.output()
            assert msgpack.unpackb(control.recv())["ok"]


def disarmed_as_it_stops(rig: Rig) -> None:
    ask_at_once(rig, "disarm", "stop")


def disarmed_while_it_stops(rig: Rig) -> None:
    ask_at_once(rig, "stop", "disarm")


def disarmed_while_lost(rig: Rig) -> None:
    with rig.subscriber() as subscriber:
        rig.order("unplugged")
        events_until(subscriber, EventCode.DEVICE_LOST)
        assert rig.ask("disarm")["ok"]
    os.kill(rig.daemon.process.pid, signal.SIGKILL)
    rig.mend()


def latched(rig: Rig) -> None:
    with rig.subscriber() as subscriber:
        rig.order("jump")
        assert subscriber.until("hapticd/status", latched=True)
        rig.mend()
    os.kill(rig.daemon.process.pid, signal.SIGKILL)


def hanging(rig: Rig) -> None:
    os.kill(rig.daemon.control_pid(), signal.SIGSTOP)


def armed(rig: Rig) -> None:
    os.kill(rig.daemon.process.pid, signal.SIGKILL)


def armed_after_disarm(rig: Rig) -> None:
    assert rig.ask("disarm")["ok"]
    rig.goes_on("arm")
    assert rig.ask("stop")["ok"]


@pytest.mark.parametrize(
    "end",
    [
        *(disarmed, disarmed_and_stopped, disarmed_as_it_stops, disarmed_while_it_stops),
        *(disarmed_while_lost, latched, hanging),
    ],
)
@anew_where_late
def test_what_was_let_go_stays_so_until_it_is_armed_also_by_a_daemon_that_is_started_anew(end: Any) -> None:
    """With `safety.auto_arm` it pushed again 5 s after somebody had disarmed it."""
    with Rig(safety="auto_arm = true") as rig:
        rig.pressing()
        assert HELD not in rig.daemon.output()
        end(rig)
        rig.daemon.again()
        status = rig.ask("status")["status"]
        assert (status["armed"], HELD in str(status["warnings"])) == (False, True)
        wait_until(lambda: HELD in rig.daemon.output(), "the log")
        rig.goes_on("arm")
        assert HELD not in str(rig.ask("status")["status"]["warnings"])
        armed(rig)
        rig.daemon.again()
        rig.pressing()


@pytest.mark.parametrize("disarming", [False, True])
def test_a_tick_from_before_a_disarming_is_no_arming_after_it(disarming: bool) -> None:
    hold = Mock()
    state = Mock(recovery=Mock(lost=False), requests=Mock(disarming=disarming), arm_hold=hold)
    state.status.origin_m = {}
    Daemon._hold(cast("Daemon", SimpleNamespace(state=state)))
    assert hold.follow.called != disarming


@pytest.mark.parametrize("end", [armed, armed_after_disarm])
@anew_where_late
def test_what_was_armed_arms_itself_again(end: Any) -> None:
    with Rig(safety="auto_arm = true") as rig:
        rig.pressing()
        end(rig)
        rig.daemon.again()
        rig.pressing()
        assert HELD not in rig.daemon.output()


def waits(rig: Rig) -> None:
    """It is disarmed, and says why."""
    status = rig.ask("status")["status"]
    assert not status["armed"]
    assert EDITED in str(status["warnings"])


def edit(rig: Rig) -> None:
    rig.daemon.config.write_text(rig.daemon.config.read_text() + "# edited\n")


@anew_where_late
def test_what_was_edited_since_a_daemon_died_arms_itself_only_once_somebody_asks() -> None:
    """A wall of 12 kN/m that had become one of 112 pushed as soon as systemd had started the daemon anew."""
    with Rig(safety="auto_arm = true") as rig:
        rig.pressing()
        armed(rig)
        edit(rig)
        rig.daemon.again()
        waits(rig)
        armed(rig)
        rig.daemon.again()
        waits(rig)  # also one that dies once more
        rig.goes_on("arm")
        assert EDITED not in str(rig.ask("status")["status"]["warnings"])
        armed(rig)
        rig.daemon.again()
        rig.pressing()


@anew_where_late
def test_what_was_edited_after_a_daemon_died_on_its_way_waits_as_well() -> None:
    """Its loop had pushed before there was a first turn, which alone kept what with: a wall of 50 kN/m came instead."""
    rig = Rig(safety="auto_arm = true", more='[[scene.forces]]\nname = "field"\nmax_force_n = 1.0\n')
    daemon = rig.daemon
    try:
        wait_until(lambda: remote_pid(daemon), "the process that hears clients")
        os.kill(hearing := remote_pid(daemon), signal.SIGSTOP)  # a busy computer may take its time as well
        wait_until(lambda: rig.felt().force_n > 1.0, "a force before the daemon is ready")
        kept = daemon.directory / "state" / "default" / "armed"
        wait_until(kept.exists, "the daemon to have heard of its loop, which a busy computer may keep it from")
        armed(rig)
        os.kill(hearing, signal.SIGKILL)
        edit(rig)
        daemon.again()
        waits(rig)
    finally:
        rig.__exit__()


@anew_where_late
def test_what_was_edited_and_reloaded_or_is_started_after_an_orderly_end_arms_itself() -> None:
    with Rig(safety="auto_arm = true") as rig:
        rig.pressing()
        edit(rig)
        assert rig.ask("reload", wait=True)["ok"]
        assert rig.ask("status")["status"]["armed"]  # answered once the reload is kept as well
        armed(rig)
        rig.daemon.again()
        rig.pressing()
        assert rig.ask("stop")["ok"]
        edit(rig)
        rig.daemon.again()
        rig.pressing()


@anew_where_late
def test_a_first_arm_that_was_only_saved_and_not_asked_for_waits_for_it_after_a_crash() -> None:
    """The device had never been armed; the daemon died, and the one that systemd started in its place pushed."""
    with Rig(safety="auto_arm = false") as rig:
        assert not rig.ask("status")["status"]["armed"]
        rig.daemon.config.write_text(rig.config.replace("auto_arm = false", "auto_arm = true"))
        for _ in range(2):
            armed(rig)
            rig.daemon.again()
            waits(rig)
        rig.goes_on("arm")


@anew_where_late
def test_what_was_tared_arms_itself_only_once_somebody_asks_after_a_crash() -> None:
    """Its wall came back to where it had stood before the tare: 0 N in the hand became 2.5 N."""
    with Rig(safety="auto_arm = true") as rig:
        rig.pressing()
        assert rig.ask("disarm", wait=True)["ok"]
        assert rig.hapticd("tare").returncode == 0
        assert rig.ask("arm")["ok"]
        with rig.subscriber("hapticd/status") as subscriber:
            assert any(subscriber.until("hapticd/status", armed=True)["origin_m"])
        armed(rig)
        rig.daemon.again()
        waits(rig)
        rig.goes_on("arm")
        armed(rig)
        rig.daemon.again()
        rig.pressing()


def loop(
    asked: int = 0, simulated: bool = False, codes: tuple[int, int, int] = (1, 2, 3), may_arm: bool = False
) -> Any:
    words = {DISARM: asked, MAY_ARM: may_arm, **dict(zip((LAW_CODE, PORT_LAW_CODE, FIELDS), codes, strict=True))}
    return SimpleNamespace(info=SimpleNamespace(simulated=simulated), shared=SimpleNamespace(words=words))


def sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(1 << 27)


def refused(_path: Path) -> None:
    raise PermissionError(13, "Permission denied")


def running(text: str = "") -> LoadedConfig:
    return parse(text, "running")


class TestTheFile:
    @pytest.fixture
    def path(self, tmp_path: Path) -> Path:
        return tmp_path / "state" / "disarmed"

    def test_it_is_there_as_long_as_the_device_is_held(self, path: Path) -> None:
        hold = ArmHold(path)
        for flags, asked, held in (
            (0, 0, False),  # a device that waits for its first arm was not let go
            (Flag.ARMED, 0, False),
            (Flag.RELEASING, 1, True),
            (0, 1, True),
            (Flag.ARMED, 1, False),
            (Flag.LATCHED | Flag.RELEASING, 0, True),
            (0, 0, True),  # cleared, and not armed yet
        ):
            hold.follow(loop(asked), flags, running(), False)
            assert (hold.held, path.exists(), ArmHold(path).held) == (held, held, held)

    @pytest.mark.parametrize("resume", [ResumeState(may_arm=False), ResumeState(latched=True)])
    def test_a_lost_device_that_may_not_arm_itself_is_held(self, path: Path, resume: ResumeState) -> None:
        hold = ArmHold(path)
        hold.follow_lost(loop(), FROM_START)
        assert not hold.held
        hold.follow_lost(loop(), resume)
        assert ArmHold(path).held

    def test_a_simulated_device_pushes_on_nobody(self, path: Path) -> None:
        hold = ArmHold(path)
        hold.follow(loop(1, simulated=True), 0, running(), False)
        hold.follow(loop(simulated=True), Flag.ARMED, running(), False)
        hold.keep(loop(simulated=True))
        assert not path.parent.exists()

    def test_the_next_one_goes_on_from_what_the_device_was_armed_with(self, path: Path) -> None:
        hold = ArmHold(path)
        assert hold.resume(running()) == FROM_START
        hold.follow(loop(), Flag.ARMED, running(), False)
        as_it_was = ResumeState(law_code=1, port_law_code=2, fields=3)
        assert ArmHold(path).resume(running()) == as_it_was
        edited = ArmHold(path)
        assert edited.resume(running("# edited")) == ResumeState(may_arm=False)
        assert edited.inherited == EDITED
        hold.follow(loop(codes=(4, 2, 3)), Flag.ARMED, running("# edited"), False)
        assert ArmHold(path).resume(running("# edited")) == replace(as_it_was, law_code=4)
        edited.follow(loop(), Flag.ARMED, running("# edited"), False)
        assert edited.inherited == ""
        hold.follow(loop(), Flag.ARMED, running(), True)
        assert not ArmHold(path).resume(running()).may_arm, "tared"
        hold.end()
        assert ArmHold(path).resume(running()) == FROM_START

    @pytest.mark.parametrize("text", [b"", b"\xff", b"hash 1 2", b"hash 1 2 x"])
    def test_a_file_cut_short_holds(self, path: Path, text: bytes) -> None:
        path.parent.mkdir()
        path.with_name("armed").write_bytes(text.replace(b"hash", running().sha256.encode()))
        hold = ArmHold(path)
        assert not hold.resume(running()).may_arm
        assert hold.inherited == EDITED

    def test_what_waits_for_its_first_arm_is_kept_as_well(self, path: Path) -> None:
        hold = ArmHold(path)
        hold.follow(loop(), 0, running(), False)
        assert not path.parent.exists(), "what may not be armed by itself is not what the next one may arm by itself"
        hold.follow(loop(may_arm=True), 0, running(), False)
        assert ArmHold(path).resume(running()).may_arm
        assert not ArmHold(path).resume(running("# edited")).may_arm

    @pytest.mark.parametrize("lay", [os.mkfifo, Path.mkdir, lambda path: path.symlink_to("nowhere"), sparse])
    def test_what_is_no_file_of_a_daemon_holds_and_no_start_waits_for_it(self, path: Path, lay: Any) -> None:
        """A start waited for who writes to a pipe for ever, and 1 GB was read as a whole."""
        path.parent.mkdir()
        lay(path.with_name("armed"))
        tracemalloc.start()
        try:
            assert not ArmHold(path).resume(running()).may_arm
            assert tracemalloc.get_traced_memory()[1] < 1 << 23
        finally:
            tracemalloc.stop()

    def test_what_a_full_disk_did_not_take_is_kept_once_it_does(
        self, path: Path, caplog: pytest.LogCaptureFixture
    ) -> None:
        path.parent.touch()
        hold = ArmHold(path)
        for _ in range(3):
            hold.follow(loop(), Flag.ARMED, running(), False)
        (line,) = caplog.messages
        assert line.endswith("does not know what was edited since")
        path.parent.unlink()
        hold.follow(loop(), Flag.ARMED, running(), False)
        assert not ArmHold(path).resume(running("# edited")).may_arm

    def test_a_disk_that_has_room_for_names_only_holds(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """What was edited since could not be told, and the next daemon pushed with it."""

        def full(path: Path, _content: bytes) -> None:
            raise HapticdError(f"{path}: cannot be written: No space left on device")

        monkeypatch.setattr(arm_hold, "write", full)
        ArmHold(path).follow(loop(), Flag.ARMED, running(), False)
        assert not ArmHold(path).resume(running()).may_arm

    def test_where_nothing_can_be_kept_what_arms_by_itself_waits(self, path: Path) -> None:
        """A disk had become read-only, so a disarming was not kept, and the next daemon pushed with 2.5 N."""
        path.parent.touch()
        auto_arm = running("[safety]\nauto_arm = true")
        assert ArmHold(path).resume(running()).may_arm, "a simulated device may"
        hold = ArmHold(path)
        assert not hold.resume(auto_arm).may_arm
        assert hold.inherited == UNKEPT
        path.parent.unlink()
        assert ArmHold(path).resume(auto_arm).may_arm
        hold.follow(loop(), 0, auto_arm, False)
        assert not ArmHold(path).resume(auto_arm).may_arm, "what waits is kept once it can be"

    def test_what_could_not_be_looked_for_is_kept_once_it_can(
        self, path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """The directory was another user's for a while; the next daemon armed what had been disarmed before."""
        with monkeypatch.context() as closed:
            closed.setattr(Path, "lstat", refused)
            hold = ArmHold(path)
        hold.follow(loop(), 0, running(), False)
        assert hold.inherited == arm_hold.HELD
        assert ArmHold(path).held

    def test_a_disarming_outlives_a_power_cut(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """Within seconds after it the disk knew nothing of it: the device armed itself when the power was back."""
        synced: queue.Queue[str] = queue.Queue()
        monkeypatch.setattr(
            os, "fsync", lambda descriptor: synced.put(str(Path(f"/proc/self/fd/{descriptor}").readlink()))
        )
        ArmHold(path).follow(loop(1), 0, running(), False)
        assert synced.get(timeout=20.0) == str(path.parent)

    def test_a_directory_that_takes_nothing_is_told_of_once(self, path: Path, caplog: pytest.LogCaptureFixture) -> None:
        path.parent.touch()
        hold = ArmHold(path)
        for _ in range(3):
            hold.keep(loop())
        assert hold.held
        (line,) = caplog.messages
        assert line.startswith(str(path))
        assert line.endswith("does not know that the device stays disarmed")
        path.parent.unlink()
        hold.keep(loop())
        assert ArmHold(path).held, "a disk that was full takes it later"
        hold.follow(loop(), Flag.ARMED, running(), False)
        assert not ArmHold(path).held

    def test_a_file_that_nobody_can_look_for_holds(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(Path, "lstat", refused)
        assert ArmHold(path).held
