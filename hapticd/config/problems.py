"""Say what is wrong with a configuration: one line a problem, naming file, key, value and what is allowed."""

from __future__ import annotations

import json
import re
import types
import typing
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, TypeVar

import annotated_types
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from hapticd.errors import alike

Key = str | int
ModelT = TypeVar("ModelT", bound=BaseModel)

_LONGEST_VALUE = 60

_KINDS = {
    "bool_type": "true or false",
    "dict_type": "a table",
    "finite_number": "a finite number",
    "float_type": "a number",
    "int_type": "a whole number",
    "list_type": "an array",
    "model_type": "a table",
    "string_type": "a string",
    "tuple_type": "an array",
}


class Problems:
    """Collects the problems of one file, so that they are reported at once.

    Args:
        name: what the user calls the file.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.lines: list[str] = []

    def add(self, path: Sequence[Key], sentence: str, *value: object) -> None:
        """Report a problem at a key, with the offending value where there is one."""
        shown = "".join(f" = {shown_value(item)}" for item in value)
        line = f"{self.name}: {key_path(path)}{shown}: {' '.join(sentence.splitlines())}"
        if line not in self.lines:
            self.lines.append(line)

    def validated(self, model: type[ModelT], data: object, at: tuple[Key, ...] = ()) -> ModelT | None:
        """Check a table against a model; on failure report every problem and return None.

        Args:
            model: the table's model.
            data: the table as it was read.
            at: where the table is in the file.
        """
        try:
            return model.model_validate(data)
        except ValidationError as error:
            for detail in error.errors(include_url=False):
                self._add_detail(model, data, at, detail)
            return None

    def _add_detail(self, model: type[BaseModel], data: object, at: tuple[Key, ...], detail: ErrorDetails) -> None:
        path = _keys(detail, data)
        if detail["type"].startswith("union_tag"):
            path = (*path, detail["ctx"]["discriminator"].strip("'"))
        tables, field = _declaration(model, path)
        if detail["type"] == "extra_forbidden":
            known = sorted({name for table in tables for name in table.model_fields})
            advice = nearest(str(path[-1]), known)
            if "did you mean" not in advice:
                advice += _elsewhere(tables, (*at, *path[:-1]))
            self.add((*at, *path), f"unknown key; {advice}", detail["input"])
        elif detail["type"] in ("tuple_type", "list_type") and isinstance(detail["input"], dict):
            where = key_path((*at, *path))
            advice = "" if "[" in where else f": write [[{where}]]"
            self.add((*at, *path), f"must be an array{advice}", detail["input"])
        elif detail["type"] in ("missing", "union_tag_not_found"):
            meaning = f": {field.description}" if field and field.description else ""
            self.add((*at, *path), f"this key is required{meaning}")
        elif detail["type"] == "union_tag_invalid":
            self.add((*at, *path), _sentence(detail, field), detail["ctx"]["tag"])
        elif isinstance(detail["input"], dict | BaseModel) and detail["type"] == "value_error":
            self.add((*at, *path), _sentence(detail, field))  # about several keys of the table
        else:
            self.add((*at, *path), _sentence(detail, field), detail["input"])


def nearest(name: str, known: Sequence[str]) -> str:
    """Advice for an unknown name: the nearest known one, or all of them."""
    return alike(name, known) or f"known here: {', '.join(known) or 'nothing'}"


def key_path(path: Sequence[Key]) -> str:
    """A key as a user would write it: `scene.walls[0].stiffness_n_per_m`."""
    text = ""
    for key in path:
        if isinstance(key, int):
            text += f"[{key}]"
        else:
            bare = key if re.fullmatch(r"[A-Za-z0-9_-]{1,60}", key) else shown_value(key)
            text += f".{bare}" if text else bare
    return text


def shown_value(value: object) -> str:
    """A value as it stands in TOML, shortened to fit into a line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        text = json.dumps(value, ensure_ascii=not value.isprintable())
    elif isinstance(value, dict | BaseModel):
        text = "{...}" if value else "{}"
    elif isinstance(value, list | tuple):
        text = "[...]" if value else "[]"
    elif isinstance(value, int):
        text = hex(value) if abs(value) >= 1 << 256 else str(value)
    else:
        text = str(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[: _LONGEST_VALUE - 3]}..."


def unit_of(field: FieldInfo) -> str:
    """The unit that a field's description names in brackets, or nothing."""
    found = re.search(r"\[([^\]]+)\]", field.description or "")
    return found.group(1) if found else ""


