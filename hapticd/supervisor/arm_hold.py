"""What a daemon that is started anew has to know of the one before: a device that was let go waits for an `arm`."""

from __future__ import annotations

import contextlib
import logging
from pathlib import Path

from hapticd.config.loading import LoadedConfig
from hapticd.errors import HapticdError
from hapticd.loop.memory import DISARM, FIELDS, LAW_CODE, PORT_LAW_CODE
from hapticd.loop.resume import ResumeState
from hapticd.paths import make_directory
from hapticd.replacing import write
from hapticd.supervisor.child import LoopProcess
from hapticd.tick.flags import Flag

HELD = "stays disarmed: it was disarmed, or a fault had stopped it, when the daemon before ended; `hapticd arm`"
EDITED = "stays disarmed: edited, as far as can be told, since the daemon before was armed and died; `hapticd arm`"

log = logging.getLogger("hapticd")


class ArmHold:
    """A file that is there from a `disarm`, or a fault that latches, until the device is armed again.

    A daemon that dies is started again by systemd, and `safety.auto_arm` would put forces on that somebody has just
    taken away, or that somebody has edited and not asked for. So another file, `armed`, says what was last armed with,
    until an orderly end. Simulated devices push on nobody, and are not held.

    Args:
        path: of the file.

    Attributes:
        held: the device may not be armed without anybody's word.
        inherited: why it has been so since before this daemon, a line for people; "" where it has not.
    """

    def __init__(self, path: Path) -> None:
        self._armed_path = path.with_name("armed")
        self._config: LoadedConfig | None = None  # what the device was last armed with
        self._codes = (0, 0, 0)
        self._path = path
        self._kept = True  # the file says the same as `held`
        try:
            path.lstat()
        except (FileNotFoundError, NotADirectoryError):
            self.held = False
        except OSError:  # nobody knows
            self.held = True
        else:
            self.held = True
        self.inherited = HELD if self.held else ""

    def resume(self, config: LoadedConfig) -> ResumeState:
        """What the first loop goes on from: what it may not arm by itself.

        Args:
            config: what the loop is to run.
        """
        law_code = port_law_code = fields = 0
        try:
            text_hash, *codes = self._armed_path.read_text("ascii").split()
            if text_hash != config.sha256:
                raise ValueError(text_hash)
            law_code, port_law_code, fields = map(int, codes)
        except (FileNotFoundError, NotADirectoryError):
            pass
        except (OSError, ValueError):  # edited, or nobody knows
            self.inherited = self.inherited or EDITED
        return ResumeState(may_arm=not self.inherited, law_code=law_code, port_law_code=port_law_code, fields=fields)

    def follow(self, loop: LoopProcess, flags: int, config: LoadedConfig) -> None:
        """Keep what the state of a running device says.

        Args:
            loop: the process that has it.
            flags: of its last tick; 0 before the first.
            config: what the loop runs.
        """
        if flags & Flag.ARMED:
            self.inherited = ""
            self._keep(loop, held=False)
            self._keep_armed(loop, config)
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

    def end(self) -> None:
        """Forget what the device was armed with: who starts a daemon after an orderly end asks for what it runs."""
        with contextlib.suppress(OSError):  # what is still there holds
            self._armed_path.unlink(missing_ok=True)

    def _keep_armed(self, loop: LoopProcess, config: LoadedConfig) -> None:
        words = loop.shared.words
        codes = (words[LAW_CODE], words[PORT_LAW_CODE], words[FIELDS])
        if (config is self._config and codes == self._codes) or loop.info.simulated:
            return
        self._config, self._codes = config, codes
        try:
            make_directory(self._armed_path.parent, 0o750)
            write(self._armed_path, " ".join([config.sha256, *map(str, codes)]).encode())
        except (OSError, HapticdError) as error:
            log.warning("%s; a daemon started anew after a crash does not know what was edited since", error)

    def _keep(self, loop: LoopProcess, *, held: bool) -> None:
        if (held == self.held and self._kept) or loop.info.simulated:
            return
        told = held == self.held
        self.held = held
        self.inherited = ""
        try:
            if held:
                make_directory(self._path.parent, 0o750)
                self._path.touch(mode=0o640)
            else:
                self._path.unlink(missing_ok=True)
        except OSError as error:
            self._kept = False  # a disk that is full now may not be so at the next look
            if not told:
                what = "stays disarmed" if held else "may be armed by itself again"
                log.warning(
                    "%s: %s; one that is started anew does not know that the device %s", self._path, error, what
                )
        else:
            self._kept = True
