"""Set the service up on a computer: units, user, device rules, a first configuration; and take all but that away again.

Everything goes where an administrator's own additions belong, /usr/local and /etc, or where a package's do, /usr.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

from hapticd.errors import HapticdError
from hapticd.paths import SYSTEM_CONFIG, directory
from hapticd.replacing import obstacle

METRICS_UNIT: Final = "hapticd-metrics.service"
UNITS: Final = ("hapticd.service", "hapticd@.service", METRICS_UNIT)

KEPT: Final = ("/etc/hapticd", "/var/lib/hapticd")
"""What `uninstall` leaves: configurations and fault records."""

_SHIPPED_EXECUTABLE = "/opt/hapticd/bin/hapticd"
_OWN = Path("/usr/local")
PACKAGE: Final = Path("/usr")
"""The prefix of a package."""
_CLOSED = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")
"""Where the unit's sandbox does not let the service look."""

Say = Callable[[str], None]
"""Called with each line about what is being done."""


class InstallationError(HapticdError):
    """The service cannot be set up or taken away here; the message says what to do."""


@dataclass(frozen=True)
class Installed:
    """A file of the service.

    Attributes:
        path: where it belongs.
        content: what it must hold.
        state: `installed`, `changed` or `missing`.
    """

    path: Path
    content: bytes
    state: str


@dataclass(frozen=True)
class UnitState:
    """What systemd says of a unit.

    Attributes:
        name: such as `hapticd@left.service`.
        active: systemd's ActiveState, such as `active` or `failed`.
        enabled: whether it starts with the computer: systemd's UnitFileState.
        text: what the daemon itself reports.
        result: why it ended, `success` when nothing went wrong.
        restarts: how often it was started again by itself.
    """

    name: str
    active: str
    enabled: str
    text: str
    result: str
    restarts: int


