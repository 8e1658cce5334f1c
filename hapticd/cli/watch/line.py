"""A line of the picture that has to do with the room that there is."""

from __future__ import annotations

from collections.abc import Iterable

from rich.text import Text


def fitting(choices: Iterable[Text], width: int) -> Text:
    """The first of several lines that has room, or else the last one.

    Args:
        choices: the same told ever shorter.
        width: characters of a line.
    """
    line = Text("")
    for line in choices:
        if line.cell_len <= width:
            break
    return line
