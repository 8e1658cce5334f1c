"""One published row against the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Finding:
    """What a source says and what the model says.

    Attributes:
        key: name in files.
        source: who published it, in what, and how much of that was read.
        published: what it says.
        model: what the model says.
        agrees: whether they agree; None: nothing here could tell.
        figures: the numbers behind it, by name with their unit.
    """

    key: str
    source: str
    published: str
    model: str
    agrees: bool | None
    figures: Mapping[str, object]

    @property
    def verdict(self) -> str:
        """In a word."""
        return {True: "agrees", False: "does not agree", None: "says nothing"}[self.agrees]
