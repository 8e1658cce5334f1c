"""Each fault of 0.1 that `docs/lessons.md` lists has a test that begins with its number, and no other has one."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parent.parent


def test_each_number_of_the_page_begins_a_test_and_each_such_test_is_on_the_page() -> None:
    listed = re.findall(r"^\| ([CST]\d+) \|", (ROOT / "docs" / "lessons.md").read_text(), re.MULTILINE)
    assert len(listed) == len(set(listed)) == 14 + 10 + 12
    assert {number for path in ROOT.glob("tests/**/test_*.py") for number in numbers(path)} == set(listed)


def numbers(path: Path) -> set[str]:
    """Those with which docstrings of a file's tests begin."""
    tests = [
        node
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    ]
    found = (re.match(r"([CST]\d+)[:.]", ast.get_docstring(test) or "") for test in tests)
    return {match[1] for match in found if match}
