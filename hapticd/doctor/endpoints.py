"""Where the daemon meets others: its directory, the other instance that may run, its sockets, its disk."""

from __future__ import annotations

import errno
import os
import re
import shutil
import socket
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import urlsplit

from hapticd.doctor.finding import Finding, advice, ok, own_command, problem
from hapticd.doctor.tree import ROOT, read, read_if_there
from hapticd.errors import ConfigError
from hapticd.keys.policy import stays_here, takes_keys
from hapticd.keys.store import KeyDirectory
from hapticd.paths import CONTROL, TELEMETRY

LSL_PORTS = range(16572, 16605)
"""Where liblsl offers streams, as it comes."""

_LISTENS = "0A"  # in /proc/net/tcp
_LONGEST_SOCKET = 107
_ENOUGH = 500 * 2**20
_TOO_LITTLE = 20 * 2**20


def running(directory: Path, root: Path = ROOT) -> int:
    """Process that runs the instance, 0 when none does; asks the kernel and takes no lock itself.

    Args:
        directory: the instance's runtime directory.
        root: the file system of /proc.

    Raises:
        OSError: this user may not look.
    """
    lock = directory / "lock"
    try:
        inode = lock.stat().st_ino
    except (FileNotFoundError, NotADirectoryError):
        return 0
    held = re.compile(rf"FLOCK\s+ADVISORY\s+WRITE\s+(-?\d+)\s+[0-9a-f]+:[0-9a-f]+:{inode}\s")
    holder = held.search(read(root / "proc/locks"))
    if holder is None:
        return 0
    said = read_if_there(lock)
    return int(said) if said.isdecimal() else max(1, int(holder[1]))


def instance(name: str, processes: Mapping[Path, int]) -> Finding:
    """Whether the instance runs, and whether it is the only one of its name.

    Args:
        name: of the instance.
        processes: which run it, by their runtime directories: the system's, and this user's own.
    """
    if len(processes) > 1:
        each = " and ".join(f"process {process} in {directory}" for directory, process in processes.items())
        return advice(
            f"two daemons run as {name!r}, {each}: commands must say which",
            f"# --instance system/{name} or --instance user/{name}",
        )
    return ok(f"{name!r} runs, process {next(iter(processes.values()))}" if processes else f"{name!r} does not run")


def runtime(directory: Path) -> Finding:
    """Whether the instance's directory can be used, or made.

    Args:
        directory: where the instance keeps lock and sockets.
    """
    longest = max(len(os.fsencode(directory / name)) for name in (TELEMETRY, CONTROL))
    if longest > _LONGEST_SOCKET:
        return problem(
            f"{directory}: too long a path for a socket, {longest} of at most {_LONGEST_SOCKET} characters",
            f"export HAPTICD_RUNTIME_DIR=/tmp/hapticd-{os.geteuid()}",
        )
    place = _nearest(directory)
    if not place.is_dir() or not os.access(place, os.W_OK | os.X_OK):
        why = "this user may not write there" if place.is_dir() else f"{place} is no directory"
        return problem(f"{directory}: {why}", f"export HAPTICD_RUNTIME_DIR=/tmp/hapticd-{os.geteuid()}")
    return ok(str(directory) if place == directory else f"{directory}, made when the daemon starts")


def tcp(endpoints: Mapping[str, str], process: int) -> list[Finding]:
    """Whether the TCP endpoints are free.

    Args:
        endpoints: of the configuration, such as tcp://127.0.0.1:9872, by the key that names them.
        process: which runs the instance, 0 when none does.
    """
    return [_free(name, endpoint, process) for name, endpoint in endpoints.items()] or [
        ok("no TCP endpoint is configured")
    ]


