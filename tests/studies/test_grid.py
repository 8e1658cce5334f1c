"""What a study has done survives whatever ends it, and nobody can tell from the output that it was interrupted."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.errors import ConfigError, HapticdError, InstanceError
from hapticd_studies.grid.job import Job, block_cells, block_sizes, in_order
from hapticd_studies.grid.journal import Journal, Row
from hapticd_studies.grid.output import as_csv, as_json, require_extra, require_folder, require_memory, write
from hapticd_studies.grid.run import InterruptedStudyError, kept, run

ROOT = Path(__file__).parents[2]
BLOCKS = 40
DONE = 4
"""Blocks that are done before the gate is opened."""


def work(spec: dict[str, Any], block: int, threads: int | None) -> list[Row]:
    """Rows that every process makes alike, and a line that says who made them; all but a few wait for the gate."""
    with Path(spec["diary"]).open("a") as diary:
        diary.write(f"{os.getpid()} {block}\n")
    while block >= DONE and not Path(spec["gate"]).exists():
        time.sleep(0.005)
    return [[block / spec["divisor"], float("nan"), int(cell)] for cell in range(2)]


def job(folder: Path, divisor: float) -> Job:
    spec = {"diary": str(folder / "diary"), "gate": str(folder / "gate"), "divisor": divisor}
    return Job(work, spec, (2,) * BLOCKS, ())


def diary(folder: Path) -> list[list[str]]:
    return [line.split() for line in (folder / "diary").read_text().splitlines()]


def do(folder: Path, divisor: float = 3.0) -> list[list[Row]]:
    with kept(job(folder, divisor), folder / "journal") as journal:
        return run(job(folder, divisor), journal, "test")


def read(path: Path, fingerprint: str, fresh: bool = False) -> dict[int, list[Row]]:
    journal = Journal(path, fingerprint, fresh)
    journal.close()
    return journal.done


@contextmanager
def started(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """The study in a process of its own, which waits at the gate in the middle of a block."""
    script = f"from pathlib import Path; from tests.studies.test_grid import do; do(Path({str(folder)!r}))"
    with subprocess.Popen([sys.executable, "-c", script], cwd=ROOT, stderr=subprocess.PIPE, text=True) as process:
        try:
            while not (folder / "diary").exists() or len(diary(folder)) <= DONE:
                assert process.poll() is None, process.communicate()
                time.sleep(0.01)
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_what_was_done_before_a_kill_is_not_done_again(tmp_path: Path, number: signal.Signals) -> None:
    with started(tmp_path) as process:
        process.send_signal(number)
        process.communicate(timeout=60)
    (tmp_path / "gate").touch()

    rows = do(tmp_path)

    after = [block for pid, block in diary(tmp_path) if pid == str(os.getpid())]
    assert after == [str(block) for block in range(DONE, BLOCKS)]
    assert [[row[0], row[2]] for row in rows[2]] == [[2 / 3.0, 0], [2 / 3.0, 1]]
    assert [[row[0], row[2]] for row in rows[7]] == [[7 / 3.0, 0], [7 / 3.0, 1]]
    assert len(rows) == BLOCKS
    assert not (tmp_path / "journal").exists()


def test_an_interrupt_says_what_is_kept_and_where(tmp_path: Path) -> None:
    with started(tmp_path) as process:
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert f"interrupted: {2 * DONE} of {2 * BLOCKS} cells are kept in {tmp_path / 'journal'}" in said
    assert "the same command goes on from there" in said
    assert (tmp_path / "journal").exists()
    assert InterruptedStudyError.exit_code == 130


def test_a_line_that_was_cut_off_is_dropped_and_those_before_it_count(tmp_path: Path) -> None:
    path = tmp_path / "journal"
    journal = Journal(path, "study")
    journal.keep(0, [[0.1, 2.0]])
    journal.keep(1, [[float("nan"), 1e-300]])
    journal.close()
    whole = path.read_bytes()
    for cut in range(len(whole.splitlines(keepends=True)[0]), len(whole)):
        path.write_bytes(whole[:cut])
        again = Journal(path, "study")
        found = sorted(again.done)
        assert found == ([0] if cut >= whole.index(b'{"block":1') else [])
        if found:
            assert again.done[0] == [[0.1, 2.0]]
        again.keep(5, [[1.0]])
        again.close()
        assert sorted(read(path, "study")) == [*found, 5]


def test_a_full_disk_is_one_line_and_what_was_done_before_counts(tmp_path: Path) -> None:
    path = tmp_path / "journal"
    rows = [[0.1] * 100]

    def fill() -> None:
        with kept(job(tmp_path, 3.0), path) as journal:
            for block in range(BLOCKS):
                journal.keep(block, rows)

    with disk_of(5000), pytest.raises(HapticdError, match=r"cannot be written: .*finished cells are kept") as raised:
        fill()
    assert str(raised.value).startswith(f"{path}: ")
    with kept(job(tmp_path, 3.0), path) as journal:
        assert sorted(journal.done) == list(range(len(journal.done)))
        assert len(journal.done) > 5
        assert set(map(str, journal.done.values())) == {str(rows)}


@contextmanager
def disk_of(size: int) -> Iterator[None]:
    """No file gets larger [bytes]."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_unfinished_work_of_another_study_is_neither_used_nor_thrown_away(tmp_path: Path) -> None:
    path = tmp_path / "journal"
    journal = Journal(path, "theirs")
    journal.keep(0, [[1.0]])
    journal.close()
    with pytest.raises(ConfigError, match="another study"):
        Journal(path, "ours")
    assert read(path, "theirs") == {0: [[1.0]]}
    assert read(path, "ours", fresh=True) == {}


