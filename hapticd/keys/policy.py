"""Which of a configuration's endpoints take keys, and those keys."""

from __future__ import annotations

import ipaddress
from urllib.parse import urlsplit

from hapticd.config.loading import LoadedConfig
from hapticd.config.models import Config
from hapticd.errors import ConfigError
from hapticd.keys.store import KeyDirectory, KeyRing, key_directory


def stays_here(endpoint: str) -> bool:
    """Whether only this computer reaches a TCP endpoint."""
    host = urlsplit(endpoint).hostname or ""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:  # a wildcard or an interface
        return False


def tcp_endpoints(config: Config) -> dict[str, str]:
    """The endpoints that a configuration opens, by the key that names them in the file."""
    named = {"telemetry.tcp": config.telemetry.tcp, "control.tcp": config.control.tcp}
    if config.scene.couplings or config.scene.forces or any(each.remote for each in config.scene.objects):
        named |= {"remote.scene_tcp": config.remote.scene_tcp, "remote.state_tcp": config.remote.state_tcp}
    return {name: endpoint for name, endpoint in named.items() if endpoint is not None}


def takes_keys(name: str, endpoint: str) -> bool:
    """Whether a TCP endpoint admits listed keys only.

    Measurements leave this computer with keys only; what drives a device takes them on this computer too, since every
    program of every user reaches a port.

    Args:
        name: of the key in the file, such as `telemetry.tcp`.
        endpoint: its address.
    """
    return name != "telemetry.tcp" or not stays_here(endpoint)


def key_ring(loaded: LoadedConfig) -> KeyRing | None:
    """The keys that a configuration takes; None when it takes none.

    Raises:
        ConfigError: it takes keys and there are none, or they cannot be used.
    """
    guarded = {name: endpoint for name, endpoint in tcp_endpoints(loaded.config).items() if takes_keys(name, endpoint)}
    if not guarded:
        return None
    keys = KeyDirectory(key_directory())
    pair = keys.pair()
    if pair is None:
        raise ConfigError(
            *(
                f'{loaded.path}: {name} = "{endpoint}": takes keys, and there are none in {keys.path}: '
                "make them with `hapticd keys make`, as the user that the daemon runs as or with sudo"
                for name, endpoint in guarded.items()
            )
        )
    return KeyRing(pair, keys.clients())
