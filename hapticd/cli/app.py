"""The overview of all commands; the module of one of them is imported only when that one is wanted.

Commands of other distributions, and the studies and benchmarks of this one, are found through the entry-point group
`hapticd.commands`: a name, and behind it a `typer.Typer` for a group of commands or a function for one.
"""

from __future__ import annotations

import importlib
from importlib.metadata import EntryPoint, entry_points
from typing import ClassVar, Final

import typer

from hapticd.cli.group import EXIT_MISUSED, Overview
from hapticd.errors import in_words
from hapticd.version import __version__

COMMANDS: Final = {
    "run": ("run", "Run the daemon in the foreground until it is interrupted."),
    "check": ("check", "Say whether configuration files can be used."),
    "config": ("config", "Describe the configuration file, or show one in full."),
    "doctor": ("doctor", "Say what keeps this computer from running a good loop."),
    "devices": ("devices", "List the devices that the installed drivers find."),
    "controllers": ("plugins", "List the installed laws and their parameters."),
    "status": ("status", "Say how every daemon of this computer is."),
    "metrics": ("metrics.command", "Print what every daemon says of itself, for Prometheus."),
    "watch": ("watch.command", "Show live what a running daemon measures."),
    "arm": ("remote", "Let a running daemon apply forces."),
    "disarm": ("remote", "Ramp the force of a running daemon to zero."),
    "calibrate": ("remote", "Calibrate a running daemon's device, which moves its arm."),
    "tare": ("remote", "Take the present position as the scene's origin."),
    "clear": ("remote", "Clear the fault that stopped a running daemon."),
    "mark": ("remote", "Put a marker into a running daemon's event stream."),
    "reload": ("remote", "Let a running daemon take its edited file over."),
    "stop": ("remote", "Ramp the force of a running daemon to zero and end it."),
    "switch": ("switch", "Put another law into the file, and into force."),
    "fault": ("fault", "List, show or export the records of faults."),
    "keys": ("keys", "Say who may reach this computer's daemons from another one."),
    "service": ("service", "Install, show or remove the system service."),
    "completion": ("completion", "Print what a shell needs to complete command lines."),
    "simulate": ("simulate", "Run a configuration offline on the simulated device."),
}
"""Every command with its module below `hapticd.cli` and its line in the overview.

The module has a function of the command's name, or `app` when the command has commands of its own.
"""

GROUP = "hapticd.commands"

_ACT: Final = ("remote", "run", "switch")
"""Modules of the commands that act on a daemon, which are suggested for a slip of the fingers only: `stpo`."""

_NEVER = 2.0


class _Commands(Overview):
    # `validate` is none of ours, and calibrate moves the arm.
    ALIKE: ClassVar = {name: 0.75 for name, (place, _) in COMMANDS.items() if place in _ACT} | dict.fromkeys(
        ("arm", "calibrate"), _NEVER
    )


def application(wanted: str | None = None) -> typer.Typer:
    """The whole command line, with the module of one command imported and the others only listed.

    Args:
        wanted: the command that is going to run.
    """
    app = typer.Typer(
        name="hapticd",
        cls=_Commands,
        context_settings={"help_option_names": ["-h", "--help"]},  # of every command below as well
        help="Run a haptic device: a 1 ms control loop with a stabilising law, and its measurements over ZeroMQ.",
        epilog="Example: hapticd run --config lab.toml",
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
    )
    app.callback(invoke_without_command=True)(_overview)
    for name, (place, summary) in COMMANDS.items():
        if name != wanted:
            app.command(name, help=summary)(_listed)
            continue
        module = importlib.import_module(f"hapticd.cli.{place}")
        if hasattr(module, "app"):
            app.add_typer(module.app, name=name)
        else:
            app.command(name)(getattr(module, name))
    if wanted not in COMMANDS:
        points = sorted(entry_points(group=GROUP), key=lambda point: point.name)
        known = any(wanted == point.name for point in points)
        for point in points:
            if wanted is None:
                _list_installed(app, point)
            elif wanted == point.name:
                _add_installed(app, point)
            elif not known:  # a slip, for which its name may be suggested
                app.command(point.name, hidden=True)(_listed)
    return app


def _add_installed(app: typer.Typer, point: EntryPoint) -> None:
    loaded = point.load()
    if isinstance(loaded, typer.Typer):
        app.add_typer(loaded, name=point.name)
    else:
        app.command(point.name)(loaded)


def _list_installed(app: typer.Typer, point: EntryPoint) -> None:
    """List a command of another distribution; one that cannot be imported spoils no overview."""
    try:
        _add_installed(app, point)
    except BaseException as error:  # noqa: BLE001 - a plug-in is anybody's code
        app.command(point.name, help=f"Cannot be used: {in_words(error, point.module)}")(_listed)


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
