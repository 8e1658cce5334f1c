"""`hapticd completion`: what a shell needs to complete the words of a command line."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Annotated, Final

import typer

VARIABLE: Final = "_HAPTICD_COMPLETE"
"""Set by the shell's script when it asks for completions instead of running a command."""


class Shell(StrEnum):
    """A shell that completes."""

    BASH = "bash"
    ZSH = "zsh"
    FISH = "fish"


def completion(shell: Annotated[Shell, typer.Argument(metavar="SHELL", help="bash, zsh or fish.")]) -> None:
    """Print what a shell needs to complete command lines.

    Commands, options, laws, names of daemons. An installed service has put it where shells look already. Else:

    bash: source <(hapticd completion bash), in ~/.bashrc

    zsh: source <(hapticd completion zsh), in ~/.zshrc after compinit

    fish: hapticd completion fish > ~/.config/fish/completions/hapticd.fish

    Example: hapticd completion fish
    """
    typer.echo(script(shell), nl=False)


def script(shell: Shell) -> str:
    """The script of a shell."""
    from typer.completion import get_completion_script  # type: ignore[attr-defined]  # documented, and not listed

    text = f"{get_completion_script(prog_name='hapticd', complete_var=VARIABLE, shell=shell)}\n"
    if shell is Shell.ZSH:  # which loads it at the first use, and then that one waits for an answer as well
        text += '\n[[ $funcstack[1] != _hapticd ]] || _hapticd_completion "$@"\n'
    return text


def ready() -> None:
    """Let typer know what the shells ask, which it does by itself only for programs that install their own scripts."""
    from typer.completion import get_completion_inspect_parameters

    get_completion_inspect_parameters()


def words(arguments: Sequence[str], environment: Mapping[str, str] = os.environ) -> list[str]:
    """The words of a command line that stand: its arguments, or while one is completed those before it."""
    if VARIABLE not in environment:
        return list(arguments)
    if "COMP_WORDS" in environment:  # bash
        return _split(environment["COMP_WORDS"])[1 : int(environment.get("COMP_CWORD", "1"))]
    typed = environment.get("_TYPER_COMPLETE_ARGS", "")
    return _split(typed)[1 : None if typed.endswith(" ") else -1]


def laws(incomplete: str) -> list[str]:
    """Installed laws that begin so."""
    from hapticd.plugins import CONTROLLERS, names

    return [name for name in names(CONTROLLERS) if name.startswith(incomplete)]


def instances(incomplete: str) -> list[str]:
    """Living daemons whose names begin so, with and without whose they are."""
    from hapticd.paths import living_instances

    living = living_instances()
    return sorted(
        {name for one in living for name in (one, one.partition("/")[2] or one) if name.startswith(incomplete)}
    )


def _split(line: str) -> list[str]:
    try:
        return shlex.split(line)
    except ValueError:  # a quotation mark that is not closed yet
        return line.split()
