"""The table in a Hapkit's `board.h`: read as the C compiler reads it, and replaced."""

from __future__ import annotations

import re
from collections.abc import Sequence

from hapticd.errors import ConfigError
from hapticd_drivers.rig.angle_table import HALF_TURN, NODES

_TABLE = re.compile(r"(#define\s+TABLE\s+)\{([^}]*)\}")
_ENTRY = re.compile(r"(LINE\()?\s*(-?\d+)\s*\)?")


def read_table(text: str) -> list[int]:
    """The table that the header gives a board [counts].

    Args:
        text: of the header.

    Raises:
        ConfigError: it has none, or one that is not understood.
    """
    found = _TABLE.search(text)
    if found is None:
        raise ConfigError("no #define TABLE {...} in it")
    entries = [entry.strip(" \t\r\n\\") for entry in found[2].split(",")]
    table = []
    for entry in entries:
        parts = _ENTRY.fullmatch(entry)
        if parts is None:
            raise ConfigError(f"TABLE has an entry that is neither a number nor LINE(number): {entry}")
        table.append(_line(text, int(parts[2])) if parts[1] else int(parts[2]))
    if len(table) != NODES or table != sorted(table):
        raise ConfigError(f"TABLE needs {NODES} numbers that rise")
    return table


def table_line(table: Sequence[int]) -> str:
    """The line of the header for a table."""
    return f"#define TABLE {{{', '.join(map(str, table))}}}"


def with_table(text: str, table: Sequence[int]) -> str:
    """The header with another table.

    Args:
        text: of the header, which has one.
        table: what takes its place [counts].
    """
    return _TABLE.sub(lambda _: table_line(table), text, count=1)


def _line(text: str, raw: int) -> int:
    """What LINE(raw) of the header is; C rounds towards zero."""
    lowest, highest = (_number(text, name) for name in ("LOWEST_RAW", "HIGHEST_RAW"))
    counts = (raw - lowest) * HALF_TURN
    return abs(counts) // (highest - lowest) * (1 if counts >= 0 else -1)


def _number(text: str, name: str) -> int:
    found = re.search(rf"#define\s+{name}\s+(\d+)", text)
    if found is None:
        raise ConfigError(f"no #define {name} with a number in it")
    return int(found[1])
