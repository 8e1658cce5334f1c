"""What every table of the configuration is: the base of the daemon's own models and of each plug-in's."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator


class Table(BaseModel):
    """A table: strict types, no unknown keys, finite numbers, never changed after loading.

    A whole number serves where a float is meant; nothing else is converted. An array is declared as a tuple,
    since a table never changes; the lists of TOML and msgpack are taken for them.
    """

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _arrays_are_tuples(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        return {key: _frozen(value) if key in cls.model_fields else value for key, value in data.items()}


def _frozen(value: Any) -> Any:
    return tuple(map(_frozen, value)) if isinstance(value, list) else value
