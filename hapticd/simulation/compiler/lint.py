"""Say, in the user's terms, what in a law would not run compiled, or would not give the same bits there."""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import textwrap
from dataclasses import dataclass
from types import FunctionType, ModuleType
from typing import Any

from hapticd.law import LawSnapshot, LawTick, state_fields

_ARITHMETIC = "a law is + - * /, comparisons, min, max, abs and sqrt on floats"
_CALLS = {min, max, abs, float, int, bool, math.sqrt, range, len}
_OPERATORS = {
    ast.Pow: ("**", "write x * x; ** rounds and overflows differently when compiled", False),
    ast.Mod: ("%", "its sign rule is easy to get wrong; keep a count or compare", False),
    ast.FloorDiv: ("//", "divide and compare instead", False),
    ast.MatMult: ("@", _ARITHMETIC, True),
    ast.LShift: ("<<", _ARITHMETIC, False),
    ast.RShift: (">>", _ARITHMETIC, False),
    ast.BitAnd: ("&", "use `and`", False),
    ast.BitOr: ("|", "use `or`", False),
    ast.BitXor: ("^", _ARITHMETIC, False),
}
_STATEMENTS: dict[type[ast.AST], tuple[str, str]] = {
    ast.List: ("a list", "declare scalar fields in State instead"),
    ast.Dict: ("a dict", "declare scalar fields in State instead"),
    ast.Set: ("a set", "declare scalar fields in State instead"),
    ast.ListComp: ("a list comprehension", "declare scalar fields in State instead"),
    ast.DictComp: ("a dict comprehension", "declare scalar fields in State instead"),
    ast.SetComp: ("a set comprehension", "declare scalar fields in State instead"),
    ast.GeneratorExp: ("a generator", "write the terms out"),
    ast.JoinedStr: ("a formatted string", "compiled code knows no strings"),
    ast.Lambda: ("a lambda", "write a module-level function"),
    ast.Try: ("try", "test for the case before it happens"),
    ast.Raise: ("raise", "return a force for every input"),
    ast.Assert: ("assert", "return a force for every input"),
    ast.With: ("with", _ARITHMETIC),
    ast.Import: ("import inside a function", "import at the top of the module"),
    ast.ImportFrom: ("import inside a function", "import at the top of the module"),
    ast.Global: ("global", "keep it in State"),
    ast.Nonlocal: ("nonlocal", "keep it in State"),
    ast.ClassDef: ("a class", "declare scalar fields in State instead"),
    ast.Yield: ("yield", "return the force"),
    ast.YieldFrom: ("yield from", "return the force"),
    ast.Await: ("await", "return the force"),
    ast.Delete: ("del", _ARITHMETIC),
    ast.NamedExpr: (":=", "assign on a line of its own"),
    ast.Starred: ("*arguments", "name each argument"),
    ast.Subscript: ("an index", "declare scalar fields in State instead"),
}


@dataclass(frozen=True, slots=True)
class LintFinding:
    """One construct that does not belong into a law.

    Attributes:
        file: where it is.
        line: on which line.
        construct: what it is, in the user's words.
        advice: what to write instead.
        fatal: it cannot be compiled; otherwise it can, but with other bits than interpreted.
    """

    file: str
    line: int
    construct: str
    advice: str
    fatal: bool

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.construct}: {self.advice}"


def lint_law(law: ModuleType) -> list[LintFinding]:
    """Everything in a law's `step`, and in the functions that it calls, that is outside the arithmetic of a law."""
    fields = {
        "state": set(state_fields(law)),
        "params": set(law.Params.model_fields),
        "tick": set(LawTick.__slots__),
        "snapshot": set(LawSnapshot.__slots__),
    }
    linter = _Linter(fields)
    for function, roles in ((law.step, ("state", "params", "tick")), (law.start, ("state", "params", "snapshot"))):
        linter.function(function, roles)
    return linter.findings


class _Linter:
    """Follows the calls of a law and looks at each function once per way of calling it."""

    def __init__(self, fields: dict[str, set[str]]) -> None:
        self.findings: list[LintFinding] = []
        self._fields = fields
        self._seen: set[tuple[Any, tuple[str, ...]]] = set()

    def function(self, function: Any, roles: tuple[str, ...]) -> None:
        if (function, roles) in self._seen:
            return
        self._seen.add((function, roles))
        file = inspect.getsourcefile(function) or "?"
        if not isinstance(function, FunctionType) or function.__closure__:
            self.findings.append(LintFinding(file, 0, f"{function!r}", "step and start must be plain functions", True))
            return
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines)))
        ast.increment_lineno(tree, first - 1)
        definition = tree.body[0]
        if not isinstance(definition, ast.FunctionDef):
            self.findings.append(LintFinding(file, first, "a lambda", "write a module-level function", True))
            return
        names = [argument.arg for argument in definition.args.args]
        _Body(self, function, file, dict(zip(names, roles, strict=False))).check(definition)

    def field(self, role: str, name: str) -> bool:
        return role not in self._fields or name in self._fields[role]


