"""Couplings and forces as text: which is in force, how it pushes, and by which message of its client."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rich.text import Text

from hapticd.cli.watch.contacts import of_ports
from hapticd.cli.watch.line import fitting
from hapticd.cli.watch.space import direction
from hapticd.client import Damping, Status, Touch

MOST_LINES = 4
"""Most couplings and forces that have a line at once."""

_QUIET = "bright_black"


def port_lines(pushes: Mapping[int, Touch], damping: Damping | None, status: Status, width: int) -> list[Text]:
    """A line for each coupling and force; where one has no room for all, it has what is felt.

    Args:
        pushes: what each did when it was last in force, by its index among what clients drive.
        damping: of all contacts.
        status: names of all.
        width: characters of a line.
    """
    lines = []
    for name, held, value in of_ports(damping, status)[:MOST_LINES]:
        push = _push(pushes, status, name) if held else None
        message = _message(push)
        choices = (("client's ", message), ("", message), ("", Text("")))
        lines.append(fitting((_line(before, name, held, push, value, last) for before, last in choices), width))
    return lines


def port_words(pushes: Mapping[int, Touch], damping: Damping | None, status: Status) -> list[str]:
    """The same in plain words, for a line that has more."""
    words = []
    for name, held, value in of_ports(damping, status):
        push = _push(pushes, status, name) if held else None
        newton = f" {math.hypot(*push.force_n):.2f} N" if push is not None else ""
        words.append(f"{name} {'held' if held else 'let go'}{newton} damping {value:.1f} N s/m")
    return words


def _line(before: str, name: str, held: bool, push: Touch | None, damping_n_s_per_m: float, message: Text) -> Text:
    line = Text(f" {before}", style=_QUIET).append(name, "bold")
    line.append("  ● held   " if held else "  ○ let go ", "bold cyan" if held else _QUIET)
    if push is not None:
        line.append("  pushes ", _QUIET).append(f"{math.hypot(*push.force_n):5.2f} N", "bold")
        line.append(f" {direction(push.force_n)}", "default")
    line.append("  damping ", _QUIET).append(f"{damping_n_s_per_m:5.1f}", "bold").append(" N s/m", "default")
    return line.append_text(message)


def _message(push: Touch | None) -> Text:
    """Which of its client's messages is in force."""
    if push is None:
        return Text("")
    return Text(f"  message {push.remote_seq}" if push.remote_seq >= 0 else "  fades out", _QUIET)


def _push(pushes: Mapping[int, Touch], status: Status, name: str) -> Touch | None:
    """What was heard of it last."""
    names = zip(status.remote_name, status.remote_kind, strict=False)
    index = next((n for n, (one, kind) in enumerate(names) if one == name and kind != "object"), -1)
    return pushes.get(index)