def test_a_study_that_has_done_nothing_leaves_nothing(tmp_path: Path) -> None:
    Journal(tmp_path / "journal", "ours").close()
    assert list(tmp_path.iterdir()) == []


def test_two_studies_do_not_write_into_one_folder(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal", "study")
    with pytest.raises(InstanceError, match="another study is writing here"):
        Journal(tmp_path / "journal", "study")
    journal.close()


def test_other_settings_are_another_study(tmp_path: Path) -> None:
    with started(tmp_path) as process:
        process.kill()
    (tmp_path / "gate").touch()
    with pytest.raises(ConfigError, match="other settings"):
        do(tmp_path, divisor=7.0)


@given(cells=st.integers(1, 500), most=st.integers(1, 60))
def test_every_cell_is_in_one_block_and_comes_back_in_its_place(cells: int, most: int) -> None:
    sizes = block_sizes(cells, most)
    blocks = [[[float(cell)] for cell in block_cells(sizes, block)] for block in range(len(sizes))]
    assert [len(rows) for rows in blocks] == list(sizes)
    assert max(sizes) <= most
    assert max(sizes) - min(sizes) <= 1
    assert in_order(sizes, blocks) == [[float(cell)] for cell in range(cells)]


def test_a_missing_extra_is_named() -> None:
    require_extra("study", "json")
    with pytest.raises(HapticdError, match=r"no_such_module: pip install 'hapticd\[cluster\]'"):
        require_extra("cluster", "json", "no_such_module")


@pytest.mark.parametrize("study", ["zwidth", "robustness"])
@pytest.mark.parametrize(("hidden", "extra"), [("numba", "study"), ("matplotlib", "study"), ("distributed", "cluster")])
def test_a_study_without_its_extra_names_it_in_one_line(study: str, hidden: str, extra: str) -> None:
    script = (
        "import sys\n"
        "from importlib.machinery import PathFinder\n"
        "class Without:\n"
        "    find_distributions = PathFinder.find_distributions\n"
        "    @staticmethod\n"
        "    def find_spec(name, path=None, target=None):\n"
        f"        return None if name == {hidden!r} else PathFinder.find_spec(name, path, target)\n"
        "sys.meta_path = [Without if finder is PathFinder else finder for finder in sys.meta_path]\n"
        "from hapticd.cli import main\n"
        f"main(['study', {study!r}, '--cluster', 'tcp://127.0.0.1:1'])\n"
    )
    done = subprocess.run([sys.executable, "-c", script], check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr == f"hapticd: this needs {hidden}: pip install 'hapticd[{extra}]'\n"


def test_what_would_not_fit_into_memory_is_refused() -> None:
    require_memory(1e6, "--cells 10x10")
    with pytest.raises(ConfigError, match=r"--cells 1e9x1e9: would take \S+ GiB"):
        require_memory(1e24, "--cells 1e9x1e9")


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="cannot be written"):
        require_folder(tmp_path / "file" / "deeper", ["a.csv"])
    (tmp_path / "a.csv").mkdir()
    with pytest.raises(ConfigError, match=r"a\.csv: is a directory"):
        require_folder(tmp_path, ["a.csv"])
    require_folder(tmp_path / "new" / "folder", ["a.csv"])
    assert list((tmp_path / "new" / "folder").iterdir()) == []


def test_files_hold_no_number_that_others_cannot_read(tmp_path: Path) -> None:
    data = {"a": [1.5, float("nan"), float("inf")], "b": ("x", None, True)}
    write(tmp_path / "a.json", as_json(data))
    assert json.loads((tmp_path / "a.json").read_bytes()) == {"a": [1.5, None, None], "b": ["x", None, True]}
    assert as_csv(("a", "b"), [[0.1, float("nan")], ["p,q", 2]]) == b'a,b\n0.1,\n"p,q",2\n'
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]


def alone(spec: dict[str, Any], block: int, threads: int | None) -> list[Row]:
    """A row that says which process made it; one block kills that, as long as it is told to."""
    assert threads == 1
    if block == 3 and Path(spec["deadly"]).exists():
        os.kill(os.getpid(), signal.SIGKILL)
    return [[float(block), float(os.getpid())]]


def test_interpreted_work_runs_in_processes_and_goes_on_after_one_has_died(tmp_path: Path) -> None:
    deadly = tmp_path / "deadly"
    deadly.touch()
    job = Job(alone, {"deadly": str(deadly)}, (1,) * 6, (), interpreted=True)
    died = pytest.raises(HapticdError, match=r"a process of the study died.*the same command goes on")
    with died, kept(job, tmp_path / "journal") as journal:
        run(job, journal, "alone")
    deadly.unlink()
    with kept(job, tmp_path / "journal") as journal:
        rows = run(job, journal, "alone")
    assert [block[0][0] for block in rows] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert os.getpid() not in {block[0][1] for block in rows}
