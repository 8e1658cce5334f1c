"""Where a computer's daemons keep their own key pair and the list of clients: a file each."""

from __future__ import annotations

import grp
import os
import re
import shlex
from dataclasses import dataclass, replace
from pathlib import Path

from hapticd.errors import ConfigError
from hapticd.keys.file import Key, KeyWriteError, new_pair, read, write
from hapticd.keys.owners import require_ours
from hapticd.paths import home_directory, make_directory

SYSTEM_KEYS = Path("/etc/hapticd/keys")
"""The system service's own."""
CLIENTS = "clients"
"""Name of the directory of listed clients."""
SECRET = ".key_secret"
"""Ending of a file with a secret key."""
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
"""What a client may be called."""

_SERVER = f"server{SECRET}"
_PUBLIC = ".key"
_GROUP = "hapticd"


@dataclass(frozen=True, slots=True)
class KeyRing:
    """The keys of a running daemon: its own pair and the listed clients.

    Attributes:
        pair: the daemon's own.
        clients: listed keys by name.
    """

    pair: Key
    clients: dict[str, Key]

    def watchers(self) -> frozenset[str]:
        """Public keys that may subscribe."""
        return frozenset(key.public for key in self.clients.values())

    def commanders(self) -> frozenset[str]:
        """Public keys that may command."""
        return frozenset(key.public for key in self.clients.values() if not key.watch_only)


def key_directory() -> Path:
    """Directory in which daemons of this user have their keys.

    $HAPTICD_KEYS_DIR, else keys/ in systemd's $CONFIGURATION_DIRECTORY, else /etc/hapticd/keys for root, else
    $XDG_CONFIG_HOME/hapticd/keys, which is ~/.config/hapticd/keys where that is not set.

    Raises:
        ConfigError: none of these is set and this user has no home directory.
    """
    given = os.environ.get("HAPTICD_KEYS_DIR")
    if given:
        return Path(given)
    unit = os.environ.get("CONFIGURATION_DIRECTORY", "").split(":")[0]
    if unit:
        return Path(unit) / "keys"
    if os.geteuid() == 0:
        return SYSTEM_KEYS
    home = os.environ.get("XDG_CONFIG_HOME") or home_directory("HOME or HAPTICD_KEYS_DIR") / ".config"
    return Path(home) / "hapticd" / "keys"


class KeyDirectory:
    """The keys of a computer's daemons.

    Args:
        path: where they lie; made when the first is written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def pair(self) -> Key | None:
        """The daemon's own pair; None when none has been made.

        Raises:
            ConfigError: it cannot be used, or others may change it.
        """
        path = self.path / _SERVER
        try:
            path.stat()
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError:
            raise self._closed(self.path) from None
        key = self._read(path)
        if not key.secret:
            raise ConfigError(f"{path}: no secret-key in it; `hapticd keys make --force` makes a new pair")
        return key

    def clients(self) -> dict[str, Key]:
        """Listed keys by name, in the order of names.

        Raises:
            ConfigError: one of them cannot be used, others may change what is listed, or two are the same.
        """
        clients: dict[str, Key] = {}
        names: dict[str, Path] = {}
        for path in self._listed():
            key = self._read(path)
            if key.public in names:
                raise ConfigError(f"{path}: the same key as {names[key.public]}; remove one of them")
            names[key.public] = path
            clients[path.stem] = key
        return clients

    def make(self, force: bool = False) -> Key:
        """Make the daemon's own pair.

        Args:
            force: also when there is one, which no client will find any more.

        Raises:
            KeyWriteError: it is there already, or cannot be written.
        """
        pair = new_pair()
        self._write(self.path / _SERVER, pair, force)
        return pair

    def add(self, name: str, key: Key, force: bool = False) -> None:
        """List a client; of its key only the public part is kept.

        Args:
            name: what to call it.
            key: its key and what it may.
            force: also when another one has that name.

        Raises:
            ConfigError: no such name can be, or the key is listed under another.
            KeyWriteError: the name is taken, or it cannot be written.
        """
        path = self._client(name)
        for other, listed in self.clients().items():
            if other != name and listed.public == key.public:
                change = f"hapticd keys add {other} {shlex.quote(key.public)} --force"
                raise ConfigError(f"{name}: that key is listed already as {other}: `{change}` changes what it may")
        self._write(path, replace(key, secret="", server=""), force)

    def remove(self, name: str) -> None:
        """Take a client from the list.

        Raises:
            ConfigError: there is none of that name.
            KeyWriteError: it cannot be removed.
        """
        listed = {path.stem: path for path in self._listed()}  # also those that `add` would not have called so
        if name not in listed:
            raise ConfigError(f"{name}: not listed; listed are: {', '.join(listed) or 'none'}")
        try:
            listed[name].unlink(missing_ok=True)
        except OSError as error:
            raise _denied(listed[name], error) from error

    def _client(self, name: str) -> Path:
        if NAME.fullmatch(name) is None:
            raise ConfigError(f"{name!r}: a client's name has letters, digits and _ . - only, at most 64")
        return self.path / CLIENTS / f"{name}{_PUBLIC}"

    def _listed(self) -> list[Path]:
        """Files of clients. A hidden one is an editor's, such as a lock; a client left out is only kept out."""
        try:
            found = (self.path / CLIENTS).iterdir()
            return sorted(path for path in found if path.suffix == _PUBLIC and not path.name.startswith("."))
        except (FileNotFoundError, NotADirectoryError):
            return []
        except OSError:
            raise self._closed(self.path / CLIENTS) from None

    def _read(self, path: Path) -> Key:
        if path.exists() and not os.access(path, os.R_OK):
            raise self._closed(path)
        key = read(path)
        require_ours(path)
        return key

    def _closed(self, path: Path) -> ConfigError:
        """The error for keys that root has not given to the service's own user."""
        whole = f"sudo chgrp -R {_GROUP} {self.path} && sudo chmod -R g+rX {self.path}"
        return ConfigError(f"{path}: this user may not read it; use sudo, or for the service: {whole}")

    def _write(self, path: Path, key: Key, force: bool) -> None:
        """Only its owner may change a key, and only the service's group may read it."""
        group = _service_group()
        try:
            for directory in (self.path, self.path / CLIENTS):
                if not directory.is_dir():
                    make_directory(directory, 0o700)
                    os.chown(directory, -1, group)
                    directory.chmod(0o700 if group < 0 else 0o750)
        except OSError as error:
            raise _denied(directory, error) from error
        write(path, key, mode=0o600 if group < 0 else 0o640, group=group, replace=force)


def _service_group() -> int:
    """Group of the system service; -1 where there is none, and for users other than root."""
    try:
        return grp.getgrnam(_GROUP).gr_gid if os.geteuid() == 0 else -1
    except KeyError:
        return -1


def _denied(path: Path, error: OSError) -> KeyWriteError:
    return KeyWriteError(f"{path}: {error.strerror}{'; try sudo' if isinstance(error, PermissionError) else ''}")
