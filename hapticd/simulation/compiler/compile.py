"""Run a law's unmodified source as machine code: plain functions through numba, objects as records on the stack.

Interpreted, a function reads and writes attributes of slotted objects; compiled, the same attributes are fields of a
numpy record. `on_stack` copies a record to where the optimiser can keep its fields in registers.
"""

from __future__ import annotations

import linecache
import re
import typing
from collections.abc import Callable, Mapping
from functools import lru_cache
from types import FunctionType, ModuleType
from typing import Any, Literal

import numpy as np
from numba import from_dtype, njit, types
from numba.core import cgutils
from numba.core.errors import NumbaError
from numba.extending import intrinsic

from hapticd.errors import PluginError
from hapticd.law import LawTick, Scalar, state_fields
from hapticd.simulation.compiler.lint import lint_law

OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "nogil": True, "no_cfunc_wrapper": True}
"""As Python computes, but a division by zero gives infinity and not an exception."""

INNER: dict[str, Any] = {**OPTIONS, "no_cpython_wrapper": True}
"""Of what only machine code calls: the way in from Python that each would get takes a fifth of the compiler's time."""

_KINDS = {float: np.float64, int: np.int64, bool: np.bool_}


def record_dtype(fields: Mapping[str, type[Scalar]]) -> np.dtype[Any]:
    """The record with these fields; one that has none gets one that is not used, since a record needs a size."""
    named = [(name, _KINDS[kind]) for name, kind in fields.items()] or [("unused", np.float64)]
    return np.dtype(named, align=True)


def kinds(values: Mapping[str, Scalar]) -> dict[str, type[Scalar]]:
    """Field types of example values."""
    return {name: type(value) for name, value in values.items()}


def param_kinds(law: ModuleType) -> dict[str, type[Scalar]]:
    """Field types of a law's parameters, as `scalar_params` gives them."""
    found: dict[str, type[Scalar]] = {}
    for name, info in law.Params.model_fields.items():
        kind = info.annotation
        if typing.get_origin(kind) is Literal:
            found[name] = int
        else:
            options = typing.get_args(kind) or (kind,)
            found[name] = next((scalar for scalar in (float, int, bool) if scalar in options), float)
    return found


TICK_KINDS: dict[str, type[Scalar]] = {name: bool if name == "in_contact" else float for name in LawTick.__slots__}


def compiled(function: Callable[..., Any], memo: dict[Any, Any] | None = None) -> Any:
    """The form of a plain function, and of every plain function that it calls, that machine code may call."""
    memo = {} if memo is None else memo
    if function in memo:
        return memo[function]
    assert isinstance(function, FunctionType)
    names = dict(function.__globals__)
    copy = FunctionType(function.__code__, names, function.__name__, function.__defaults__, function.__closure__)
    copy.__module__ = function.__module__
    memo[function] = machine = njit(copy, forceinline=True, **INNER)
    for name in _names(function.__code__):
        callee = names.get(name)
        if callee is function or isinstance(callee, FunctionType):
            names[name] = compiled(callee, memo)
    return machine


@lru_cache(maxsize=64)
def compiled_step(law: ModuleType) -> Any:
    """A law's `step` as machine code, for machine code to call.

    Raises:
        PluginError: it cannot be compiled; the message names the law, the line and the construct.
    """
    refuse(law)
    machine = compiled(law.step)
    arguments = (
        from_dtype(record_dtype(state_fields(law))),
        from_dtype(record_dtype(param_kinds(law))),
        from_dtype(record_dtype(TICK_KINDS)),
    )
    try:
        machine.compile(arguments)
    except NumbaError as error:
        raise PluginError(f"law {law.__name__} cannot be compiled:\n  {_in_plain_words(error)}") from error
    return machine


def refuse(law: ModuleType) -> None:
    """Say of a law what in it cannot be compiled, if anything.

    Raises:
        PluginError: it cannot be compiled; the message names the law, the line and the construct.
    """
    fatal = [finding for finding in lint_law(law) if finding.fatal]
    if fatal:
        raise PluginError(
            "\n".join([f"law {law.__name__} cannot be compiled:", *(f"  {finding}" for finding in fatal)])
        )


def _on_stack(_typing: Any, record: Any) -> Any:
    """A copy of a record in the caller's frame."""

    def codegen(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        slot = _emit.alloca_once(builder, context.get_data_type(record))
        slot.align = 16
        size = context.get_constant(types.uintp, record.size)
        _emit.raw_memcpy(builder, slot, arguments[0], size, 1)
        return builder.bitcast(slot, arguments[0].type)

    return (record(record), codegen) if isinstance(record, types.Record) else None


_emit: Any = cgutils  # numba publishes no types for these
on_stack: Any = intrinsic(_on_stack)


def _names(code: Any) -> set[str]:
    found = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, type(code)):
            found |= _names(constant)
    return found


def _in_plain_words(error: NumbaError) -> str:
    """File, line, source and first sentence of a numba error; it has dozens of lines, written for numba's authors."""
    text = str(error)
    places = re.findall(r'File "([^"]+)", line (\d+)', text)
    sentences = [line.strip() for line in text.splitlines() if line.strip()]
    said = next(
        (line for line in sentences if re.match(r"(Cannot|Unknown|No impl|Invalid|Untyped|Unsupp|Use of)", line)), ""
    )
    said = re.sub(r"Record\([^)]*\)", "an object", said).replace("float64", "a number")
    said = said or next((line for line in sentences if not line.startswith(("Failed in", "During"))), sentences[0])
    if not places:
        return said
    file, line = places[-1]
    return f"{file}:{line}: `{linecache.getline(file, int(line)).strip()}`: {said}"
