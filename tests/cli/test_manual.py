"""The manual page says of every command what its own help says, and man reads it without a complaint."""

from __future__ import annotations

import gzip
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from hapticd.cli.app import COMMANDS
from hapticd.cli.manual import manual, shared_files
from hapticd.version import __version__
from tests.daemon.running import HAPTICD


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("man") / "hapticd.1"
    path.write_text(manual())
    return path


def read(page: Path) -> str:
    """The page as man shows it on a wide terminal, without bold."""
    if shutil.which("mandoc") is None:
        pytest.skip("missing: mandoc; `make packages` installs it")
    shown = subprocess.run(
        ["mandoc", "-T", "utf8", "-O", "width=400", page], capture_output=True, text=True, check=True
    ).stdout
    plain = subprocess.run(["col", "-b", "-x"], input=shown, capture_output=True, text=True, check=True).stdout
    return plain.replace("\u2010", "-").replace("\u2019", "'")


def test_it_has_no_fault(page: Path) -> None:
    if shutil.which("mandoc") is None:
        pytest.skip("missing: mandoc; `make packages` installs it")
    lint = subprocess.run(["mandoc", "-T", "lint", "-W", "warning", page], capture_output=True, text=True, check=False)
    assert (lint.stdout, lint.returncode) == ("", 0)


def test_its_date_is_that_of_the_version(page: Path) -> None:
    changelog = (Path(__file__).parent.parent.parent / "CHANGELOG.md").read_text()
    released = re.search(rf"^## \[{re.escape(__version__)}\] - (\S+)$", changelog, re.MULTILINE)
    assert released
    assert page.read_text().splitlines()[0] == f'.TH HAPTICD 1 {released[1]} "hapticd {__version__}" "User Commands"'


def test_man_itself_says_nothing_against_it(page: Path) -> None:
    if shutil.which("man") is None:
        pytest.skip("missing: man")
    done = subprocess.run(["man", "--warnings=all", "--local-file", page], capture_output=True, text=True, check=False)
    assert (done.stderr, done.returncode) == ("", 0)
    assert "HAPTICD(1)" in done.stdout


@pytest.mark.parametrize("command", ["fault show", "switch", "study zwidth", "simulate"])
def test_it_says_what_the_help_says(page: Path, command: str) -> None:
    text = "".join(read(page).split())  # the help breaks lines within words too
    shown = subprocess.run(
        [HAPTICD, *command.split(), "--help"], capture_output=True, text=True, check=True, env={"PATH": ""}
    ).stdout
    said, _, options = shown.partition("Options:")
    paragraphs = ["".join(part.split()) for part in said.partition("Arguments:")[0].split("\n\n")[1:]]
    assert len(paragraphs) > 2
    for paragraph in paragraphs:
        assert paragraph in text
    names = re.findall(r"^  (-[^\s,]+(?:, --\S+)?)", options, re.MULTILINE)
    assert len(names) > 1
    for name in names:
        assert name.endswith("--help") or name.replace(" ", "") in text


def test_every_command_is_in_it(page: Path) -> None:
    text = read(page)
    below = {
        "config": ["schema", "show"],
        "keys": ["make", "add", "remove"],
        "service": ["install", "uninstall", "status"],
    }
    for name in [*COMMANDS, "study", "bench"]:
        for command in [name, *(f"{name} {one}" for one in below.get(name, []))]:
            assert f"\n   hapticd {command} " in text


def test_it_is_the_same_every_time_it_is_made() -> None:
    shared = shared_files("site-functions")
    assert shared == shared_files("site-functions")
    assert gzip.decompress(shared["man/man1/hapticd.1.gz"]).decode() == manual()
