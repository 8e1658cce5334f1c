"""Real shells complete command lines of hapticd, from where `make install` puts what they need."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from hapticd.cli.completion import VARIABLE, Shell, script, words
from hapticd.cli.manual import shared_files
from tests.daemon.running import HAPTICD, PATIENCE_S

CASES = [
    ("hapticd sw", "hapticd switch "),
    ("hapticd switch input", "hapticd switch input-to-state "),
    ("hapticd study zw", "hapticd study zwidth "),
    ("hapticd simulate --dur", "hapticd simulate --duration "),
    ("hapticd check fi", "hapticd check file.toml "),
]
START = {
    "bash": "--norc --noprofile -i",
    "zsh": "-f -i",
}
SET_UP = {
    "bash": "source /usr/share/bash-completion/bash_completion; PS1='ready>'\n",
    "zsh": (
        "fpath=($SHARE/zsh/site-functions $fpath); autoload -Uz compinit; compinit -u -D; "
        "unsetopt zle_bracketed_paste; PS1='ready>'\n"
    ),
}


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """Of a shell on a computer on which hapticd is installed, in a directory with one file."""
    for name, content in shared_files("site-functions").items():
        path = tmp_path / "share" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    (tmp_path / "work").mkdir()
    (tmp_path / "work/file.toml").touch()
    return {
        "PATH": f"{Path(HAPTICD).parent}:/usr/bin:/bin",
        "HOME": str(tmp_path),
        "TERM": "dumb",
        "SHARE": str(tmp_path / "share"),
        "XDG_DATA_DIRS": f"{tmp_path}/share:/usr/local/share:/usr/share",
    }


def needs(*programs: str) -> None:
    missing = [name for name in programs if shutil.which(name) is None and not Path(name).exists()]
    if missing:
        pytest.skip(f"missing: {', '.join(missing)}; `make packages` installs them")


class Terminal:
    """A shell in a terminal, which is typed at."""

    def __init__(self, shell: str, environment: dict[str, str], directory: Path) -> None:
        self.pid, self._line = pty.fork()
        if self.pid == 0:
            os.chdir(directory)
            os.execvpe(shell, [shell, *START[shell].split()], environment)
        self.shown = ""
        self.type(SET_UP[shell])
        self.wait_for("ready>", times=2)  # once as it was typed

    def type(self, text: str) -> None:
        os.write(self._line, text.encode())

    def wait_for(self, text: str, times: int = 1) -> None:
        end_s = time.monotonic() + PATIENCE_S
        while self.shown.count(text) < times:
            assert time.monotonic() < end_s, f"no {text!r} in {self.shown!r}"
            if select.select([self._line], [], [], 0.1)[0]:
                self.shown += os.read(self._line, 4096).decode(errors="replace").replace("\x07", "").replace("\r", "")

    def close(self) -> None:
        os.kill(self.pid, 9)
        os.waitpid(self.pid, 0)
        os.close(self._line)


@contextlib.contextmanager
def terminal(shell: str, environment: dict[str, str], directory: Path) -> Iterator[Terminal]:
    opened = Terminal(shell, environment, directory)
    try:
        yield opened
    finally:
        opened.close()


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_the_tabulator_completes_a_line(shell: str, environment: dict[str, str], tmp_path: Path) -> None:
    needs(shell, "/usr/share/bash-completion/bash_completion")
    with terminal(shell, environment, tmp_path / "work") as line:
        for typed, completed in CASES:
            line.shown = ""
            line.type(f"{typed}\t")
            line.wait_for(completed)
            line.type("\x15")  # forget that line


def test_fish_completes_a_line(environment: dict[str, str], tmp_path: Path) -> None:
    needs("fish")
    for typed, completed in CASES[1::3]:
        done = subprocess.run(
            [
                "fish",
                "--no-config",
                "-c",
                f"source $SHARE/fish/vendor_completions.d/hapticd.fish; complete -C '{typed}'",
            ],
            cwd=tmp_path / "work",
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        found = [line.split("\t")[0] for line in done.stdout.splitlines()]
        assert found == [completed.split()[-1]], done.stderr


@pytest.mark.parametrize("shell", list(Shell))
def test_the_command_prints_what_is_installed(shell: Shell) -> None:
    done = subprocess.run([HAPTICD, "completion", shell], capture_output=True, text=True, check=True)
    assert done.stdout == script(shell)
    assert script(shell).encode() in shared_files("site-functions").values()


@pytest.mark.parametrize(
    ("environment", "before"),
    [
        ({"COMP_WORDS": "hapticd switch td", "COMP_CWORD": "2"}, ["switch"]),
        ({"COMP_WORDS": "hapticd ", "COMP_CWORD": "1"}, []),
        ({"_TYPER_COMPLETE_ARGS": "hapticd switch "}, ["switch"]),
        ({"_TYPER_COMPLETE_ARGS": "hapticd switch"}, []),
        ({"_TYPER_COMPLETE_ARGS": "hapticd switch 'td"}, ["switch"]),
        ({}, []),
    ],
)
def test_the_word_under_the_cursor_is_no_command_yet(environment: dict[str, str], before: list[str]) -> None:
    assert words([], {VARIABLE: "complete_bash", **environment}) == before
    assert words(["run"], {}) == ["run"]
