"""The house: who may import whom, no circles, how large rooms and modules are, one name a thing.

The layers themselves are import-linter's (pyproject.toml); what it does not look at is here: inside the rooms.
"""

from __future__ import annotations

import ast
import sys
from collections import Counter
from functools import cache
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = {
    "hapticd": ROOT / "hapticd",
    "hapticd_drivers": ROOT / "drivers" / "hapticd_drivers",
    "hapticd_controllers": ROOT / "controllers" / "hapticd_controllers",
    "hapticd_studies": ROOT / "studies" / "hapticd_studies",
    "hapticd_bench": ROOT / "benchmarks" / "hapticd_bench",
    "hapticd_views": ROOT / "views" / "hapticd_views",
}
SOURCES = {name: sorted(folder.rglob("*.py")) for name, folder in PACKAGES.items()}

LONGEST_CHAIN = 13  # down to what is known of shapes: the proxy, its way out, their surface, distance, field
MOST_LINES = 38_300  # raised on purpose only: what a daemon that died was armed with, and a loop that died with it
MOST_LINES_OF_A_MODULE = 400
LARGEST_ROOM = 0.195  # tick: couplings, forces and remote objects are contacts, and need what contacts are made of

LAW_MAY_IMPORT = {"hapticd.law", "hapticd.errors", "hapticd.tick.energy"}
DRIVER_MAY_IMPORT = {"hapticd.driver", "hapticd.device", "hapticd.errors", "hapticd.settings", "hapticd.trace"}
DRIVER_COMMAND_MAY_IMPORT = DRIVER_MAY_IMPORT | {"hapticd.paths", "hapticd.progress", "hapticd.replacing"}
SIMULATED_DRIVER_MAY_IMPORT = DRIVER_MAY_IMPORT | {"hapticd.simulation.driver", "hapticd.simulation.options"}


@cache
def graph(types_too: bool = True) -> grimp.ImportGraph:
    """Every import between modules of ours, those inside functions included."""
    return grimp.build_graph(*PACKAGES, exclude_type_checking_imports=not types_too, cache_dir=None)


def circles() -> list[list[str]]:
    """Strongly connected modules (Tarjan), those that only a type checker sees included."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    path: list[str] = []
    found = []

    def visit(module: str) -> None:
        index[module] = low[module] = len(index)
        path.append(module)
        for imported in graph().find_modules_directly_imported_by(module):
            if imported not in index:
                visit(imported)
            if imported in path:
                low[module] = min(low[module], low[imported])
        if low[module] == index[module]:
            circle = path[path.index(module) :]
            del path[path.index(module) :]
            if len(circle) > 1:
                found.append(circle)

    sys.setrecursionlimit(10_000)
    for module in sorted(graph().modules):
        if module not in index:
            visit(module)
    return found


@cache
def longest_chain(module: str) -> tuple[str, ...]:
    """The longest way down from a module, as a program takes it."""
    ways = [longest_chain(imported) for imported in graph(False).find_modules_directly_imported_by(module)]
    return (module, *max(ways, key=len, default=()))


def lines(path: Path) -> int:
    return len(path.read_text().splitlines())


def test_no_modules_import_each_other_in_a_circle() -> None:
    assert circles() == []


def test_a_circle_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    made = grimp.build_graph("hapticd", cache_dir=None)
    made.add_import(importer="hapticd.errors", imported="hapticd.config.file")
    monkeypatch.setattr(sys.modules[__name__], "graph", lambda: made)
    assert {"hapticd.errors", "hapticd.config.file"} <= set(circles()[0])


def test_the_longest_way_down_is_short() -> None:
    chain = max((longest_chain(module) for module in graph(False).modules if module.startswith("hapticd.")), key=len)
    assert len(chain) <= LONGEST_CHAIN, " -> ".join(chain)


def test_the_house_and_its_rooms_keep_their_size() -> None:
    rooms = Counter[str]()
    for path in SOURCES["hapticd"]:
        place = path.relative_to(PACKAGES["hapticd"]).parts
        rooms[place[0] if len(place) > 1 else ""] += lines(path)
    total = rooms.total()
    assert total <= MOST_LINES
    room, largest = rooms.most_common(1)[0]
    assert largest < LARGEST_ROOM * total, f"{room}: {largest} of {total} lines"


def test_a_long_module_says_why_it_is_one() -> None:
    for path in [path for paths in SOURCES.values() for path in paths]:
        if lines(path) > MOST_LINES_OF_A_MODULE:
            said = ast.get_docstring(ast.parse(path.read_text())) or ""
            assert "in one module" in said, (
                f"{path.relative_to(ROOT)}: {lines(path)} lines, and no reason in its docstring"
            )


@pytest.mark.parametrize("package", PACKAGES)
def test_typer_is_imported_by_command_modules_only(package: str) -> None:
    commands = {"hapticd": PACKAGES["hapticd"] / "cli"}.get(package, PACKAGES[package] / "commands")
    for path in SOURCES[package]:
        names = {
            alias.name if isinstance(node, ast.Import) else node.module or ""
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Import | ast.ImportFrom)
            for alias in node.names
        }
        if any(name.split(".")[0] == "typer" for name in names):
            assert path.is_relative_to(commands), f"{path.relative_to(ROOT)} imports typer"


@pytest.mark.parametrize("package", ["hapticd_controllers", "hapticd_drivers"])
def test_plug_ins_import_only_what_is_public(package: str) -> None:
    allowed = {
        "hapticd_controllers": LAW_MAY_IMPORT,
        "hapticd_drivers": DRIVER_MAY_IMPORT,
    }[package]
    for module in sorted(graph().modules):
        if module.split(".")[0] == package:
            may = SIMULATED_DRIVER_MAY_IMPORT if module == "hapticd_drivers.loopback" else allowed
            if module.startswith("hapticd_drivers.commands."):
                may = DRIVER_COMMAND_MAY_IMPORT
            imported = graph().find_modules_directly_imported_by(module)
            ours = {name for name in imported if name.split(".")[0] != package}
            assert ours <= may, f"{module} imports {', '.join(sorted(ours - may))}"


def test_no_class_of_the_daemon_has_the_name_of_another_one() -> None:
    """`Params` and `State` are what every law calls them."""
    names = Counter(
        node.name
        for path in SOURCES["hapticd"]
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    assert [name for name, count in names.items() if count > 1 and name not in ("Params", "State")] == []
