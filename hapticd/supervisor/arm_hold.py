"""What a daemon that is started anew has to know of the one before: a device that was let go waits for an `arm`."""

from __future__ import annotations

import logging
from pathlib import Path

from hapticd.loop.memory import DISARM
from hapticd.loop.resume import ResumeState
from hapticd.paths import make_directory
from hapticd.supervisor.child import LoopProcess
from hapticd.tick.flags import Flag

HELD = "stays disarmed: it was disarmed, or a fault had stopped it, when the daemon before ended; `hapticd arm`"

log = logging.getLogger("hapticd")


class ArmHold:
    """A file that is there from a `disarm`, or a fault that latches, until the device is armed again.

    A daemon that dies is started again by systemd, and `safety.auto_arm` would put forces on that somebody has just
    taken away. Simulated devices push on nobody, and are not held.

    Args:
        path: of the file.

    Attributes:
        held: the device may not be armed without anybody's word.
        inherited: it has been so since before this daemon.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            path.lstat()
        except (FileNotFoundError, NotADirectoryError):
            self.held = False
        except OSError:  # nobody knows
            self.held = True
        else:
            self.held = True
        self.inherited = self.held

    def follow(self, loop: LoopProcess, flags: int) -> None:
        """Keep what the state of a running device says.

        Args:
            loop: the process that has it.
            flags: of its last tick; 0 before the first.
        """
        if flags & Flag.ARMED:
            self._keep(loop, held=False)
        elif flags & Flag.LATCHED or loop.shared.words[DISARM]:
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
        """Hold it: the loop is lost, and with it what it knew."""
        self._keep(loop, held=True)

    def _keep(self, loop: LoopProcess, *, held: bool) -> None:
        if held == self.held or loop.info.simulated:
            return
        self.held = held
        self.inherited = False
        try:
            if held:
                make_directory(self._path.parent, 0o750)
                self._path.touch(mode=0o640)
            else:
                self._path.unlink(missing_ok=True)
        except OSError as error:
            what = "stays disarmed" if held else "may be armed by itself again"
            log.warning("%s: %s; one that is started anew does not know that the device %s", self._path, error, what)
