"""What a daemon that is started anew has to know of the one before: a device that was let go waits for an `arm`."""

from __future__ import annotations

import contextlib
import logging
import os
import threading
from pathlib import Path

from hapticd.config.file import read
from hapticd.config.loading import LoadedConfig
from hapticd.errors import HapticdError
from hapticd.loop.memory import DISARM, FIELDS, LAW_CODE, MAY_ARM, PORT_LAW_CODE
from hapticd.loop.resume import ResumeState
from hapticd.paths import make_directory
from hapticd.replacing import write
from hapticd.supervisor.child import LoopProcess
from hapticd.tick.flags import Flag

HELD = "stays disarmed: it was disarmed, or a fault had stopped it, when the daemon before ended; `hapticd arm`"
EDITED = "stays disarmed: edited or tared, as far as can be told, before the last daemon died; `hapticd arm`"
UNKEPT = "stays disarmed: nothing can be kept in the state directory, so nor was an earlier disarming; `hapticd arm`"

log = logging.getLogger("hapticd")


class ArmHold:
    """A file that is there from a `disarm`, or a fault that latches, until the device is armed again.

    A daemon that dies is started again by systemd, and `safety.auto_arm` would put forces on that somebody has just
    taken away, or that somebody has edited and not asked for, or at a wall that a tare had put elsewhere. So another
    file, `armed`, says with what the device was last armed or could have been by itself, until an orderly end.
    Simulated devices are not held.

    Args:
        path: of the file.

    Attributes:
        held: the device may not be armed without anybody's word.
        inherited: why it has been so since before this daemon, a line for people; "" where it has not.
    """

    def __init__(self, path: Path) -> None:
        self._armed_path = path.with_name("armed")
        self._armed: tuple[LoadedConfig, list[int], bool] | None = None  # what the device may be armed with
        self._armed_kept = True  # the other file says the same
        self._path = path
        self.held = _is_there(path)
        self._kept = not self.held  # the file says the same as `held`; whether it does that may not be known
        self.inherited = HELD if self.held else ""

    def resume(self, config: LoadedConfig) -> ResumeState:
        """What the first loop goes on from: what it may not arm by itself.

        Args:
            config: what the loop is to run.
        """
        law_code = port_law_code = fields = 0
        if _is_there(self._armed_path):
            try:
                text_hash, *codes = read(self._armed_path, files_only=True).split()
                if text_hash != config.sha256:
                    raise ValueError(text_hash)
                law_code, port_law_code, fields = map(int, codes)
            except (HapticdError, OSError, ValueError):  # edited, or not readable
                self.inherited = self.inherited or EDITED
        if config.config.safety.auto_arm:
            with contextlib.suppress(OSError):
                make_directory(self._path.parent, 0o750)
            if not os.access(self._path.parent, os.W_OK | os.X_OK):
                self.held, self._kept, self.inherited = True, False, self.inherited or UNKEPT
        return ResumeState(may_arm=not self.inherited, law_code=law_code, port_law_code=port_law_code, fields=fields)

    def follow(self, loop: LoopProcess, flags: int, config: LoadedConfig, tared: bool) -> None:
        """Keep what the state of a running device says.

        Args:
            loop: the process that has it.
            flags: of its last tick; 0 before the first.
            config: what the loop runs.
            tared: positions count from where no daemon that is started anew would count them from.
        """
        if flags & Flag.ARMED or loop.shared.words[MAY_ARM]:
            self._keep_armed(loop, config, tared)
        if flags & Flag.ARMED:
            self.inherited = ""
            self._keep(loop, held=False)
        elif flags & Flag.LATCHED or loop.shared.words[DISARM] or self.held:
            self._keep(loop, held=True)

    def follow_lost(self, loop: LoopProcess, resume: ResumeState) -> None:
        """Keep what was asked for while the device is away.

        Args:
            loop: the process that has lost it.
            resume: what the next one goes on from.
        """
        if resume.latched or not resume.may_arm:
            self._keep(loop, held=True)

    def keep(self, loop: LoopProcess) -> None:
        """Hold it: somebody has asked for that, or the loop is lost, and with it what it knew."""
        self._keep(loop, held=True)

    def end(self) -> None:
        """Forget what the device was armed with: who starts a daemon after an orderly end asks for what it runs."""
        with contextlib.suppress(OSError):  # what is still there holds
            self._armed_path.unlink(missing_ok=True)

    def _keep_armed(self, loop: LoopProcess, config: LoadedConfig, tared: bool) -> None:
        armed = (config, [loop.shared.words[code] for code in (LAW_CODE, PORT_LAW_CODE, FIELDS)], tared)
        told = armed == self._armed
        if (told and self._armed_kept) or loop.info.simulated:
            return
        self._armed, self._armed_kept = armed, True
        try:
            make_directory(self._armed_path.parent, 0o750)
            write(self._armed_path, " ".join(["tared" if tared else config.sha256, *map(str, armed[1])]).encode())
        except (OSError, HapticdError) as error:
            self._armed_kept = False
            with contextlib.suppress(OSError):
                self._armed_path.touch(mode=0o640)  # also on a disk that is full; an empty one holds
            if not told:
                log.warning("%s; a daemon started anew after a crash does not know what was edited since", error)

    def _keep(self, loop: LoopProcess, *, held: bool) -> None:
        if (held == self.held and self._kept) or loop.info.simulated:
            return
        told = held == self.held
        self.held, self._kept, self.inherited = held, True, self.inherited if told else ""
        try:
            if held:
                make_directory(self._path.parent, 0o750)
                self._path.touch(mode=0o640)
                threading.Thread(target=_sync, args=(self._path.parent,), daemon=True).start()
            else:
                self._path.unlink(missing_ok=True)
        except (OSError, RuntimeError) as error:  # the other where there is room for no thread
            self._kept = False  # a disk that is full now may not be so at the next look
            if not told:
                what = "stays disarmed" if held else "may be armed by itself again"
                log.warning("%s: %s; one started anew does not know that the device %s", self._path, error, what)


def _sync(directory: Path) -> None:
    """Have a new file there outlive a power cut; a slow disk takes seconds, so in no turn of the daemon."""
    with contextlib.suppress(OSError):
        descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _is_there(path: Path) -> bool:
    """Whether anything lies at a path; True also where that cannot be found out."""
    try:
        path.lstat()
    except OSError as error:
        return not isinstance(error, (FileNotFoundError, NotADirectoryError))
    return True
