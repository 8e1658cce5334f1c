"""What a page may ask for: messages that it sends, checked before anything is done with them."""

from __future__ import annotations

import json
import math
from typing import Any, Literal

from pydantic import Field, TypeAdapter, ValidationError

from hapticd.settings import Table

LARGEST_REQUEST = 16 * 1024
"""Bytes; a page that sends more is disconnected."""


class Hello(Table):
    """The first message of every page: whether it may command."""

    do: Literal["hello"]
    token: str = Field("", max_length=100)


class _Asked(Table):
    """What is answered: its number, and the newest time of the server that the page had heard of when it asked [s]."""

    id: int = 0
    now: float = math.inf


class Command(_Asked):
    """One of the buttons."""

    do: Literal["arm", "disarm", "clear"]


class FormRequest(_Asked):
    """The form as the file is now."""

    do: Literal["form"]


class Edit(_Asked):
    """The form, filled in: a law and the values that differ."""

    do: Literal["edit"]
    hash: str = Field(max_length=100)
    law: str = Field(min_length=1, max_length=200)
    values: dict[str, bool | int | float | str | None] = Field(default_factory=dict, max_length=200)


PageRequest = Hello | Command | FormRequest | Edit

_ADAPTER: TypeAdapter[PageRequest] = TypeAdapter(PageRequest)


def request(text: str | bytes) -> PageRequest | None:
    """A page's message; None when it is not what a page of ours sends."""
    try:
        data = json.loads(text, parse_constant=_refuse)
        json.dumps(data, ensure_ascii=False).encode()  # half a character, as "\\ud800", is a text that no file takes
        return _ADAPTER.validate_python(data)
    except (ValidationError, ValueError, RecursionError):
        return None


def _refuse(constant: str) -> Any:
    raise ValueError(f"{constant} is no JSON")
