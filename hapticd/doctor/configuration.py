"""The configuration: usable or not, and what the other checks need of it even when it is not."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from hapticd.config.file import read, table_of
from hapticd.config.loading import LoadedConfig, load
from hapticd.config.models import Config, LoopConfig
from hapticd.config.plugin_tables import DeviceConfig
from hapticd.doctor.finding import Finding, ok, problem
from hapticd.errors import ConfigError
from hapticd.keys.policy import tcp_endpoints
from hapticd.paths import directory


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a configuration file asks of this computer.

    Attributes:
        path: the file.
        loop: its loop, by default where the file is no help.
        driver: its driver.
        tcp: its TCP endpoints, by the key that names them.
        loaded: the file, None when it cannot be used.
        problems: why not, a line each.
    """

    path: Path
    loop: LoopConfig
    driver: str
    tcp: dict[str, str]
    loaded: LoadedConfig | None = None
    problems: tuple[str, ...] = ()

    @classmethod
    def of(cls, path: Path) -> Wanted:
        """Read a file; one that cannot be used still says what it can."""
        try:
            loaded = load(path)
        except ConfigError as error:
            return cls(path, *_salvaged(path), problems=error.problems)
        config = loaded.config
        return cls(path, config.loop, config.device.driver, tcp_endpoints(config), loaded)


def usable(wanted: Wanted) -> list[Finding]:
    """Whether the file can be used, as `hapticd check` says it."""
    if wanted.loaded is None and not wanted.path.exists():
        return [problem(line, f"cp {directory('config') / 'hapticd.toml'} {wanted.path}") for line in wanted.problems]
    if wanted.loaded is None:
        # The first line that is mended may mend the next.
        return [problem(line, f"${{EDITOR:-vi}} {wanted.path}") for line in wanted.problems]
    law = wanted.loaded.config.controller.law
    rate_hz = wanted.loop.rate_hz
    return [ok(f"{wanted.path}: ok, {wanted.loaded.hash}, {wanted.driver} with {law} at {rate_hz:g} Hz")]


def _salvaged(path: Path) -> tuple[LoopConfig, str, dict[str, str]]:
    """Loop, driver and endpoints of a file that cannot be used as a whole; defaults where it is no help."""
    loop, device = LoopConfig(), DeviceConfig()
    remote = Config()
    tables = {}
    with contextlib.suppress(ConfigError, ValueError, RecursionError):
        # A pipe has said all that it says when it was read the first time, and a second reader might wait for ever.
        data = table_of(read(path, files_only=True))
        tables = {name: table for name, table in data.items() if isinstance(table, dict)}
    with contextlib.suppress(ValidationError):
        loop = LoopConfig.model_validate(tables.get("loop", {}))
    with contextlib.suppress(ValidationError):
        device = DeviceConfig.model_validate({"driver": tables.get("device", {}).get("driver", device.driver)})
    with contextlib.suppress(ValidationError):
        remote = Config.model_validate({name: tables.get(name, {}) for name in ("telemetry", "control")})
    return loop, device.driver, tcp_endpoints(remote)
