"""The binding against what others say of the SDK: a mistake that the table and the fake share shows only there.

Two witnesses are written by others and are no part of this project. Point $HAPTICD_DRD_HEADER to `drdc.h` of an SDK,
and install `forcedimension-core` (another binding; it is read, never imported); each is heard where it is there.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import pytest

from hapticd_drivers.forcedimension.prototypes import PROTOTYPES
from tests.drivers.forcedimension.building import SOURCES

HEADER = "HAPTICD_DRD_HEADER"

FUNCTION = re.compile(r"^F\((.*?), (\w+)(?:, (.*))?\)$", re.MULTILINE)


def declared() -> list[tuple[str, str, str]]:
    """Result, name and arguments of each function, as the fake has them."""
    return FUNCTION.findall((SOURCES / "functions.h").read_text())


def differing(header: Path) -> list[str]:
    """The functions that a header declares otherwise, or not at all."""
    done = subprocess.run(
        [*("g++", "-std=c++17", "-fsyntax-only", f'-DHEADER="{header}"'), SOURCES / "witness.cpp"],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "LC_ALL": "C"},
    )
    other = set(re.findall(r"differs: (\w+)", done.stderr)) | set(re.findall(r"'(d[hr]d\w+)' was not", done.stderr))
    assert bool(other) == bool(done.returncode), done.stderr
    return sorted(other)


def header_of(functions: list[tuple[str, str, str]], file: Path) -> Path:
    """A header as the vendor writes them: with names, default arguments, and matrices for what is nine numbers."""
    lines = ["typedef unsigned char uchar; typedef unsigned short ushort; typedef unsigned int uint;", 'extern "C" {']
    for result, name, arguments in functions:
        kinds = [kind.strip() for kind in arguments.split(",") if kind.strip()]
        if name.endswith("Frame"):
            kinds[3] = "double (*)[3]"
        named = [f"{kind} = -1" if kind == "char" else kind for kind in kinds]
        lines.append(f"{result} {name}({', '.join(named)});")
    file.write_text("\n".join([*lines, "}", ""]))
    return file


def test_the_fake_exports_what_the_driver_binds_and_no_other_function_of_the_sdk(fake_sdk: Path) -> None:
    names = []
    for library in ("libdhd.so.3", "libdrd.so.3"):
        command = ["nm", "-D", "--defined-only", str(fake_sdk / library)]
        names += subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    assert {name for name in names if name.startswith(("dhd", "drd"))} == set(PROTOTYPES)


def test_a_header_that_agrees_is_heard_to_agree(tmp_path: Path) -> None:
    assert len(declared()) == len(PROTOTYPES)
    assert differing(header_of(declared(), tmp_path / "drdc.h")) == []


@pytest.mark.parametrize(
    ("name", "result", "arguments"),
    [
        ("dhdEnableForce", "int", "bool, char"),
        ("dhdSetBrakes", "int", "char"),
        ("dhdGetButtonMask", "int", "char"),
        ("drdStop", "int", "int, char"),
        ("dhdGetSerialNumber", "int", "unsigned int *, char"),
    ],
)
def test_a_header_that_differs_is_heard_to_differ(tmp_path: Path, name: str, result: str, arguments: str) -> None:
    functions = [one if one[1] != name else (result, name, arguments) for one in declared()]
    assert differing(header_of(functions, tmp_path / "drdc.h")) == [name]
    without = [one for one in declared() if one[1] != name]
    assert differing(header_of(without, tmp_path / "drdc.h")) == [name]


def assigned(source: str) -> Iterator[tuple[str, int]]:
    """Name and number of arguments of each function that a binding declares: `library.name.argtypes = [...]`."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Assign(
                targets=[ast.Attribute(value=ast.Attribute(attr=name), attr="argtypes")], value=ast.List(elts=kinds)
            ):
                yield name, len(kinds)


def test_other_witnesses_agree_where_they_are_there(tmp_path: Path) -> None:
    """Without any, on a header of our own: then this says no more than the tests above."""
    assert differing(Path(os.environ.get(HEADER) or header_of(declared(), tmp_path / "drdc.h"))) == []
    others = {
        name: count
        for distribution in metadata.distributions(name="forcedimension-core")
        for file in distribution.files or []
        if file.suffix == ".py"
        for name, count in assigned(file.read_text())
    }
    ours = {name: len(kinds) - 1 for name, kinds in PROTOTYPES.items() if len(kinds) > 1}
    assert {name: others.get(name, count) for name, count in ours.items()} == ours