def keys(endpoints: Mapping[str, str], directory: KeyDirectory) -> Finding:
    """Who may come in from other computers.

    Args:
        endpoints: of the configuration, by the key that names them.
        directory: where this user's daemons have their keys.
    """
    guarded = [endpoint for name, endpoint in endpoints.items() if takes_keys(name, endpoint)]
    if not guarded:
        return ok("nothing is open to other computers")
    opened = " and ".join(guarded)
    try:
        pair, clients = directory.pair(), directory.clients()
    except ConfigError as error:
        return problem(str(error), f"# {opened} cannot be opened before that is mended")
    if pair is None:
        return problem(f"{opened}: takes keys, and there are none in {directory.path}", own_command("keys", "make"))
    if not clients:
        return advice(
            f"{opened}: open, but no client is listed in {directory.path}", own_command("keys", "make", "NAME")
        )
    listed = ", ".join(f"{name} (may only watch)" if key.watch_only else name for name, key in clients.items())
    reach = (f"{endpoint} from {'this' if stays_here(endpoint) else 'every'} computer" for endpoint in guarded)
    return ok(f"open to these keys: {listed}; {' and '.join(reach)}")


def streams(root: Path = ROOT) -> Finding:
    """Whether Lab Streaming Layer, as `hapticd lsl` uses it, lets every computer read what is measured here.

    Args:
        root: the file system of /proc.

    Raises:
        OSError: this user may not look.
    """
    listening = sorted({port for port in _open_to_all(root) if port in LSL_PORTS})
    if not listening:
        return ok("no Lab Streaming Layer stream is open to other computers")
    first, last = LSL_PORTS[0], LSL_PORTS[-1]
    return advice(
        f"Lab Streaming Layer listens on every address, unencrypted, port {', '.join(map(str, listening))}: any "
        "program that reaches this computer can read its streams, and liblsl has no setting against that",
        f"sudo ss -ltnp 'sport >= :{first} and sport <= :{last}'  # whose; end it, or keep others out with a firewall",
    )


def state(directory: Path) -> Finding:
    """Whether fault records can be written to the state directory, and its disk has room for them.

    Args:
        directory: where the instance keeps them.
    """
    place = _nearest(directory)
    if not place.is_dir() or not os.access(place, os.W_OK | os.X_OK):
        why = "this user may not write there" if place.is_dir() else f"{place} is no directory"
        return problem(f"{directory}: {why}, no fault could be recorded", "export HAPTICD_STATE_DIR=~/hapticd")
    free = shutil.disk_usage(place).free
    shown = f"{directory}: {free / 2**30:.3g} GiB free"
    largest = f"sudo du -xh -d 3 {_mount_of(place)} | sort -h | tail  # the largest directories: make room"
    if free < _TOO_LITTLE:
        return problem(f"{directory}: {free / 2**20:.3g} MiB free, no fault could be recorded", largest)
    return advice(shown, largest) if free < _ENOUGH else ok(shown)


def _free(name: str, endpoint: str, process: int) -> Finding:
    parts = urlsplit(endpoint)
    host, port = (parts.hostname or "").replace("*", ""), parts.port or 0  # `*` is every address
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind((host, port))
        except OSError as error:
            return _taken(name, endpoint, port, error, process)
    return ok(f"{endpoint} is free")


def _taken(name: str, endpoint: str, port: int, error: OSError, process: int) -> Finding:
    if error.errno == errno.EADDRINUSE and process:
        return ok(f"{endpoint} is in use, by the running daemon as it seems")
    if error.errno == errno.EADDRINUSE:
        return problem(
            f"{endpoint} is taken by another program",
            f"sudo ss -ltnp 'sport = :{port}'  # which one; or choose another {name}",
        )
    if error.errno == errno.EACCES:
        return problem(f"{endpoint}: {error.strerror}", f"# in the configuration, {name}: a port of 1024 or more")
    return problem(f"{endpoint}: {error.strerror}", "ip address show  # an interface must have this address")


def _open_to_all(root: Path) -> list[int]:
    """Ports on which some program listens for every address."""
    found = []
    for table in ("tcp", "tcp6"):
        for line in read_if_there(root / "proc/net" / table).splitlines()[1:]:
            _, local, _, state, *_ = line.split()
            address, _, port = local.rpartition(":")
            if state == _LISTENS and not address.strip("0"):
                found.append(int(port, 16))
    return found


def _nearest(directory: Path) -> Path:
    """The directory, or what is there of the path to it."""
    place = directory
    while not place.exists() and place != place.parent:
        place = place.parent
    return place


def _mount_of(place: Path) -> Path:
    while not place.is_mount() and place != place.parent:
        place = place.parent
    return place
