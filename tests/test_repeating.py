"""Repeats: what runs again and what does not, what is counted, and how a stopped run goes on."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from tests.content import Content
from tests.repeating import Repeating
from tests.standstill import PLACE
from tests.tally import Tally

ROOT = Path(__file__).parent.parent

CONFTEST = """
from pathlib import Path
import pytest
from tests.repeating import Repeating
from tests.tally import Tally
def pytest_configure(config):
    config.pluginmanager.register(Repeating(Tally(Path("tally"), lambda test: "one"), 5))
@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol():
    with open("runs", "a") as file:
        file.write("<")
    return (yield)
"""

# What is called as a daemon is started counts as one.
TESTS = """
import os, subprocess
import pytest
def note(name):
    with open("runs", "a") as file:
        file.write(name)
    return open("runs").read().count(name)
def start():
    return subprocess.Popen(["sh", "-c", "read line", "hapticd", "run"], stdin=subprocess.PIPE)
@pytest.fixture(scope="class")
def shared():
    with start() as process:
        yield
        process.communicate(b"\\n")
def test_with_one():
    with start() as process:
        process.communicate(b"\\n")
    if note("a") == 3 and os.environ["END"] == "yes":
        os._exit(3)
def test_with_none():
    note("b")
class TestShared:
    def test_with_a_shared_one(self, shared):
        note("c")
    def test_with_the_same_one_and_its_end(self, shared):
        note("e")
def test_that_fails_at_last():
    with start() as process:
        process.communicate(b"\\n")
    assert note("d") != 4
