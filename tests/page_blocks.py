"""The fenced blocks of a page, a section at a time, and what it means to do what they say.

The file is both a module of the tests and the program of the process that runs a section: there it imports nothing of
the checkout.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

PROGRAMS = {"python", "pytest", "hapticd"}


@dataclass(frozen=True)
class Block:
    """One fenced block: its language, its text, and the line of the page on which the text begins."""

    language: str
    text: str
    line: int


def sections(page: str) -> dict[str, list[Block]]:
    """The blocks below each heading of the second level."""
    found: dict[str, list[Block]] = {}
    title, language, lines, begun = "", None, list[str](), 0
    for number, line in enumerate(page.splitlines(), 1):
        if language is None and line.startswith("## "):
            title = line.removeprefix("## ")
            found[title] = []
        elif language is None and line.startswith("```"):
            language, lines, begun = line.removeprefix("```"), [], number + 1
        elif language is not None and line == "```":
            found.setdefault(title, []).append(Block(language, "".join(f"{each}\n" for each in lines), begun))
            language = None
        elif language is not None:
            lines.append(line)
    return found


def program(blocks: list[Block]) -> tuple[str, str]:
    """This file's source, for `python -c`, and the blocks that it reads from its standard input."""
    return Path(__file__).read_text(), json.dumps([asdict(block) for block in blocks])


def run(blocks: list[Block]) -> None:
    """Do what the blocks of a section say, in the working directory and in one namespace.

    A block that begins with `# folder/name.ext` is a file and is written. Other Python is executed; what a line
    `print(...)  # text` promises must be printed by its block. In a `console` block each line `$ program ...` is run.
    """
    namespace: dict[str, Any] = {"__name__": "__main__"}
    for block in blocks:
        named = re.match(r"# (\w[\w/-]*\.\w+)\n", block.text)
        if named:
            path = Path(named[1])
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text)
        elif block.language == "python":
            _execute(block, namespace)
        elif block.language == "console":
            for line in block.text.splitlines():
                if line.startswith("$ "):
                    _command(line.removeprefix("$ "), block)


def _execute(block: Block, namespace: dict[str, Any]) -> None:
    source = "\n" * (block.line - 1) + block.text  # a traceback then names the page's own line
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(source, "docs/python.md", "exec"), namespace)
    promised = re.findall(r"^ *print\(.*\)  # (.*)$", block.text, re.MULTILINE)
    missing = [text for text in promised if text not in printed.getvalue().splitlines()]
    if missing:
        sys.exit(f"docs/python.md:{block.line}: {missing} is not what is printed, which is\n{printed.getvalue()}")


def _command(line: str, block: Block) -> None:
    name, *arguments = line.split()
    if name == "export":
        key, _, value = line.removeprefix("export ").partition("=")
        os.environ[key] = os.pathsep.join([value.replace("$PWD", str(Path.cwd())), os.environ.get(key, "")])
        return
    if name not in PROGRAMS:
        sys.exit(f"docs/python.md:{block.line}: {line}: a console block runs {', '.join(sorted(PROGRAMS))} only")
    command = [sys.executable, *([] if name == "python" else ["-m", name]), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"docs/python.md:{block.line}: {line}: exit {done.returncode}\n{done.stdout}{done.stderr}")


if __name__ == "__main__":
    run([Block(**block) for block in json.load(sys.stdin)])
