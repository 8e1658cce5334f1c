"""The overview of all commands; the module of one of them is imported only when that one is wanted."""

from __future__ import annotations

import importlib
from typing import Final

import typer

from hapticd import __version__

COMMANDS: Final = {
    "run": "Run the daemon in the foreground until it is interrupted.",
    "check": "Say whether configuration files can be used.",
    "config": "Describe the configuration file, or show one in full.",
    "doctor": "Say what keeps this computer from running a good loop.",
    "devices": "List the devices that the installed drivers find.",
    "controllers": "List the installed laws and their parameters.",
    "watch": "Show live what a running daemon measures.",
    "arm": "Let a running daemon apply forces.",
    "disarm": "Ramp the force of a running daemon to zero.",
    "calibrate": "Calibrate a running daemon's device, which moves its arm.",
    "tare": "Take the present position as the scene's origin.",
    "clear": "Clear the fault that stopped a running daemon.",
    "reload": "Let a running daemon take its edited file over.",
    "switch": "Put another law into the file, and into force.",
    "fault": "List, show or export the records of faults.",
    "keys": "Say who may reach this computer's daemons from another one.",
    "service": "Install, show or remove the system service.",
    "simulate": "Run a configuration offline on the simulated device.",
    "study": "Put laws to the test offline, over many runs.",
    "bench": "Measure tick and simulator against a reference.",
}
"""Every command with its line in the overview. `hapticd.cli.NAME` has a function NAME, or `app` when it has its own."""

EXIT_MISUSED = 2


def application(wanted: str | None = None) -> typer.Typer:
    """The whole command line, with the module of one command imported and the others only listed.

    Args:
        wanted: the command that is going to run.
    """
    app = typer.Typer(
        name="hapticd",
        help="Run a haptic device: a 1 ms control loop with a stabilising law, and its measurements over ZeroMQ.",
        epilog="Example: hapticd run --config lab.toml",
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
    )
    app.callback(invoke_without_command=True)(_overview)
    for name, summary in COMMANDS.items():
        if name != wanted:
            app.command(name, help=summary)(_listed)
            continue
        module = importlib.import_module(f"hapticd.cli.{name}")
        if hasattr(module, "app"):
            app.add_typer(module.app, name=name)
        else:
            app.command(name)(getattr(module, name))
    return app


def _overview(
    context: typer.Context,
    version: bool = typer.Option(False, "--version", help="Print the version."),
) -> None:
    if version:
        typer.echo(f"hapticd {__version__}")
    elif context.invoked_subcommand is None:
        typer.echo(context.get_help(), err=True)
        raise typer.Exit(EXIT_MISUSED)


def _listed() -> None:
    """Stand in the overview for a command that is not going to run."""
