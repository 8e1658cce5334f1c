"""The manual page hapticd(1), made of what the commands say with --help, and what is installed beside it."""

from __future__ import annotations

import gzip
import inspect
import textwrap
from collections.abc import Iterator
from importlib.metadata import entry_points
from typing import Any, Final

import typer

from hapticd.cli.app import COMMANDS, GROUP, application
from hapticd.cli.completion import Shell, script
from hapticd.paths import directory
from hapticd.version import __version__

_DISTRIBUTION: Final = "hapticd"
_RELEASED: Final = "2026-11-22"  # of the version, as the changelog says
_WIDTH = 70  # of the source, before what is escaped in it

_END: Final = r"""
.SH EXIT STATUS
0: fine. 1: failed while it ran. 2: misused, or a configuration that cannot be used.
.SH ENVIRONMENT
.TP
.B HAPTICD_RUNTIME_DIR
Where instances keep their sockets, instead of /run/hapticd or $XDG_RUNTIME_DIR/hapticd.
.TP
.B HAPTICD_STATE_DIR
Where they keep fault records, instead of /var/lib/hapticd or $XDG_STATE_HOME/hapticd.
.TP
.B HAPTICD_KEYS
The key file of a client that reaches a daemon on another computer.
.SH FILES
.TP
.I /etc/hapticd/hapticd.toml
Configuration of the system's service, hapticd.service;
.I /etc/hapticd/NAME.toml
is that of hapticd@NAME.service.
.TP
.I /run/hapticd/NAME/
Sockets of an instance: telemetry, control.
.TP
.I /var/lib/hapticd/NAME/faults/
Its fault records.
.SH SEE ALSO
.BR systemctl (1),
.BR journalctl (1)
"""


def shared_files(zsh: str) -> dict[str, bytes]:
    """What belongs below a prefix's `share`: the manual, what shells complete with, the dashboard for Grafana.

    Args:
        zsh: the directory below `zsh` in which it looks.
    """
    return {
        "man/man1/hapticd.1.gz": gzip.compress(manual().encode(), 9, mtime=0),
        "bash-completion/completions/hapticd": script(Shell.BASH).encode(),
        f"zsh/{zsh}/_hapticd": script(Shell.ZSH).encode(),
        "fish/vendor_completions.d/hapticd.fish": script(Shell.FISH).encode(),
        "hapticd/grafana-dashboard.json": (directory("config") / "grafana/hapticd.json").read_bytes(),
    }


def manual() -> str:
    """The page, for man(1)."""
    whole: Any = typer.main.get_command(application())
    lines = [
        f'.TH HAPTICD 1 {_RELEASED} "hapticd {__version__}" "User Commands"',
        ".SH NAME",
        r"hapticd \- owner of a kinesthetic haptic device",
        ".SH SYNOPSIS",
        ".B hapticd",
        r"[\fB\-\-version\fR] [\fB\-\-help\fR] \fICOMMAND\fR ...",
        ".SH DESCRIPTION",
        *_paragraphs(whole.help),
        ".SH COMMANDS",
    ]
    context = whole.make_context("hapticd", [], resilient_parsing=True)
    ours = {point.name for point in entry_points(group=GROUP) if point.dist and point.dist.name == _DISTRIBUTION}
    for name in [*COMMANDS, *sorted(ours)]:
        loaded: Any = typer.main.get_command(application(name))
        lines += _section(loaded.commands[name], name, context)
    return "\n".join(lines) + _END


def _section(command: Any, name: str, parent: Any) -> Iterator[str]:
    """What a command says of itself, and after it each of its own commands."""
    context = command.make_context(name, [], parent=parent, resilient_parsing=True)
    yield f".SS {_plain(f'{context.command_path} {_usage(command, context)}').strip()}"
    yield from _paragraphs(command.help or "")
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if record is not None and "--help" not in parameter.opts:
            yield ".TP"
            yield rf"\fB{_plain(record[0])}\fR"
            yield from _lines(record[1]) if record[1] else [r"\&"]
    if command.epilog:
        yield ".PP"
        yield from _paragraphs(command.epilog)
    for below in getattr(command, "commands", ()):
        _, loaded, _ = command.resolve_command(context, [below])
        yield from _section(loaded, below, context)


def _usage(command: Any, context: Any) -> str:
    return " ".join(command.collect_usage_pieces(context))


def _paragraphs(text: str) -> Iterator[str]:
    """Paragraphs with space between them; a heading stands before the first."""
    for number, paragraph in enumerate(filter(None, inspect.cleandoc(text).split("\n\n"))):
        if number:
            yield ".PP"
        yield from _lines(paragraph)


def _lines(text: str) -> list[str]:
    return [_plain(line) for line in textwrap.wrap(text, _WIDTH, break_long_words=False, break_on_hyphens=False)]


def _plain(text: str) -> str:
    """Text that roff sets as it is."""
    text = text.replace("\\", r"\e").replace("-", r"\-").replace("'", r"\(aq").replace("`", r"\(ga")
    return rf"\&{text}" if text.startswith(".") else text
