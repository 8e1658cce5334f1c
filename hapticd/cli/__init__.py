"""The `hapticd` command: one thin module a command, imported only when that command is wanted."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Sequence
from typing import Any, Final

import typer

from hapticd import __version__
from hapticd.contracts.errors import HapticdError

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


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command line, `sys.argv` by default, and exit with its status; errors are lines, not tracebacks."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        status = _run(given)
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader has left, as in `hapticd check | head`; the interpreter must not try to flush once more.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = 1
    sys.exit(status)


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


def _run(arguments: list[str]) -> int:
    try:
        wanted = next((argument for argument in arguments if not argument.startswith("-")), None)
        command = typer.main.get_command(application(wanted))
        status = command.main(arguments, prog_name="hapticd", standalone_mode=False)
        return status if isinstance(status, int) else 0
    except HapticdError as error:
        return _complain(str(error), error.exit_code)
    except typer.TyperException as error:
        return _complain(_usage(error), error.exit_code)
    except KeyboardInterrupt:
        return 130
    except (typer.Abort, EOFError):
        return _complain("nothing done", 1)
    except BrokenPipeError:
        raise
    except Exception as error:  # a defect of ours; whoever debugs it sets HAPTICD_DEBUG
        if os.environ.get("HAPTICD_DEBUG") == "1":
            raise
        report = "please report it, with what HAPTICD_DEBUG=1 makes of the same command"
        return _complain(f"defect: {type(error).__name__}: {error}\n  {report}", 1)


def _usage(error: typer.TyperException) -> str:
    context: Any = getattr(error, "ctx", None)
    path = context.command_path if context else "hapticd"
    return f"{error.format_message()}\n  see {path} --help"


def _complain(message: str, status: int) -> int:
    """Print an error; lines that belong to the one before are indented and carry no prefix."""
    for line in message.splitlines():
        print(line if line.startswith(" ") else f"hapticd: {line}", file=sys.stderr)  # noqa: T201 - errors of a command
    return status