class Installation:
    """The service in a file system.

    Args:
        root: the file system; anything but / is only filled, for a package or an image.
        executable: the `hapticd` that the units run; the one of this interpreter by default.
        prefix: what its directories lie below; where a package has put them, else /usr/local, by default.
        shared: what else belongs below the prefix's `share`: the manual, completions.
    """

    def __init__(
        self,
        root: Path = Path("/"),
        executable: Path | None = None,
        prefix: Path | None = None,
        shared: Mapping[str, bytes] = MappingProxyType({}),
    ) -> None:
        self.root = root.absolute()
        self.packaged = prefix != PACKAGE and self._at(PACKAGE / "lib/systemd/system" / UNITS[0]).exists()
        self.prefix = PACKAGE if self.packaged else (prefix or _OWN).absolute()
        self._library, self._link_path = self.prefix / "lib", self.prefix / "bin/hapticd"
        self._shared = shared
        self.live = self.root == Path("/")
        self.executable = self._inside((executable or Path(sys.executable).with_name("hapticd")).absolute())

    def files(self) -> list[Installed]:
        """Every file of the service except its configuration."""
        units, rules = directory("systemd"), directory("drivers/udev")
        library = self._library
        sources = {
            **{library / "systemd/system" / unit: units / unit for unit in UNITS},
            library / "sysusers.d/hapticd.conf": units / "hapticd.sysusers",
            library / "tmpfiles.d/hapticd.conf": units / "hapticd.tmpfiles",
            **{library / "udev/rules.d" / rule.name: rule for rule in sorted(rules.glob("*.rules"))},
        }
        contents = {
            **{path: self._for_this_program(source) for path, source in sources.items()},
            **{self.prefix / "share" / name: content for name, content in self._shared.items()},
        }
        found = []
        for path, content in contents.items():
            target = self._at(path)
            state = "missing" if not target.exists() else "installed" if target.read_bytes() == content else "changed"
            found.append(Installed(path, content, state))
        return found

    def install(self, say: Say) -> None:
        """Put every file in its place, and make a live system know them. A configuration is never overwritten.

        Raises:
            InstallationError: not allowed, or the service could not run from where hapticd is.
        """
        self._refuse_packaged()
        obstacle = self._obstacle()
        if obstacle and self.live:
            raise InstallationError(obstacle)
        if obstacle:
            say(f"warning: {obstacle}")
        for file in self.files():
            self._write(file.path, file.content)
            say(str(file.path))
        if not self._at(SYSTEM_CONFIG).exists():
            self._write(SYSTEM_CONFIG, (directory("config") / "hapticd.toml").read_bytes())
            say(str(SYSTEM_CONFIG))
        else:
            say(f"{SYSTEM_CONFIG} is kept as it is")
        self._link(say)
        if self.live:
            self._announce()
            for line in advice_after_install(unit_states()):
                say(line)

    def uninstall(self, say: Say) -> None:
        """Stop the service and remove every file except configurations and fault records.

        Raises:
            InstallationError: not allowed.
        """
        self._refuse_packaged()
        units = unit_states() if self.live else []
        running = [unit.name for unit in units if unit.active not in ("inactive", "failed")]
        if running:
            _run("systemctl", "stop", *running)
        for link in self._enabled():
            try:
                link.unlink()
            except OSError as error:
                raise _denied(link, error) from error
        for path in [*(file.path for file in self.files()), *self._own_link()]:
            if self._remove(path):
                say(f"removed {path}")
        if self.live:
            self._announce(gone=True)
        kept = [path for path in KEPT if self._at(Path(path)).exists()]
        if kept:
            say(f"kept: {', '.join(kept)}" + (" and the user hapticd" if self.live else ""))

    def _enabled(self) -> list[Path]:
        """The links by which systemd starts units of the service with the computer, also when a unit has gone."""
        units = {str(self._library / "systemd/system" / unit) for unit in UNITS}
        links = self._at(Path("/etc/systemd/system")).glob("*.wants/hapticd*.service")
        return [link for link in links if link.is_symlink() and str(link.readlink()) in units]

    def _refuse_packaged(self) -> None:
        if self.packaged:
            advice = "apt install or apt remove hapticd"
            raise InstallationError(f"hapticd is here as a package, which owns its files: {advice}")

    def _for_this_program(self, source: Path) -> bytes:
        return source.read_text().replace(_SHIPPED_EXECUTABLE, str(self.executable)).encode()

    def _inside(self, path: Path) -> Path:
        """A path as the system in `root` will see it."""
        return Path("/") / path.relative_to(self.root) if path.is_relative_to(self.root) else path

    def _at(self, path: Path) -> Path:
        """Where a path of the system in `root` is now."""
        return self.root / path.relative_to("/")

    def _obstacle(self) -> str:
        """Why the service could not run this program; empty when it can."""
        executable = self._at(self.executable)
        programs = [executable if executable.exists() else self.executable, Path(sys.executable).resolve()]
        for program in programs:
            path = self._inside(program)
            hidden = [Path(place) for place in _CLOSED if path.is_relative_to(place)]
            closed = hidden or [place for place in reversed(path.parents) if not _open_to_all(self._at(place))]
            if closed:
                return (
                    f"the service may not look into {closed[0]}, where {path} is: install from the source tree with "
                    "`make install PYTHON=/usr/bin/python3`, or into a virtual environment such as /opt/hapticd"
                )
        return "" if programs[0].exists() else f"{self.executable} is not there: install hapticd first"

    def _write(self, path: Path, content: bytes) -> None:
        target = self._at(path)
        previous = os.umask(0o022)
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            reason = obstacle(target)
            if reason:  # a link to /dev/null, for one, by which systemd masks a file
                raise InstallationError(f"{target}: {reason}; remove it first")
            target.write_bytes(content)
            target.chmod(0o644)
        except OSError as error:
            raise _denied(target, error) from error
        finally:
            os.umask(previous)

    def _link(self, say: Say) -> None:
        """Let a shell find the command, unless there is one of that name already."""
        link = self._at(self._link_path)
        if self.executable == self._link_path or link.is_symlink() or link.exists():
            return
        try:
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(self.executable)
        except OSError as error:
            raise _denied(link, error) from error
        say(f"{self._link_path} -> {self.executable}")

    def _own_link(self) -> list[Path]:
        link = self._at(self._link_path)
        return [self._link_path] if link.is_symlink() and link.readlink() == self.executable else []

    def _remove(self, path: Path) -> bool:
        """Remove a file, and the directories above it that are empty now and hold nothing of others."""
        target = self._at(path)
        try:
            target.unlink()
        except FileNotFoundError:
            return False
        except OSError as error:
            raise _denied(target, error) from error
        common = {self._at(self.prefix / name) for name in ("lib", "bin", "share")}
        for above in target.parents:
            # Below share the directories are those of shells and man, but for one.
            foreign = above.is_relative_to(self._at(self.prefix / "share")) and above.name != "hapticd"
            if above in common or foreign or any(above.iterdir()):
                break
            above.rmdir()
        return True

    def _announce(self, gone: bool = False) -> None:
        """Make the running system take the files over."""
        if not gone:
            _run("systemd-sysusers", str(self._library / "sysusers.d/hapticd.conf"))
            _run("systemd-tmpfiles", "--create", str(self._library / "tmpfiles.d/hapticd.conf"))
        if Path("/run/udev/control").exists():
            _run("udevadm", "control", "--reload")
            _run("udevadm", "trigger", *(f"--subsystem-match={name}" for name in ("misc", "usb", "hidraw", "tty")))
        if systemd_runs():
            _run("systemctl", "daemon-reload")


