"""Where things are: shipped files, and the sockets, lock and fault records of an instance."""

from __future__ import annotations

import errno
import fcntl
import os
import re
import stat
from pathlib import Path
from typing import Literal

from hapticd.errors import ConfigError, InstanceError

SYSTEM_CONFIG = Path("/etc/hapticd/hapticd.toml")

_PACKAGE = Path(__file__).parent


def directory(name: str) -> Path:
    """A directory of shipped files, such as `config`."""
    installed = _PACKAGE / "share" / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


def default_config() -> Path:
    """The configuration of a command that was given none: the machine's own, else the shipped example."""
    try:
        SYSTEM_CONFIG.stat()
    except (FileNotFoundError, NotADirectoryError):
        return directory("config") / "hapticd.toml"
    except OSError:
        pass  # it is there; reading it will say what is wrong with it
    return SYSTEM_CONFIG


DEFAULT_INSTANCE = "default"
TELEMETRY = "telemetry"
"""Name of the telemetry socket in the runtime directory."""
CONTROL = "control"
"""Name of the control socket beside it."""
SCENE = "scene"
"""Name of the socket beside them on which clients say what happens in the scene."""
STATE = "state"
"""Name of the socket beside it that tells them of each tick."""
LOCK = "lock"
"""Name of the file beside them that a daemon holds locked as long as it lives."""

_FILES_ONLY = os.O_NOFOLLOW | os.O_NONBLOCK
_NO_FILE = (errno.ENOENT, errno.ENOTDIR, errno.ELOOP, errno.ENXIO)  # the last two: a link, a socket


def open_lock(path: Path) -> int:
    """Descriptor of the lock that a daemon holds as long as it lives; made when it is not there.

    Raises:
        InstanceError: it cannot be had: what lies there is no file, or why the system refuses.
    """
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | _FILES_ONLY, 0o644)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.ENXIO, errno.EISDIR):
            raise _in_the_way(path) from None
        raise InstanceError(f"{path}: {why_refused(error.errno)}") from error
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise _in_the_way(path)
    return descriptor


def why_refused(number: int | None) -> str:
    """Why the system makes nothing in a runtime directory, with what to do where that is known.

    Args:
        number: of the error.
    """
    advice = "; run as the user that owns the directory" if number in (errno.EACCES, errno.EPERM, errno.EROFS) else ""
    return f"{os.strerror(number or 0)}{advice}"


_RUN = Path("/run/hapticd")
_WHOSE = ("system", "user")
_INSTANCE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,31}")


def runtime_directory(instance: str = DEFAULT_INSTANCE) -> Path:
    """Directory in which a daemon of this user keeps the sockets and the lock of an instance.

    $HAPTICD_RUNTIME_DIR/<instance>, else systemd's $RUNTIME_DIRECTORY, else /run/hapticd/<instance> for root
    or when this user may write there, else $XDG_RUNTIME_DIR/hapticd/<instance>, else
    /tmp/hapticd-<uid>/<instance>.

    Raises:
        ConfigError: the name is none that a directory could have.
    """
    given = named_directory("RUNTIME", instance)
    if given is not None:
        return given
    system = _RUN / instance
    if os.geteuid() == 0 or os.access(system, os.W_OK | os.X_OK):
        return system
    return _user_runtime(instance)


def make_directory(directory: Path, mode: int) -> None:
    """Make a directory, when it is not there, and those above it that are missing: whatever the umask, none for all.

    Who may write to one above may put another in the place of this one.

    Args:
        directory: its path.
        mode: its rights, before the umask; those above it get 0o755.

    Raises:
        OSError: it cannot be made.
    """
    if not directory.parent.exists():
        make_directory(directory.parent, 0o755)
    directory.mkdir(mode=mode, exist_ok=True)


def make_runtime_directory(instance: str = DEFAULT_INSTANCE) -> Path:
    """The same, made when it is not there; below /tmp it is closed to other users.

    Raises:
        ConfigError: the name is none that a directory could have.
        InstanceError: it cannot be made, or somebody else owns it.
    """
    directory = runtime_directory(instance)
    shared = directory.is_relative_to(_temporary())
    mode = 0o700 if shared else 0o755
    try:
        make_directory(directory.parent, mode)
        if shared and not _ours(directory.parent):
            raise _foreign(directory.parent)
        directory.mkdir(mode=mode, exist_ok=True)
    except OSError as error:
        raise InstanceError(
            f"{directory}: cannot be made ({error.strerror}); set HAPTICD_RUNTIME_DIR to a directory of yours"
        ) from error
    return directory


