"""A line of the picture: numbers in few digits, and the longest form that has room."""

from __future__ import annotations

from collections.abc import Iterable

from rich.text import Text

_PREFIXES = ((1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


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


def si(value: float, unit: str) -> str:
    """Three digits with a prefix: 12.3 mJ."""
    if value == 0.0:
        return f"0 {unit}"
    factor, prefix = next((one for one in _PREFIXES if abs(value) >= 0.9995 * one[0]), _PREFIXES[-1])
    scaled = value / factor
    digits = 2 if abs(scaled) < 9.995 else 1 if abs(scaled) < 99.95 else 0
    return f"{scaled:.{digits}f} {prefix}{unit}"
