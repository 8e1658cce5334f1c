"""The protocol's test vectors, as the firmware reads them too."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

FILE = Path(__file__).parents[3] / "drivers" / "firmware" / "protocol" / "vectors.txt"


def lines(kind: str) -> list[list[str]]:
    """Words of each line of a kind, without the kind."""
    found = [line.split(" ") for line in FILE.read_text().splitlines()]
    return [words for first, *words in found if first == kind]


def raw(word: str) -> bytes:
    return b"" if word == "-" else bytes.fromhex(word)


@dataclass(frozen=True)
class Vector:
    """A `host` or `device` line."""

    name: str
    message: bytes
    wire: bytes
    fields: dict[str, str]

    def number(self, field: str) -> int:
        return int(self.fields[field])

    def numbers(self, field: str) -> list[int]:
        """Of a field that each axis has."""
        return [int(value) for name, value in self.fields.items() if name.rstrip("0123456789") == field]


def vectors(kind: str) -> list[Vector]:
    return [
        Vector(name, raw(message), raw(wire), dict(field.split("=") for field in fields))
        for name, message, wire, *fields in lines(kind)
    ]
