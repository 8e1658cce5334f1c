"""Make the shortest form of a function: branches on switches that are off are removed before it runs.

A module names its switches in capitals, `if DELAY: ...` or `if DELAY and ...:`; what a device does not have then
costs nothing, neither interpreted nor compiled, and the source stays one function.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from types import FunctionType
from typing import Any, TypeGuard, TypeVar, cast

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])


def specialise(
    function: FunctionT, switches: Mapping[str, bool], calls: Mapping[str, Callable[..., Any]] | None = None
) -> FunctionT:
    """A copy of a function without the branches that its switches rule out.

    Functions of the same package that it calls are specialised with it. The copy keeps name, file and line numbers,
    so that a traceback points at the source.

    Args:
        function: a plain function whose source can be read.
        switches: name to on or off, for names that stand alone or first in an `if`.
        calls: functions to put in the place of these names.
    """
    return cast("FunctionT", _specialise(cast("FunctionType", function), switches, calls or {}))


def _specialise(
    function: FunctionType, switches: Mapping[str, bool], calls: Mapping[str, Callable[..., Any]]
) -> FunctionType:
    """The copy for what the function knows of all that: what differs in nothing else is made once."""
    known = _names(function)
    on = tuple(sorted(item for item in switches.items() if item[0] in known))
    return _made(function, on, tuple(sorted((item for item in calls.items() if item[0] in known), key=_name)))


def _name(item: tuple[str, Any]) -> str:
    return item[0]


@lru_cache(maxsize=1024)
def _made(
    function: FunctionType, switches: tuple[tuple[str, bool], ...], calls: tuple[tuple[str, Any], ...]
) -> FunctionType:
    text, first = _source(function)
    tree = ast.fix_missing_locations(_Pruner(dict(switches)).visit(ast.parse(text)))
    ast.increment_lineno(tree, first - 1)
    definition = tree.body[0]
    assert isinstance(definition, ast.FunctionDef)
    definition.returns = None
    for argument in definition.args.args:
        argument.annotation = None
    names = dict(function.__globals__)
    names.update(calls)
    for name in _used(definition) - set(dict(calls)):
        callee = names.get(name)
        if _is_with(callee, function):
            names[name] = _specialise(callee, dict(switches), dict(calls))
    exec(compile(tree, inspect.getfile(function), "exec"), names)
    specialised = names[function.__name__]
    assert isinstance(specialised, FunctionType)
    return specialised


@cache
def _source(function: FunctionType) -> tuple[str, int]:
    """The text of a function, and the number of its first line."""
    lines, first = inspect.getsourcelines(function)
    return textwrap.dedent("".join(lines)), first


@cache
def _names(function: FunctionType) -> frozenset[str]:
    """All names that a function uses, and those of its package that it calls."""
    found: set[str] = set()
    seen, waiting = {function}, [function]
    while waiting:
        each = waiting.pop()
        used = _used(ast.parse(_source(each)[0]))
        found |= used
        for callee in map(each.__globals__.get, used):
            if _is_with(callee, each) and callee not in seen:
                seen.add(callee)
                waiting.append(callee)
    return frozenset(found)


def _used(tree: ast.AST) -> set[str]:
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}


def _is_with(callee: object, function: FunctionType) -> TypeGuard[FunctionType]:
    return isinstance(callee, FunctionType) and callee is not function and _package(callee) == _package(function)


def _package(function: FunctionType) -> str:
    return function.__module__.rpartition(".")[0] or function.__module__


class _Pruner(ast.NodeTransformer):
    """Drops the branches of an `if` on a switch."""

    def __init__(self, switches: dict[str, bool]) -> None:
        self._switches = switches

    def generic_visit(self, node: ast.AST) -> ast.AST:
        super().generic_visit(node)
        if isinstance(node, ast.stmt) and getattr(node, "body", None) == []:
            node.body = [ast.Pass()]  # type: ignore[attr-defined]  # it has just been seen to have one
        return node

    def visit_If(self, node: ast.If) -> Any:
        self.generic_visit(node)
        first, *rest = node.test.values if isinstance(node.test, ast.BoolOp) else [node.test]
        if not (isinstance(first, ast.Name) and first.id in self._switches):
            return node
        if not self._switches[first.id]:
            return node.orelse
        if not rest:
            return node.body
        node.test = rest[0] if len(rest) == 1 else ast.BoolOp(ast.And(), rest)
        return node
