"""Every single slip in a source file, so that it can be put into a copy of the tree."""

from __future__ import annotations

import ast
import difflib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.simulation.mutants import changes, first_line


@dataclass(frozen=True, slots=True)
class Slip:
    """One slip in one file.

    Attributes:
        file: which, below the root of the tree.
        where: the function's qualified name; "" for a constant of the module.
        what: the line, and what has happened to it.
        at: which node of the file it is in, as `ast.walk` counts them.
        change: what is done to that node.
    """

    file: str
    where: str
    what: str
    at: int
    change: Callable[[Any], None]

    def __str__(self) -> str:
        return f"{self.file}: {self.where}: {self.what}"

    def into(self, source: str) -> str:
        """The file's source with the slip in it; comments are gone."""
        tree = ast.parse(source)
        self.change(next(node for index, node in enumerate(ast.walk(tree)) if index == self.at))
        return ast.unparse(tree) + "\n"

    def lines(self, source: str) -> set[int]:
        """The lines that a test comes by if it comes by the slip; none for a number of the module."""
        if not self.where:
            return set()
        tree = ast.parse(source)
        nodes = list(ast.walk(tree))
        node = nodes[self.at]
        self.change(node)
        gone = [each for each in set(nodes) - set(ast.walk(tree)) if isinstance(each, ast.stmt)]
        within = [each for each in nodes if isinstance(each, ast.stmt) and node in ast.walk(each)]
        return {line for each in gone or within[-1:] for line in _own_lines(each)}

    def diff(self, source: str) -> str:
        """What it changes, as `diff -u` shows it."""
        before, after = ast.unparse(ast.parse(source)) + "\n", self.into(source)
        lines = difflib.unified_diff(before.splitlines(), after.splitlines(), self.file, self.file, "", "", 2, "")
        return "\n".join(lines)


def slips(root: Path, file: str) -> list[Slip]:
    """Every slip in the functions and the numbers of a file; what it says to people is left alone.

    Args:
        root: of the tree.
        file: which, below the root.
    """
    tree = ast.parse((root / file).read_text())
    homes = {node: (where, home) for node, where, home in _nodes(tree)}
    found = []
    for at, node in enumerate(ast.walk(tree)):
        if node not in homes:
            continue
        where, home = homes[node]
        if _is_order_of_equals(node):
            continue
        for label, change in list(_numbers(node)) or changes(node, (), homes):
            found.append(Slip(file, where, f"{home}  [{label}]", at, change))
    return found


def _own_lines(statement: ast.stmt) -> range:
    """Its lines, without those of what is in its blocks."""
    body = getattr(statement, "body", None)
    last = body[0].lineno - 1 if body else statement.end_lineno
    return range(statement.lineno, max(statement.lineno, last or 0) + 1)


def _is_order_of_equals(node: ast.AST) -> bool:
    """Whether it is a call whose arguments may be swapped, or are the same."""
    if not isinstance(node, ast.Call):
        return False
    named = isinstance(node.func, ast.Name) and node.func.id in ("min", "max")
    return named or len({ast.dump(argument) for argument in node.args}) < len(node.args)


def _numbers(node: ast.AST) -> Iterator[tuple[str, Callable[[Any], None]]]:
    """A whole number is one more, any other one twice as much: 1e6 + 1 would be no slip that anything could show."""
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
        value = node.value
        other = value + 1 if isinstance(value, int) or value == 0.0 else 2.0 * value

        def change(twin: Any) -> None:
            twin.value = other

        yield f"{value} is {other}", change


def _nodes(tree: ast.Module) -> Iterator[tuple[ast.AST, str, str]]:
    """The nodes that may be changed, each with its function and the first line of its statement."""
    for statement in tree.body:
        if isinstance(statement, ast.Assign) and all(isinstance(name, ast.Name) for name in statement.targets):
            value = statement.value
            if isinstance(value, ast.Constant | ast.UnaryOp | ast.BinOp):
                for node in ast.walk(value):
                    yield node, "", first_line(statement)
        else:
            yield from _below(statement, "")


def _below(node: ast.stmt, where: str) -> Iterator[tuple[ast.AST, str, str]]:
    if isinstance(node, ast.ClassDef):
        for statement in node.body:
            if isinstance(statement, ast.ClassDef | ast.FunctionDef):
                yield from _below(statement, f"{where}{node.name}.")
    elif isinstance(node, ast.FunctionDef):
        name = where + node.name
        yield node, name, f"def {node.name}"
        body = node.body[1:] if ast.get_docstring(node) is not None else node.body
        for statement in body:
            yield from _inside(statement, name, first_line(statement))


def _inside(node: ast.AST, where: str, home: str) -> Iterator[tuple[ast.AST, str, str]]:
    """A node of a function and all that is in it, but for annotations, texts and what an error says."""
    if isinstance(node, ast.stmt | ast.ExceptHandler):
        home = first_line(node)
    if isinstance(node, ast.JoinedStr):
        return
    yield node, where, home
    if isinstance(node, ast.Raise):
        return
    for name, child in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "args") and not isinstance(node, ast.Call):
            continue
        for each in child if isinstance(child, list) else [child]:
            if isinstance(each, ast.AST):
                yield from _inside(each, where, home)
