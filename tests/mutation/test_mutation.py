"""The tests notice what goes wrong: slips drawn at random, each in a copy of the tree, and the room's own tests."""

from __future__ import annotations

import ast
import importlib
import os
from pathlib import Path

import pytest

from tests.mutation.harmless import EQUAL
from tests.mutation.rooms import LAWS, LEFT, REACHING, ROOMS, Room
from tests.mutation.running import ROOT, judge, sample, told
from tests.mutation.slips import slips
from tests.mutation.warm import swap

SEED = int(os.environ.get("SEED", "1"))
NIGHTLY_SLIPS = 40
LEAST_SHARE = 0.95

QUICK = {
    "guard": Room(("hapticd/tick/guard.py",), ("tests/tick/test_guard.py",)),
    "energy": Room(("hapticd/tick/energy.py",), ("tests/tick/test_energy.py",), "not day"),
}


@pytest.mark.parametrize(("name", "seed"), [("guard", 17), ("energy", 87)])
def test_every_slip_of_a_small_sample_is_found(name: str, seed: int) -> None:
    """Six of each, always the same ones, by the tests of the module alone; the one that changes nothing lives."""
    verdict = judge(QUICK[name], sample(QUICK[name], 6, seed))
    assert verdict.made == 6
    assert not verdict.survivors, told(verdict.survivors)
    assert len(verdict.harmless) == 1


@pytest.mark.nightly
@pytest.mark.timeout(6 * 3600)
@pytest.mark.parametrize("name", ROOMS)
def test_nearly_every_slip_is_found(name: str) -> None:
    verdict = judge(ROOMS[name], sample(ROOMS[name], NIGHTLY_SLIPS, SEED))
    assert verdict.share_found >= LEAST_SHARE, f"{name} at seed {SEED}: {verdict}\n{told(verdict.survivors)}"


def test_every_law_has_its_slips() -> None:
    laws = (ROOT / "controllers" / "hapticd_controllers").glob("[a-z]*.py")
    assert sorted((*LAWS, "cycle_sums", "felt_mass")) == sorted(law.stem for law in laws)


def test_every_module_that_reaches_a_hand_is_in_a_room_or_it_is_said_why_not() -> None:
    there = {str(file.relative_to(ROOT)) for place in REACHING for file in (ROOT / place).rglob("[a-z]*.py")}
    judged = {file for room in ROOMS.values() for file in room.files}
    assert there - judged == {file for files in LEFT.values() for file in files}
    assert {file for file in judged if not (ROOT / file).is_file()} == set()
    tests = {test for room in ROOMS.values() for test in room.tests}
    assert {test for test in tests if not (ROOT / test).exists()} == set()


def test_what_is_named_harmless_is_a_slip_that_there_is() -> None:
    """A line that was changed is looked at anew."""
    named = [slip for named in EQUAL.values() for slip in named]
    there = {str(slip) for file in {slip.split(":")[0] for slip in named} for slip in slips(ROOT, file)}
    assert [slip for slip in named if slip not in there] == []
    assert len(named) == len(set(named))


SOURCE = '''
LIMIT = 2.5
def larger(a: float, b: int = 3) -> float:
    """The larger of two."""
    if a < b:
        raise ValueError(f"{a + 1} is too small")
    return max(a, b)
'''


def test_a_file_has_the_slips_of_its_functions_and_numbers(tmp_path: Path) -> None:
    """And none in what it says, in its annotations or in what it tells people."""
    (tmp_path / "some.py").write_text(SOURCE)
    found = slips(tmp_path, "some.py")
    assert [slip.what for slip in found] == [
        "def larger  [without if a < b:]",
        "def larger  [without return max(a, b)]",
        "LIMIT = 2.5  [2.5 is 5.0]",
        "if a < b:  [without raise ValueError(f'{a + 1} is too small')]",
        "if a < b:  [turned round]",
        "if a < b:  [Lt 0 is LtE]",
        "if a < b:  [Lt 0 is Gt]",
        "return max(a, b)  [min]",
    ]
    for slip in found:
        mutant = slip.into(SOURCE)
        assert mutant != ast.unparse(ast.parse(SOURCE)) + "\n"
        assert len([line for line in slip.diff(SOURCE).splitlines() if line.startswith(("-", "+"))]) >= 3


def test_what_has_been_imported_gets_the_code_of_a_slip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Under whatever name it is known, and in a class."""
    file = tmp_path / "swapped_one.py"
    file.write_text("class A:\n    def twice(self, x):\n        return 2 * x\n\ndef once(x):\n    return x\n")
    monkeypatch.syspath_prepend(tmp_path)
    module = importlib.import_module("swapped_one")
    once, a = module.once, module.A()
    before = file.read_text()
    file.write_text(before.replace("2 * x", "3 * x").replace("    return x", "    return -x"))
    swap(file, before)
    assert (once(1), a.twice(1)) == (-1, 3)
