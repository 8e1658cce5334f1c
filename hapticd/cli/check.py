"""`hapticd check`: whether configuration files can be used, with every problem of each."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from hapticd.config.loading import LoadedConfig, load
from hapticd.errors import ConfigError, DriverError
from hapticd.keys.policy import key_ring
from hapticd.offline.model_choice import fit
from hapticd.offline.rehearsal import Rehearsal
from hapticd.simulation.driver import SimulatedDriver
from hapticd.simulation.options import SimulationOptions


def check(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Configuration files.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON array, an object a file.")] = False,
) -> None:
    """Say whether configuration files can be used.

    Prints one line a file that can, and every problem of a file that cannot. Exits with 2 when there was a problem.
    Touches no device and no running daemon.

    Example: hapticd check /etc/hapticd/hapticd.toml
    """
    verdicts = []
    problems: list[str] = []
    for file in files:
        verdict: dict[str, object] = {"file": str(file), "ok": True, "problems": []}
        try:
            loaded = load(file)
            key_ring(loaded)
            found = fit(loaded)
            _put_together(loaded)
        except ConfigError as error:
            verdict |= {"ok": False, "problems": error.problems}
            problems += error.problems
        else:
            device, law, rate_hz = loaded.config.device.driver, loaded.config.controller.law, loaded.config.loop.rate_hz
            verdict |= {"hash": loaded.hash, "sha256": loaded.sha256, "driver": device, "law": law, "rate_hz": rate_hz}
            if found is not None:
                verdict["accuracy"] = found.reason
            if not as_json:
                typer.echo(f"{file}: ok, {loaded.hash}, {device} with {law} at {rate_hz:g} Hz")
            if found is not None and not as_json:
                typer.echo(f"{file}: device.options.accuracy: {found.reason}")
        verdicts.append(verdict)
    if as_json:
        typer.echo(json.dumps(verdicts, indent=2))
    for problem in [] if as_json else problems:
        typer.echo(problem, err=True)
    if problems:
        raise typer.Exit(ConfigError.exit_code)


def _put_together(loaded: LoadedConfig) -> None:
    """Make the tick on a simulated device; a real one says only when it is open what axes and limits it has.

    Raises:
        ConfigError: the scene or the limits do not fit the device, or its driver fails.
    """
    options = loaded.options
    if (
        isinstance(options, SimulationOptions)
        and issubclass(loaded.driver, SimulatedDriver)
        and options.clock == "ticks"
    ):
        try:
            Rehearsal(loaded)
        except DriverError as error:
            raise ConfigError(f"{loaded.path}: {error}") from error