def allowed_range(field: FieldInfo) -> str:
    """The numbers that a field allows: `from 100 to 8000 Hz`, or nothing when any will do."""
    low, high = "", ""
    for bound in field.metadata:
        match bound:
            case annotated_types.Ge(ge=least):
                low = f"{_number(least)}"
            case annotated_types.Gt(gt=least):
                low = f"more than {_number(least)}"
            case annotated_types.Le(le=most):
                high = f"{_number(most)}"
            case annotated_types.Lt(lt=most):
                high = f"less than {_number(most)}"
    unit = f" {unit_of(field)}" if unit_of(field) else ""
    if low and high:
        if "than" not in low and "than" not in high:
            return f"from {low} to {high}{unit}"
        least = low if "than" in low else f"at least {low}"
        return f"{least} and {high if 'than' in high else f'at most {high}'}{unit}"
    if low:
        return f"{low}{unit}" if "than" in low else f"{low}{unit} or more"
    if high:
        return f"{high}{unit}" if "than" in high else f"{high}{unit} or less"
    return ""


def tables_of(annotation: Any) -> Iterator[type[BaseModel]]:
    """The models that a field's annotation mentions: itself, in an array, as branches of a union."""
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        if issubclass(annotation, BaseModel):
            yield annotation
        return
    for part in typing.get_args(annotation):
        yield from tables_of(part)


def _elsewhere(tables: Iterable[type[BaseModel]], at: Sequence[Key]) -> str:
    """Where the keys of the plug-in stand that a table names, for those who wrote them into the table itself."""
    fields = ((name, field) for table in tables for name, field in table.model_fields.items())
    own = ((name, field) for name, field in fields if typing.get_origin(field.annotation) is dict)
    return "".join(f"; {field.description} stand in [{key_path((*at, name))}]" for name, field in own)


def _sentence(detail: ErrorDetails, field: FieldInfo | None) -> str:
    kind, context = detail["type"], detail.get("ctx", {})
    bounds = allowed_range(field) if field else ""
    if kind in ("greater_than", "greater_than_equal", "less_than", "less_than_equal") and bounds:
        return f"must be {bounds}"
    if kind in ("float_type", "int_type"):
        return f"must be {_KINDS[kind]} {bounds}".rstrip()
    if kind in _KINDS:
        return f"must be {_KINDS[kind]}"
    match kind:
        case "literal_error":
            return f"must be {context['expected']}".replace("'", '"')
        case "union_tag_invalid":
            return f"must be one of {context['expected_tags']}".replace("'", '"')
        case "string_too_short":
            return "must not be empty"
        case "string_pattern_mismatch":
            return f"must match {context['pattern']}"
        case "too_long":
            return f"must have {context['max_length']} entries at most, not {context['actual_length']}"
        case "too_short":
            return f"must have {context['min_length']} entries at least, not {context['actual_length']}"
        case "value_error":
            return str(context["error"])
    message = detail["msg"].removeprefix("Input should be ")
    return f"must be {message}" if message != detail["msg"] else message[:1].lower() + message[1:]


def _keys(detail: ErrorDetails, data: Any) -> tuple[Key, ...]:
    """The keys of a location, without the names that pydantic adds for the branches of a union."""
    path: list[Key] = []
    location = detail["loc"]
    for depth, part in enumerate(location):
        if part in (data if isinstance(data, dict) else range(len(data)) if isinstance(data, list | tuple) else ()):
            data = data[part]
        elif not (detail["type"] == "missing" and depth == len(location) - 1):
            continue
        path.append(part)
    return tuple(path)


def _declaration(model: type[BaseModel], path: Sequence[Key]) -> tuple[list[type[BaseModel]], FieldInfo | None]:
    """The tables that may stand around a key, and the field that declares it; None for an array's element."""
    tables, field = [model], None
    names = [key for key in path if isinstance(key, str)]
    for depth, name in enumerate(names):
        fields = [table.model_fields[name] for table in tables if name in table.model_fields]
        field = fields[0] if fields else None
        if depth < len(names) - 1:
            tables = [table for field in fields for table in tables_of(field.annotation)]
    return tables, field if path and isinstance(path[-1], str) else None


def _number(bound: Any) -> str:
    short = re.sub(r"e\+?(-?)0*", r"e\1", f"{bound:g}")
    return short if float(short) == bound else str(bound)
