"""Run the unmodified methods of a class as machine code: objects become records, nested as the objects are.

What the daemon's tick does with objects of several classes is compiled from the very source that the loop interprets.
A field that holds a number is a field of the record; one that holds an object of a class with a `Form` is a record in
it, and a list of such is an array in it. A method that is called on a record is found by the record's own type.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from types import FunctionType
from typing import Any

import numpy as np
from numba import njit
from numba.extending import overload

from hapticd.simulation.compiler.compile import INNER

_AS_PYTHON: dict[str, Any] = {"error_model": "python"}
"""A division by zero included."""

_SCALARS = {float: np.float64, int: np.int64, bool: np.bool_}


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """What is compiled of a class.

    Attributes:
        methods: names of its methods, those of its bases among them.
        attributes: names of its properties.
        instead: an expression of its source, as Python writes it, to the one that stands there when compiled.
        given: functions to put in the place of methods.
        without: fields that are left out, since the object is reached another way.
        kinds: types of its fields, where those of an example may be others.
    """

    methods: tuple[str, ...] = ()
    attributes: tuple[str, ...] = ()
    instead: Mapping[str, str] = field(default_factory=dict)
    given: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    without: tuple[str, ...] = ()
    kinds: Mapping[str, type[Any]] = field(default_factory=dict)


class Machine:
    """Some classes that work together, ready to be compiled.

    Args:
        forms: what is compiled of each.
        names: what the source finds under these names in the place of what it finds interpreted.
        modules: whose functions call methods of objects, or take lists of them apart.
        on: classes and functions that are compiled already.
    """

    def __init__(
        self,
        forms: Mapping[type[Any], Form],
        names: Mapping[str, Any],
        modules: Sequence[str] = (),
        on: Machine | None = None,
    ) -> None:
        self._forms: dict[type[Any], Form] = {**(on._forms if on else {}), **forms}
        self._names = names
        self._modules: tuple[str, ...] = (*modules, *(on._modules if on else ()))
        self._marks: dict[type[Any], str] = dict(on._marks) if on else {}
        self._memo: dict[Any, Any] = dict(on._memo) if on else {}
        self._methods = {name for form in self._forms.values() for name in (*form.methods, *form.given)}
        self._attributes = {name for form in self._forms.values() for name in form.attributes}
        for cls in forms:
            mark = f"_class_{len(_OF_MARK)}"
            self._marks[cls] = mark
            _OF_MARK[mark] = {}
        for cls, form in forms.items():
            own = _OF_MARK[self._marks[cls]]
            for name in form.methods:
                own[name] = self._rewritten(inspect.getattr_static(cls, name), form)
            for name in form.attributes:
                own[name] = self._rewritten(inspect.getattr_static(cls, name).fget, form)
            for name, function in form.given.items():
                own[name] = self.compiled(function)

    def dtype(self, example: Any, lists: Mapping[str, tuple[Any, int]]) -> np.dtype[Any]:
        """The record of objects like this one.

        Args:
            example: an object of a class with a form.
            lists: of each field that is a list of objects an example of these, and how many there may be.
        """
        form = self._forms[type(example)]
        fields: list[tuple[Any, ...]] = [(self._marks[type(example)], np.bool_)]
        for name, value in _fields_of(example):
            kind = form.kinds.get(name, type(value))
            if name in form.without:
                continue
            if kind in _SCALARS:
                fields.append((name, _SCALARS[kind]))
            elif kind in self._forms:
                fields.append((name, self.dtype(value, lists)))
            elif name in lists:
                one, most = lists[name]
                fields.append((name, self.dtype(one, lists), (most,)))
        return np.dtype(fields, align=True)

    def compiled(self, function: Callable[..., Any], options: Mapping[str, Any] = INNER) -> Any:
        """The machine code of a plain function and of every plain function that it calls.

        Args:
            function: interpreted.
            options: `INNER`, or `OPTIONS` for one that Python is to call as well.
        """
        if function not in self._memo:
            assert isinstance(function, FunctionType)
            if function.__module__ in self._modules:
                return self._rewritten(function, Form(), options)
            names = dict(function.__globals__)
            copy = FunctionType(function.__code__, names, function.__name__, function.__defaults__)
            copy.__module__ = function.__module__
            self._link(function, copy, names, options)
        return self._memo[function]

    def _link(self, original: Any, copy: FunctionType, names: dict[str, Any], options: Mapping[str, Any]) -> Any:
        """Compile a function that finds compiled ones, and what stands for something else, under its names."""
        self._memo[original] = machine = njit(copy, **{**options, **_AS_PYTHON})
        for name in copy.__code__.co_names:
            names.update({name: self._names[name]} if name in self._names else {})
            if isinstance(names.get(name), FunctionType) and not name.startswith(_CALL):
                names[name] = self.compiled(names[name])
        return machine

    def _rewritten(self, function: Any, form: Form, options: Mapping[str, Any] = INNER) -> Any:
        assert isinstance(function, FunctionType)
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
        definition = tree.body[0]
        assert isinstance(definition, ast.FunctionDef)
        definition.decorator_list = []
        definition.returns = None
        for argument in definition.args.args:
            argument.annotation = None
        definition.args.defaults = []
        tree = _OnRecords(self._methods, self._attributes).visit(_Instead(form.instead).visit(tree))
        ast.fix_missing_locations(tree)
        ast.increment_lineno(tree, function.__code__.co_firstlineno - 1)
        names = dict(function.__globals__)
        names.update({_CALL + name: _dispatched(name) for name in (*self._methods, *self._attributes)})
        exec(compile(tree, inspect.getfile(function), "exec"), names)
        made = names[function.__name__]
        names[function.__name__] = function.__globals__.get(function.__name__)
        return self._link((function, form) if form.methods else function, made, names, options)


def fill(row: Any, source: Any) -> None:
    """Put the fields of an object, and of those in it, into its record."""
    for name, value in _fields_of(source):
        if name not in row.dtype.names:
            continue
        if row.dtype[name].names is not None:
            fill(row[name], value)
        elif row.dtype[name].subdtype is not None:
            for at, one in enumerate(value):
                fill(row[name][at], one)
        else:
            row[name] = value


def store(row: Any, target: Any) -> None:
    """Put a record back into the fields of its object, and of those in it; one that has not been set yet stays so."""
    for name, value in _fields_of(target):
        if name not in row.dtype.names or not hasattr(target, name):
            continue
        if row.dtype[name].names is not None:
            store(row[name], value)
        elif row.dtype[name].subdtype is not None:
            for at, one in enumerate(value):
                store(row[name][at], one)
        else:
            setattr(target, name, row[name].item())


def as_tuple(cls: type[Any]) -> Any:
    """A named tuple that is made as an object of a class is: one that is only ever read."""
    return namedtuple(cls.__name__, [*inspect.signature(cls).parameters])


_OF_MARK: dict[str, dict[str, Any]] = {}
"""By the mark in a record: its methods, compiled."""

_CALL = "_method_"


@cache
def _dispatched(name: str) -> Any:
    """A function that calls the method or reads the property of this name of a record."""

    def stub(*_arguments: Any) -> Any:
        raise NotImplementedError

    def chosen(self: Any, *arguments: Any) -> Any:
        (machine,) = (_OF_MARK[mark][name] for mark in self.fields if mark in _OF_MARK)

        def call(self: Any, *arguments: Any) -> Any:
            return machine(self, *arguments)

        return call

    overload(stub)(chosen)
    return stub


def _fields_of(source: Any) -> list[tuple[str, Any]]:
    """The fields of an object in a fixed order; one that has not been set yet is a number."""
    names = sorted({name for cls in type(source).__mro__ for name in getattr(cls, "__slots__", ())})
    return [(name, getattr(source, name, 0.0)) for name in names]


class _Instead(ast.NodeTransformer):
    """Puts expressions in the place of others."""

    def __init__(self, instead: Mapping[str, str]) -> None:
        self._instead = instead

    def visit(self, node: ast.AST) -> Any:
        if isinstance(node, ast.expr) and not isinstance(getattr(node, "ctx", None), ast.Store):
            text = self._instead.get(ast.unparse(node))
            if text is not None:
                return ast.parse(text, mode="eval").body
        return super().visit(node)


class _OnRecords(ast.NodeTransformer):
    """Has methods, properties and lists of objects where the objects are records; leaves out what is never reached."""

    def __init__(self, methods: set[str], attributes: set[str]) -> None:
        self._methods = methods
        self._attributes = attributes

    def visit_Compare(self, node: ast.Compare) -> Any:
        """Compiled, every number is of its class."""
        if isinstance(node.left, ast.Attribute) and node.left.attr == "__class__":
            return ast.Constant(isinstance(node.ops[0], ast.Is))
        return self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> Any:
        """A record has no methods: what calls one calls a function that finds it."""
        self.generic_visit(node)
        if isinstance(node.func, ast.Attribute) and node.func.attr in self._methods:
            node.args.insert(0, node.func.value)
            node.func = ast.Name(_CALL + node.func.attr, ast.Load())
        return node

    def visit_Attribute(self, node: ast.Attribute) -> Any:
        self.generic_visit(node)
        if node.attr in self._attributes:
            return ast.Call(ast.Name(_CALL + node.attr, ast.Load()), [node.value], [])
        return node

    def visit_BoolOp(self, node: ast.BoolOp) -> Any:
        self.generic_visit(node)
        decides = isinstance(node.op, ast.Or)
        left = [value for value in node.values if not _is(value, not decides)]
        if any(_is(value, decides) for value in left):
            return ast.Constant(decides)
        if len(left) > 1:
            node.values = left
            return node
        return left[0] if left else ast.Constant(not decides)

    def visit_If(self, node: ast.If) -> Any:
        self.generic_visit(node)
        if isinstance(node.test, ast.Constant):
            return (node.body if node.test.value else node.orelse) or ast.Pass()
        return node

    def visit_IfExp(self, node: ast.IfExp) -> Any:
        self.generic_visit(node)
        if isinstance(node.test, ast.Constant):
            return node.body if node.test.value else node.orelse
        return node

    def visit_Assign(self, node: ast.Assign) -> Any:
        """An array is taken apart by its elements."""
        self.generic_visit(node)
        target = node.targets[0]
        if len(node.targets) == 2:
            whole = node.targets[1]
            if isinstance(whole, ast.Name):
                taken = ast.Assign([target], ast.Name(whole.id, ast.Load()))
                return [ast.Assign([whole], node.value), self.visit_Assign(taken)]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Name):
            text = node.value.id
            several = [ast.parse(f"{text}[{at}]", mode="eval").body for at in range(len(target.elts))]
            node.value = ast.Tuple(several, ast.Load())
        return node


def _is(node: ast.expr, value: bool) -> bool:
    return isinstance(node, ast.Constant) and node.value is value
