"""What a test depends on: the product as it is, its own file and what that reads of the tests, one digest of all."""

from __future__ import annotations

import ast
import hashlib
import subprocess
from functools import cached_property
from pathlib import Path

FIRST = "tests/conftest.py"
KEPT = "docs/repeats.jsonl"
SAID = "docs/repeats.md"
"""How often tests have run, and what is said of it: no test depends on either."""


class Content:
    """A checkout as it lies there, changes that are not committed and new files included.

    Args:
        root: its directory.
    """

    def __init__(self, root: Path) -> None:
        self._root = root
        self._digests: dict[str, str] = {}

    def of(self, test: str) -> str:
        """A digest that changes with what a test depends on.

        That is every file outside `tests`, and in `tests` the test's file, all that it imports, the conftest.py above
        them and what is no Python; but not how tests are dealt out and counted, which the first conftest.py imports.
        Pages count for a test whose files name one.

        Args:
            test: pytest's name for it, which begins with its file.
        """
        file = test.partition("::")[0]
        if file not in self._digests:
            tests = self._imported(file)
            pages = any(b".md" in (self._root / name).read_bytes() for name in tests)
            counted = [name for name in self._files if name in tests or self._counts(name, pages)]
            lines = "".join(f"{self._sums[name]} {name}\n" for name in counted)
            self._digests[file] = hashlib.sha256(lines.encode()).hexdigest()[:20]
        return self._digests[file]

    @staticmethod
    def _counts(name: str, pages: bool) -> bool:
        if name in {KEPT, SAID}:
            return False
        if name.endswith(".md"):
            return pages
        return not (name.startswith("tests/") and name.endswith(".py"))

    @cached_property
    def _files(self) -> list[str]:
        words = ("ls-files", "-z", "--cached", "--others", "--exclude-standard")
        listed = subprocess.run(["git", *words], cwd=self._root, capture_output=True, check=True).stdout
        return sorted(name for name in set(listed.decode().split("\0")) if (self._root / name).is_file())

    @cached_property
    def _sums(self) -> dict[str, str]:
        return {name: hashlib.sha256((self._root / name).read_bytes()).hexdigest() for name in self._files}

    def _imported(self, file: str) -> set[str]:
        """A file of the tests and those that it needs, by import or as the conftest.py of a directory."""
        known: set[str] = set()
        new = {file}
        while new:
            name = new.pop()
            if name in known or name not in self._sums:
                continue
            known.add(name)
            place = Path(name)
            new |= {f"{folder}/{always}" for folder in place.parents for always in ("conftest.py", "__init__.py")}
            if name == FIRST:
                continue
            for module in _modules(place, (self._root / name).read_text()):
                new |= {f"{module}.py", f"{module}/__init__.py"}
        return known


def _modules(place: Path, text: str) -> set[str]:
    """The modules of the tests that a text imports, as paths without an ending; some are names in a module."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            package = list(place.parts[: len(place.parts) - node.level]) if node.level else []
            module = ".".join([*package, *(node.module or "").split(".")]).strip(".")
            found |= {module, *(f"{module}.{alias.name}" for alias in node.names)}
    return {name.replace(".", "/") for name in found if name.partition(".")[0] == "tests"}