def advice_after_install(units: Sequence[UnitState]) -> list[str]:
    """What is left to do after the files are in place, a line each.

    A unit that runs is not restarted: a device of it may be in a hand. Until it is, it goes on as it was before, and
    no process of the new version joins it.
    """
    running = [unit.name for unit in units if unit.active not in ("inactive", "failed")]
    if not running:
        return ["start it, now and with the computer: systemctl enable --now hapticd"]
    return [f"{name} still runs what was installed before: systemctl restart {name}" for name in running]


def systemd_runs() -> bool:
    """Whether systemd is what runs this computer."""
    return Path("/run/systemd/system").is_dir()


def unit_states() -> list[UnitState]:
    """`hapticd.service` and every other unit that runs, has failed or starts with the computer.

    Raises:
        InstallationError: systemd cannot be asked.
    """
    if not systemd_runs():
        return []
    listed = json.loads(_run("systemctl", "list-units", "--all", "--output=json", "hapticd@*.service", METRICS_UNIT))
    names = ["hapticd.service", *(str(unit["unit"]) for unit in listed)]
    keys = ("Id", "ActiveState", "UnitFileState", "StatusText", "Result", "NRestarts")
    states = []
    for block in _run("systemctl", "show", f"--property={','.join(keys)}", *names).strip().split("\n\n"):
        said = dict(line.split("=", 1) for line in block.splitlines())
        name, active, enabled, text, result, restarts = (said.get(key, "") for key in keys)
        # Another unit that only mentions an instance makes systemd load it.
        if name == "hapticd.service" or active != "inactive" or enabled != "disabled":
            states.append(UnitState(name, active, enabled or "not installed", text, result, int(restarts or 0)))
    return states


def _open_to_all(place: Path) -> bool:
    try:
        return bool(place.stat().st_mode & 0o001)
    except (FileNotFoundError, NotADirectoryError):
        return True


def _denied(path: Path, error: OSError) -> InstallationError:
    advice = "; try sudo" if isinstance(error, PermissionError) else ""
    return InstallationError(f"{path}: {error.strerror}{advice}")


def _run(*command: str) -> str:
    """Run a tool of the system and return what it printed.

    Raises:
        InstallationError: it is missing or failed.
    """
    arguments: Sequence[str] = command
    try:
        return subprocess.run(arguments, capture_output=True, text=True, check=True).stdout
    except FileNotFoundError:
        raise InstallationError(f"{command[0]} is missing: the service needs systemd") from None
    except subprocess.CalledProcessError as error:
        raise InstallationError(f"{' '.join(command)}: {error.stderr.strip() or error.returncode}") from None
