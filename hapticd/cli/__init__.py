"""The `hapticd` command: one thin module a command, imported only when that command is wanted."""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hapticd.errors import HapticdError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import typer

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command line, `sys.argv` by default, and exit with its status; errors are lines, not tracebacks."""
    _open_streams()
    sys.exit(_run(list(sys.argv[1:] if arguments is None else arguments)))


def _run(arguments: list[str]) -> int:
    try:
        # These imports take long enough for an interrupt to come.
        import typer

        from hapticd.cli import completion
        from hapticd.cli.app import application

        if completion.VARIABLE in os.environ:
            completion.ready()
        wanted = next((word for word in completion.words(arguments) if not word.startswith("-")), None)
        command = typer.main.get_command(application(wanted))
        status = command.main(arguments, prog_name="hapticd", standalone_mode=False)
        sys.stdout.flush()
        return status if isinstance(status, int) else 0
    except KeyboardInterrupt:
        return 130
    except HapticdError as error:
        return _complain(str(error), error.exit_code)
    except typer.TyperException as error:
        return _complain(_usage(error), error.exit_code)
    except (typer.Abort, EOFError):
        return _complain("nothing done", 1)
    except BrokenPipeError:  # the reader has left, as in `hapticd check | head`
        _abandon_output()
        return 1
    except Exception as error:
        if isinstance(error, OSError) and error.errno in _FULL:
            _abandon_output()
            return _complain(f"{error.filename or 'standard output'}: {error.strerror}", 1)
        if os.environ.get("HAPTICD_DEBUG") == "1":  # a defect of ours
            raise
        report = "please report it, with what HAPTICD_DEBUG=1 makes of the same command"
        return _complain(f"defect: {type(error).__name__}: {error}\n  {report}", 1)


def _open_streams() -> None:
    """What was closed when we were started leads nowhere, else the next file or socket is taken for it."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            stream = Path(os.devnull).open(mode)  # noqa: SIM115 - stays; has the lowest free number, which is its own
            os.set_inheritable(stream.fileno(), True)
            setattr(sys, name, stream)


def _abandon_output() -> None:
    """The interpreter must not try to write what is left once more."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _usage(error: typer.TyperException) -> str:
    context: Any = getattr(error, "ctx", None)
    path = context.command_path if context else "hapticd"
    # Typer says what pydantic says, and has a line for each choice.
    message = error.format_message().replace(": Value error, ", ": ", 1).replace("\n\t", " ")
    return f"{message}\n  see {path} --help"


def _complain(message: str, status: int) -> int:
    """Print an error; lines that belong to the one before are indented and carry no prefix."""
    for line in message.splitlines():
        print(line if line.startswith(" ") else f"hapticd: {line}", file=sys.stderr)  # noqa: T201 - errors of a command
    return status