"""


def runs(place: Path, end: str) -> tuple[str, str]:
    """What pytest has said, and a letter for each run of a test, `<` where a time limit for it would begin."""
    (place / "runs").write_text("")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir=.", "."]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "END": end}
    environment.pop(PLACE, None)  # what is to fail must not be excused since this computer crawls
    done = subprocess.run(command, cwd=place, env=environment, capture_output=True, text=True, check=False)
    return done.stdout, (place / "runs").read_text()


def test_a_stopped_run_goes_on_with_what_has_run_least(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_it.py").write_text(TESTS)
    assert runs(tmp_path, "yes")[1] == "<" + 3 * "<a"  # the third was not ended, so it does not count
    said, letters = runs(tmp_path, "no")
    assert letters == "<<b" + "<" + 5 * "<c" + "<" + 5 * "<e" + "<" + 4 * "<d" + "<" + 3 * "<a"
    assert "in run 4 of 5" in said
    assert "4 tests start a daemon" in said
    assert "2 or more: 3 tests" in said
    assert "test_it.py::test_that_fails_at_last: 1 times, then passed 0" in said
    said, letters = runs(tmp_path, "no")
    assert letters == "<" + 4 * "<d"  # a test that failed begins anew, and all others have done
    assert "test_it.py::test_that_fails_at_last: 2 times, then passed 0" in said


def test_files_take_turns(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(CONFTEST)
    for name in "ab":
        note = f"open('runs', 'a').write('{name}')"
        (tmp_path / f"test_{name}.py").write_text("".join(f"def test_{at}(): {note}\n" for at in range(3)))
    assert runs(tmp_path, "no")[1].replace("<", "") == "ababab"


def test_only_runs_of_the_same_version_count(tmp_path: Path) -> None:
    tally = Tally(tmp_path / "tally", lambda test: "one")
    for passed in (True, False, True, True):
        tally.add("test_it", passed=passed, daemon=True)
    again = Tally(tmp_path / "tally", lambda test: "one")
    assert (again.passes("test_it"), again.done("test_it", 2), again.done("test_it", 3)) == (2, True, False)
    assert Tally(tmp_path / "tally", lambda test: "two").passes("test_it") == 0


def test_what_is_kept_goes_on_counting_on_another_computer(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    tally = Tally(tmp_path / "tally", lambda test: "one", kept)
    for passed in (True, False, True, True):
        tally.add("test_it", passed=passed, daemon=True)
    tally.add("test_without_a_daemon", passed=True, daemon=False)
    tally.keep()
    other = Tally(tmp_path / "other", lambda test: "one", kept)
    other.add("test_it", passed=True, daemon=True)
    other.keep()
    assert not (tmp_path / "tally").exists()
    last = Tally(tmp_path / "last", lambda test: "one", kept)
    assert (last.passes("test_it"), last.passes("test_without_a_daemon")) == (3, 0)
    assert "  test_it: 1 times, then passed 3" in last.lines()
    assert Tally(tmp_path / "last", lambda test: "two", kept).passes("test_it") == 0


def test_what_other_versions_have_passed_since_a_failure_is_said_besides(tmp_path: Path) -> None:
    def opened(version: str) -> Tally:
        return Tally(tmp_path / "tally", lambda test: version, tmp_path / "kept")

    for version, passed in (("one", True), ("one", False), ("one", True), ("two", True), ("three", True)):
        tally = opened(version)
        tally.add("test_it", passed=passed, daemon=True)
        if version != "three":
            tally.keep()
    assert opened("three").lines() == [
        "1 tests start a daemon; runs that passed in a row beside a busy processor:",
        "  1 or more: 1 tests",
        "those of other versions with them:",
        "  2 or more: 1 tests",
        "0 tests have failed",
    ]
    unbegun = opened("four")
    assert (unbegun.begun(), unbegun.done("test_it", 1)) == (False, False)


@pytest.mark.parametrize(("begun", "code"), [(True, pytest.ExitCode.OK), (False, pytest.ExitCode.NO_TESTS_COLLECTED)])
def test_that_all_have_run_often_enough_is_no_failure(tmp_path: Path, begun: bool, code: pytest.ExitCode) -> None:
    tally = Tally(tmp_path / "tally", lambda test: "one")
    if begun:
        tally.add("test_it", passed=True, daemon=True)
    session: Any = SimpleNamespace(exitstatus=pytest.ExitCode.NO_TESTS_COLLECTED)
    repeating = cast("Repeating", SimpleNamespace(_tally=tally))
    Repeating.pytest_sessionfinish(repeating, session, session.exitstatus)
    assert session.exitstatus == code


CHECKOUT = {
    "hapticd/loop.py": "",
    "docs/laws.md": "",
    "config/hapticd.toml": "",
    "tests/conftest.py": "from tests.dealing import Dealing",
    "tests/dealing.py": "",
    "tests/drivers/conftest.py": "from . import lab",
    "tests/drivers/lab.py": "import tests.drivers.wire",
    "tests/drivers/wire.py": "",
    "tests/drivers/frames.json": "",
    "tests/drivers/test_rig.py": "from tests.drivers.contract import Contract",
    "tests/drivers/contract.py": "",
    "tests/drivers/test_other.py": "",
    "tests/test_page.py": "PAGE = 'docs/laws.md'",
}
RIG, PAGE = "tests/drivers/test_rig.py::test_it", "tests/test_page.py::test_it[1]"


@pytest.mark.parametrize(
    ("changed", "changes"),
    [
        ("hapticd/loop.py", {RIG, PAGE}),
        ("hapticd/new.py", {RIG, PAGE}),
        ("config/hapticd.toml", {RIG, PAGE}),
        ("tests/conftest.py", {RIG, PAGE}),
        ("tests/drivers/frames.json", {RIG, PAGE}),
        ("tests/drivers/test_rig.py", {RIG}),
        ("tests/drivers/contract.py", {RIG}),
        ("tests/drivers/wire.py", {RIG}),
        ("docs/laws.md", {PAGE}),
        ("tests/drivers/test_other.py", set()),
        ("tests/dealing.py", set()),
        ("build/repeats.jsonl", set()),
        ("docs/repeats.jsonl", set()),
        ("docs/repeats.md", set()),
    ],
)
def test_a_test_is_of_another_version_after_a_change_of_what_it_depends_on(
    tmp_path: Path, changed: str, changes: set[str]
) -> None:
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    for name, text in {**CHECKOUT, ".gitignore": "build"}.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text + "\n")
    before = {test: Content(tmp_path).of(test) for test in (RIG, PAGE)}
    assert before == {test: Content(tmp_path).of(test) for test in (RIG, PAGE)}
    (tmp_path / changed).parent.mkdir(exist_ok=True)
    with (tmp_path / changed).open("a") as file:
        file.write("# changed\n")
    assert {test for test in (RIG, PAGE) if Content(tmp_path).of(test) != before[test]} == changes