def alive(directory: Path) -> bool:
    """Whether a daemon lives in a runtime directory: what it left behind when it was killed does not count.

    Raises:
        PermissionError: this user may not look.
    """
    try:
        descriptor = os.open(directory / LOCK, os.O_RDONLY | os.O_CLOEXEC | _FILES_ONLY)
    except OSError as error:
        if error.errno in _NO_FILE:
            return False
        raise
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False


def locate(name: str, instance: str = DEFAULT_INSTANCE) -> Path:
    """Where a client finds a socket of an instance: the system's daemon or the user's own, whichever lives.

    When none does: where one was, else where this user's own would be.

    Args:
        name: of the socket.
        instance: name of the instance; `system/NAME` or `user/NAME` says which daemon of that name.

    Raises:
        ConfigError: the instance's name is none that a directory could have.
        InstanceError: both live, the daemon's directory is not open to this user, or somebody else has made it.
    """
    whose, plain = _named(instance)
    given = named_directory("RUNTIME", plain)
    places = instance_directories(instance)
    living, there, closed = [], [], None
    for directory in places:
        try:
            socket = directory / name
            if socket.exists() and not os.access(socket, os.W_OK):
                raise PermissionError
            if alive(directory):
                living.append(directory)
            if socket.exists():
                there.append(directory)
        except PermissionError:
            closed = directory
    if given is not None:
        if closed is not None:
            raise InstanceError(
                f"{closed}: not open to you, and it is the one that $HAPTICD_RUNTIME_DIR names: "
                "unset that, or run as the user that owns the directory"
            )
        return given / name
    if len(living) > 1:
        raise InstanceError(
            f"two daemons run as {plain!r}, the system's in {living[0]} and your own in {living[1]}: say which with "
            f"--instance system/{plain} or --instance user/{plain}"
        )
    if not living and closed is not None:
        raise InstanceError(f"{closed}: not open to you: sudo usermod -aG hapticd $USER, then log in again")
    found = [*living, *there]
    if found:
        return found[0] / name
    place = {"system": _RUN / plain, "user": _user_runtime(plain)}.get(whose) or runtime_directory(plain)
    if _is_foreign(place):
        raise _foreign(_temporary())
    return place / name


def instance_directories(instance: str) -> list[Path]:
    """Where daemons that have a name may live: the system's and this user's own.

    A directory in /tmp that somebody else has made in this user's place is not among them.

    Raises:
        ConfigError: the name is none that a directory could have.
    """
    whose, plain = _named(instance)
    given = named_directory("RUNTIME", plain)
    if given is not None:
        return [given]
    places = {"system": _RUN / plain, "user": _user_runtime(plain)}
    return [place for owner, place in places.items() if whose in ("", owner) and not _is_foreign(place)]


def living_instances() -> list[str]:
    """Every instance of this computer that lives, as `locate` takes its name; those closed to this user too."""
    given = os.environ.get("HAPTICD_RUNTIME_DIR")
    if given:
        return [directory.name for directory in _living(Path(given))]
    own = _user_runtime(DEFAULT_INSTANCE)
    found = [f"system/{directory.name}" for directory in _living(_RUN)]
    return found if _is_foreign(own) else [*found, *(f"user/{directory.name}" for directory in _living(own.parent))]


def _living(place: Path) -> list[Path]:
    try:
        directories = sorted(place.iterdir())
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        return []
    return [directory for directory in directories if _INSTANCE.fullmatch(directory.name) and _may_live(directory)]


def _may_live(directory: Path) -> bool:
    try:
        return alive(directory)
    except PermissionError:
        return True


def telemetry_endpoint(instance: str = DEFAULT_INSTANCE) -> str:
    """ZeroMQ endpoint on which an instance publishes to this computer."""
    return f"ipc://{locate(TELEMETRY, instance)}"


