"""Key files, in the certificate format of ZeroMQ's own tools, such as pyzmq's `zmq.auth` and CZMQ's `zcert`.

    metadata
        server-key = "..."
    curve
        public-key = "..."
        secret-key = "..."

A key is 32 bytes, written as 40 characters of Z85 (ZeroMQ RFC 32).
"""

from __future__ import annotations

import contextlib
import os
import re
import stat
import struct
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import zmq
from zmq.utils import z85

from hapticd.errors import ConfigError, HapticdError
from hapticd.replacing import put

_LARGEST_FILE = 1 << 14
_ENTRY = re.compile(r"\s*([a-z-]+)\s*=\s*[\"']?(.*?)[\"']?\s*")


class KeyWriteError(HapticdError):
    """A key file that cannot be written, or that is there already."""


@dataclass(frozen=True, slots=True)
class Key:
    """What a key file says.

    Attributes:
        public: the public key.
        secret: the secret key of the same pair, empty in a public file.
        server: the public key of the daemon that this client connects to, empty where there is none.
        watch_only: its owner may subscribe and not command.
    """

    public: str
    secret: str = field(default="", repr=False)
    server: str = ""
    watch_only: bool = False


def new_pair(server: str = "") -> Key:
    """A fresh pair, whose public key no shell takes for an option.

    Args:
        server: the public key of the daemon that it is meant for.
    """
    while True:
        public, secret = (part.decode() for part in zmq.curve_keypair())
        if not public.startswith("-"):
            return Key(public, secret, server)


def is_key(text: str) -> bool:
    """Whether a text is a key."""
    try:
        return len(text) == 40 and len(z85.decode(text.encode("ascii"))) == 32
    except (ValueError, KeyError, struct.error):  # no Z85, or five characters of it that are more than 32 bits
        return False


def read(path: Path) -> Key:
    """Read a key file.

    Raises:
        ConfigError: it is not there, is none, or others may read its secret; the message names it.
    """
    found = filter(None, map(_ENTRY.fullmatch, _text(path).splitlines()))
    entries = {entry[1]: entry[2] for entry in found}
    for name in ("public-key", "secret-key", "server-key"):
        if name in entries and not is_key(entries[name]):
            raise ConfigError(f"{path}: {name} is no key: 40 characters of Z85, as `hapticd keys make` writes them")
    if "public-key" not in entries:
        raise ConfigError(f"{path}: no public-key in it, so it is no key file; `hapticd keys make` writes one")
    public, secret = entries["public-key"], entries.get("secret-key", "")
    if secret and zmq.curve_public(secret.encode()).decode() != public:
        raise ConfigError(f"{path}: public-key and secret-key do not belong together; make a new pair")
    if secret and path.stat().st_mode & 0o007:
        raise ConfigError(f"{path}: everybody may read this secret key: chmod o= {path}, and better make a new pair")
    rights = entries.get("rights", "command")
    if rights not in ("command", "watch"):
        raise ConfigError(f'{path}: rights = {rights[:40]!r}: must be "command" or "watch"')
    return Key(public, secret, entries.get("server-key", ""), rights == "watch")


def write(path: Path, key: Key, *, mode: int = 0o600, group: int = -1, replace: bool = False) -> None:
    """Write a key file, whole or not at all, and never readable by others than `mode` says.

    Args:
        path: where.
        key: what to write.
        mode: its permissions.
        group: its group, -1 for the user's own.
        replace: whether it may take the place of another.

    Raises:
        KeyWriteError: it is there already, or cannot be written.
    """
    with written(path, key, mode=mode, group=group, replace=replace):
        pass


@contextlib.contextmanager
def written(path: Path, key: Key, *, mode: int = 0o600, group: int = -1, replace: bool = False) -> Iterator[None]:
    """Write a key file around a block: it takes its place when the block succeeds, else nothing is left of it.

    Raises:
        KeyWriteError: it is there already, or cannot be written.
    """
    with _told(path):
        if not replace and os.path.lexists(path):
            raise FileExistsError
        descriptor, unfinished = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with _told(path), os.fdopen(descriptor, "w", encoding="ascii") as file:
            file.write(_certificate(key))
            os.fchown(descriptor, -1, group)
            os.fchmod(descriptor, mode)
            file.flush()
            os.fsync(descriptor)
        yield
        with _told(path):
            if replace:
                put(Path(unfinished), path)
            else:
                path.hardlink_to(unfinished)  # unlike a rename, refuses to take the place of another
    finally:
        with contextlib.suppress(FileNotFoundError):
            Path(unfinished).unlink()


@contextlib.contextmanager
def _told(path: Path) -> Iterator[None]:
    """Errors of the system, as errors of a key file."""
    try:
        yield
    except FileExistsError:
        raise KeyWriteError(f"{path}: is there already; --force puts a new one in its place") from None
    except OSError as error:
        advice = "; try sudo" if isinstance(error, PermissionError) else ""
        raise KeyWriteError(f"{path}: {error.strerror}{advice}") from error


def _text(path: Path) -> str:
    try:
        # Anything but a regular file could make the reader wait for ever.
        if not stat.S_ISREG(path.stat().st_mode):
            raise ConfigError(f"{path}: is no regular file, so it is no key file")
        with path.open("rb") as file:
            raw = file.read(_LARGEST_FILE + 1)
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except PermissionError:
        raise ConfigError(f"{path}: this user may not read it") from None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    try:
        text = raw.decode("ascii")
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: is no text, so it is no key file") from None
    if len(raw) > _LARGEST_FILE:
        raise ConfigError(f"{path}: is larger than 16 KiB, so it is no key file")
    return text


def _certificate(key: Key) -> str:
    metadata = f'    server-key = "{key.server}"\n' * bool(key.server) + '    rights = "watch"\n' * key.watch_only
    secret = f'    secret-key = "{key.secret}"\n' * bool(key.secret)
    what = "secret key: who has this file is who it names" if key.secret else "public key"
    return f'# hapticd {what}\nmetadata\n{metadata}curve\n    public-key = "{key.public}"\n{secret}'
