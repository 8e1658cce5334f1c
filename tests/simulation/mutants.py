"""Every function that differs from a given one by a single slip."""

from __future__ import annotations

import ast
import copy
import inspect
import linecache
import textwrap
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from types import FunctionType
from typing import Any

_COMPARED: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
}
_COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.FloorDiv: ast.Mod,
}
_OTHER_NAME = {"min": "max", "max": "min"}


Change = tuple[str, Callable[[Any], None]]
"""What is done to a node, in words and in deed."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """One slip.

    Attributes:
        function: the function's qualified name.
        slip: the line, and what has happened to it.
        original: the function without it.
        at: which node of it the slip is in, as `ast.walk` counts them.
        change: what is done to that node.
    """

    function: str
    slip: str
    original: ast.FunctionDef
    at: int
    change: Callable[[Any], None]

    def __str__(self) -> str:
        return f"{self.function}: {self.slip}"

    def into(self, names: dict[str, Any]) -> FunctionType:
        """The function, defined among these names; its source can be read as that of any other."""
        definition = copy.deepcopy(self.original)
        self.change(next(node for index, node in enumerate(ast.walk(definition)) if index == self.at))
        source = ast.unparse(definition) + "\n"
        file = f"<{self}>"
        linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
        exec(compile(source, file, "exec"), names)
        function = names[definition.name]
        assert isinstance(function, FunctionType)
        return function


def mutants(function: Callable[..., Any], switches: Collection[str] = (), apart: Collection[str] = ()) -> list[Mutant]:
    """Every single slip in a function.

    Of a comparison, a sign, an operator, a constant, min and max, and and or, the order of two arguments; a branch
    turned round, a statement or one of its targets left out.

    Args:
        function: a plain function whose source can be read.
        switches: names whose tests are left alone; what hangs on them is not.
        apart: first lines of statements that are left alone with all that is in them.

    Raises:
        ValueError: one of `apart` is not there.
    """
    original = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(original, ast.FunctionDef)
    original.returns = None
    original.decorator_list = []
    for argument in original.args.args:
        argument.annotation = None
    if ast.get_docstring(original) is not None:
        del original.body[0]
    homes, left = _homes(original, frozenset(apart))
    if left:
        raise ValueError(f"{function.__qualname__} has no {sorted(left)}")
    found = []
    for at, node in enumerate(ast.walk(original)):
        if node not in homes:
            continue
        for label, change in changes(node, switches, homes):
            found.append(Mutant(function.__qualname__, f"{homes[node]}  [{label}]", original, at, change))
    return found


def changes(node: ast.AST, switches: Collection[str], homes: Collection[ast.AST]) -> Iterator[Change]:
    """What may be done to the same node of a copy.

    Args:
        node: a node.
        switches: names whose tests are left alone.
        homes: nodes that may be changed; statements that are not among them are not left out.
    """
    for field in ("body", "orelse"):
        statements = getattr(node, field, None)
        if isinstance(statements, list):
            for index, statement in enumerate(statements):
                if statement in homes and not isinstance(statement, ast.Pass):
                    yield f"without {first_line(statement)}", _without(field, index)
    match node:
        case ast.Compare(ops=operators):
            for index, operator in enumerate(operators):
                for other in _COMPARED.get(type(operator), ()):
                    yield f"{type(operator).__name__} {index} is {other.__name__}", _setting_item("ops", index, other())
        case ast.BinOp(op=operator) | ast.AugAssign(op=operator) if type(operator) in _COMPUTED:
            other_way = _COMPUTED[type(operator)]
            yield f"{other_way.__name__} in {first_line(node)}", _setting("op", other_way())
        case ast.BoolOp(op=operator, values=[first, *_]) if not _is_switch(first, switches):
            yield "and is or, or is and", _setting("op", ast.Or() if isinstance(operator, ast.And) else ast.And())
        case ast.UnaryOp():
            yield f"{first_line(node)} turned round", _dropping_sign
        case ast.Constant(value=bool(value)):
            yield f"{value} is {not value}", _setting("value", not value)
        case ast.Constant(value=int(value) | float(value)):
            yield f"{value} is {value + 1}", _setting("value", value + 1)
        case ast.Name(id=name) if name in _OTHER_NAME:
            yield _OTHER_NAME[name], _setting("id", _OTHER_NAME[name])
        case ast.If(test=test) | ast.IfExp(test=test) if not _is_switch(test, switches):
            yield "turned round", _turning_round
        case ast.Assign(targets=targets) if len(targets) > 1:
            for index, target in enumerate(targets):
                yield f"without {first_line(target)}", _without("targets", index)
        case ast.Call(args=arguments):
            for index, argument in enumerate(arguments[:-1]):
                yield f"{first_line(argument)} one later", _swapping(index)


def first_line(node: ast.AST) -> str:
    """A node as it is written, or the first line of it."""
    return ast.unparse(node).splitlines()[0]


def _homes(original: ast.FunctionDef, apart: frozenset[str]) -> tuple[dict[ast.AST, str], set[str]]:
    """The first line of the statement that each node is in, but for those in `apart`; and what of `apart` is left."""
    homes: dict[ast.AST, str] = {}
    left = set(apart)

    def enter(node: ast.AST, home: str) -> None:
        if isinstance(node, ast.stmt | ast.ExceptHandler):
            home = first_line(node)
            if home in apart:
                left.discard(home)
                return
        homes[node] = home
        for child in ast.iter_child_nodes(node):
            enter(child, home)

    enter(original, "")
    return homes, left


def _is_switch(test: ast.expr, switches: Collection[str]) -> bool:
    first = test.values[0] if isinstance(test, ast.BoolOp) else test
    return isinstance(first, ast.Name) and first.id in switches


def _without(field: str, index: int) -> Callable[[Any], None]:
    def change(node: Any) -> None:
        items = getattr(node, field)
        gone = items.pop(index)
        if field == "body" and not items:
            items.append(ast.copy_location(ast.Pass(), gone))

    return change


def _setting(field: str, value: Any) -> Callable[[Any], None]:
    return lambda node: setattr(node, field, value)


def _setting_item(field: str, index: int, value: Any) -> Callable[[Any], None]:
    return lambda node: getattr(node, field).__setitem__(index, value)


def _swapping(index: int) -> Callable[[Any], None]:
    def change(node: Any) -> None:
        node.args[index], node.args[index + 1] = node.args[index + 1], node.args[index]

    return change


def _dropping_sign(node: Any) -> None:
    """- and not go; what is left is wrapped, since a node cannot be replaced from inside."""
    node.op = ast.UAdd() if isinstance(node.op, ast.USub) else ast.Not()
    if isinstance(node.op, ast.Not):
        node.operand = ast.UnaryOp(ast.Not(), node.operand)


def _turning_round(node: Any) -> None:
    node.test = ast.UnaryOp(ast.Not(), node.test)