def named_directory(kind: Literal["RUNTIME", "STATE"], instance: str) -> Path | None:
    """The directory of an instance that the environment names, if it does: $HAPTICD_<kind>_DIR, else systemd's.

    Raises:
        ConfigError: the instance's name is none that a directory could have, or that directory's is no UTF-8, as what
            ZeroMQ binds has to be.
    """
    if _INSTANCE.fullmatch(instance) is None:
        raise ConfigError(f"instance = {instance!r}: letters, digits and _ . - only, at most 32, the first no sign")
    variable = f"HAPTICD_{kind}_DIR"
    base = os.environ.get(variable)
    if base:
        if not _is_utf8(base):
            raise ConfigError(f"{variable} = {base!r}: must be UTF-8")
        return Path(base) / instance
    unit = os.environ.get(f"{kind}_DIRECTORY", "").split(":")[0]
    if unit:
        return Path(unit) if Path(unit).name == instance else Path(unit) / instance
    return None


def home_directory(instead: str) -> Path:
    """The home directory of this user.

    Args:
        instead: names of the variables that would do as well, for people.

    Raises:
        ConfigError: it has none, as in a container that runs it under a number only.
    """
    try:
        return Path.home()
    except RuntimeError:
        raise ConfigError(f"user {os.geteuid()} has no home directory: set {instead}") from None


def _is_utf8(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _in_the_way(path: Path) -> InstanceError:
    return InstanceError(f"{path}: what lies there is no file of a daemon; remove it")


def _named(instance: str) -> tuple[str, str]:
    """Whose daemon is meant, "" for either, and its name."""
    whose, slash, plain = instance.partition("/")
    return (whose, plain) if slash and whose in _WHOSE else ("", instance)


def _is_foreign(directory: Path) -> bool:
    place = _temporary()
    return directory.is_relative_to(place) and place.exists() and not _ours(place)


def _foreign(directory: Path) -> InstanceError:
    return InstanceError(f"{directory}: belongs to somebody else; set HAPTICD_RUNTIME_DIR to one of yours")


def _user_runtime(instance: str) -> Path:
    session = os.environ.get("XDG_RUNTIME_DIR")
    if session:
        return Path(session) / "hapticd" / instance
    return _temporary() / instance


def _temporary() -> Path:
    return Path("/tmp") / f"hapticd-{os.geteuid()}"


def _ours(directory: Path) -> bool:
    status = directory.lstat()
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.geteuid()


_STATE = Path("/var/lib/hapticd")
_FAULTS = "faults"


def state_directory(instance: str) -> Path:
    """Directory in which a daemon of this user keeps what is to outlive it.

    $HAPTICD_STATE_DIR/<instance>, else systemd's $STATE_DIRECTORY, else /var/lib/hapticd/<instance> for root,
    else $XDG_STATE_HOME/hapticd/<instance>, which is ~/.local/state/hapticd/<instance> where that is not set.

    Raises:
        ConfigError: the instance's name is none that a directory could have.
    """
    given = named_directory("STATE", instance)
    if given is not None:
        return given
    return _STATE / instance if os.geteuid() == 0 else _user_state(instance)


def fault_directory(instance: str) -> Path:
    """Directory in which a daemon of this user keeps the fault records of an instance, below its state directory.

    Raises:
        ConfigError: the instance's name is none that a directory could have.
    """
    return state_directory(instance) / _FAULTS


def hold_file(instance: str) -> Path:
    """File that is there while a device was let go and not armed since; see `hapticd.supervisor.arm_hold`.

    Raises:
        ConfigError: the instance's name is none that a directory could have.
    """
    return state_directory(instance) / "disarmed"


def fault_directories(instance: str) -> list[Path]:
    """Where to look for the fault records of an instance: the system's daemon, and this user's own.

    Raises:
        ConfigError: the instance's name is none that a directory could have.
    """
    given = named_directory("STATE", instance)
    if given is not None:
        return [given / _FAULTS]
    return [_STATE / instance / _FAULTS, _user_state(instance) / _FAULTS]


def _user_state(instance: str) -> Path:
    home = os.environ.get("XDG_STATE_HOME") or home_directory("HOME or HAPTICD_STATE_DIR") / ".local/state"
    return Path(home) / "hapticd" / instance
