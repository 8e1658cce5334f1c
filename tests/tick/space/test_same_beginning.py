"""The tick of walls and the tick in space see a sample alike; a call shared by both would cost the one of walls."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable
from typing import Any

from hapticd.tick.space.tick import SpaceTick
from hapticd.tick.tick import ControlTick


def seen(step: Callable[..., Any]) -> list[str]:
    """The statements of a tick up to where it looks at contacts, without its docstring."""
    (function,) = ast.parse(textwrap.dedent(inspect.getsource(step))).body
    assert isinstance(function, ast.FunctionDef)
    statements = [ast.unparse(statement) for statement in function.body[1:]]
    return statements[: next(at for at, each in enumerate(statements) if each.startswith("if dt_s > 0.0"))]


def walls(step: Callable[..., Any]) -> str:
    """How a tick goes through its walls with a new sample."""
    source = ast.unparse(ast.parse(textwrap.dedent(inspect.getsource(step))))
    return source[source.index("for contact in self._active:") : source.index("contact.x_m = x_m")]


def test_faults_repeated_samples_and_ramps_are_treated_alike() -> None:
    assert seen(SpaceTick.step_in_space) == seen(ControlTick.step)
    assert len(seen(ControlTick.step)) > 10


def test_walls_are_walked_through_alike() -> None:
    assert walls(SpaceTick.step_in_space) == walls(ControlTick.step)
    assert "contact.observe(" in walls(ControlTick.step)