class _Body(ast.NodeVisitor):
    """Looks at one function."""

    def __init__(self, linter: _Linter, function: FunctionType, file: str, roles: dict[str, str]) -> None:
        self._linter = linter
        self._function = function
        self._file = file
        self._roles = roles

    def check(self, definition: ast.FunctionDef) -> None:
        for decorator in definition.decorator_list:
            self._found(decorator, "a decorator", "a law's functions are plain", True)
        body = definition.body
        if isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
            body = body[1:]  # the docstring
        for statement in body:
            self.visit(statement)

    def visit(self, node: ast.AST) -> Any:
        if type(node) in _STATEMENTS:
            construct, advice = _STATEMENTS[type(node)]
            if isinstance(node, ast.Subscript):
                self.visit(node.value)
            self._found(node, construct, advice, True)
            return
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            self._found(node, "a function inside a function", "write a module-level function", True)
            return
        super().visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        self.visit(node.target)
        if node.value is not None:
            self.visit(node.value)

    def visit_Constant(self, node: ast.Constant) -> None:
        if isinstance(node.value, str | bytes):
            self._found(node, f"the string {node.value!r}", "a choice arrives as the index of the chosen value", True)
        elif node.value is None:
            self._found(node, "None", "a law's values are numbers", True)
        elif isinstance(node.value, complex):
            self._found(node, "a complex number", _ARITHMETIC, True)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        self._operator(node, node.op)
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self._operator(node, node.op)
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        for operator in node.ops:
            if isinstance(operator, ast.In | ast.NotIn):
                self._found(node, "`in`", "compare with each value", True)
            if isinstance(operator, ast.Is | ast.IsNot):
                self._found(node, "`is`", "a law sees numbers only, never None; compare with ==", True)
        self.generic_visit(node)

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if isinstance(node.value, ast.Name) and node.value.id in self._roles:
            role = self._roles[node.value.id]
            if not self._linter.field(role, node.attr):
                kind = {"state": "State", "params": "Params", "tick": "LawTick", "snapshot": "LawSnapshot"}[role]
                self._found(node, f"{node.value.id}.{node.attr}", f"{kind} has no such field", True)
            if isinstance(node.ctx, ast.Store) and role != "state":
                self._found(node, f"writing {node.value.id}.{node.attr}", "only the state may be written", False)
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        if not isinstance(node.func, ast.Name | ast.Attribute):
            self.visit(node.func)
            return
        for argument in [*node.args, *(keyword.value for keyword in node.keywords)]:
            self.visit(argument)
        name = ast.unparse(node.func)
        called = self._resolve(node.func)
        if called is None:
            self._found(node, f"{name}()", "unknown here; call functions of a module", True)
        elif isinstance(called, FunctionType):
            if isinstance(node.func, ast.Attribute):
                advice = f"import the function itself: from {called.__module__} import {called.__name__}"
                self._found(node, f"{name}()", advice, True)
            roles = tuple(
                self._roles.get(argument.id, "") if isinstance(argument, ast.Name) else "" for argument in node.args
            )
            self._linter.function(called, roles)
        elif called not in _CALLS:
            inexact = getattr(called, "__module__", None) == "math" or called in (pow, round, divmod)
            advice = "not the same to the last bit when compiled; " + _ARITHMETIC if inexact else _ARITHMETIC
            self._found(node, f"{name}()", advice, not inexact)

    def _operator(self, node: ast.AST, operator: ast.operator) -> None:
        if type(operator) in _OPERATORS:
            construct, advice, fatal = _OPERATORS[type(operator)]
            self._found(node, construct, advice, fatal)

    def _resolve(self, node: ast.expr) -> Any:
        if isinstance(node, ast.Name):
            return self._function.__globals__.get(node.id, getattr(builtins, node.id, None))
        if isinstance(node, ast.Attribute):
            return getattr(self._resolve(node.value), node.attr, None)
        return None

    def _found(self, node: ast.AST, construct: str, advice: str, fatal: bool) -> None:
        finding = LintFinding(self._file, getattr(node, "lineno", 0), construct, advice, fatal)
        if finding not in self._linter.findings:
            self._linter.findings.append(finding)
