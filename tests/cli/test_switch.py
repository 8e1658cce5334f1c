"""`hapticd switch` where no daemon runs: the file is edited, or left alone with a reason."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import hapticd.cli.switch as cli_switch
from hapticd.cli import main
from hapticd.errors import InstanceError
from hapticd.supervisor.lock import InstanceLock

HAPTICD = Path(sys.executable).with_name("hapticd")
TEXT = """\
# our rig
[controller]
law = "energy-cycle"  # as in the paper

[controller.params]
window = 2

# limits
[safety]
ramp_s = 0.1
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "lab.toml"
    path.write_text(TEXT)
    return path


def switch(file: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(file.parent / "run")}
    command = [str(HAPTICD), "switch", *arguments, "--config", str(file)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)


def test_the_file_is_edited_and_what_changed_is_said(file: Path) -> None:
    done = switch(file, "tdpa", "--set", "damping_cap_n_s_per_m=20", "-s", "reset=never", "-s", "carry_debt = false")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        f'{file}: controller.law = "tdpa" (was "energy-cycle")',
        f"{file}: controller.params.damping_cap_n_s_per_m = 20 (was not set)",
        f'{file}: controller.params.reset = "never" (was not set)',
        f"{file}: controller.params.carry_debt = false (was not set)",
        f"{file}: controller.params.window is gone (was 2)",
        "no daemon 'default' runs; it has effect at its next start",
    ]
    assert file.read_text() == TEXT.replace('"energy-cycle"', '"tdpa"').replace(
        "window = 2\n",
        'damping_cap_n_s_per_m = 20\nreset = "never"\ncarry_debt = false\n# energy-cycle: window = 2\n',
    )


def test_a_dry_run_shows_the_edit_and_does_nothing(file: Path) -> None:
    done = switch(file, "energy-cycle", "--set", "window=1", "--dry-run")
    assert (done.returncode, done.stderr) == (0, "")
    assert [line for line in done.stdout.splitlines() if line[0] in "+-"][2:] == ["-window = 2", "+window = 1"]
    assert file.read_text() == TEXT


def test_what_is_there_already_is_no_change(file: Path) -> None:
    before = file.stat()
    done = switch(file, "energy-cycle", "--set", "window=2")
    assert done.returncode == 0
    assert done.stdout == f"{file}: nothing to change\nno daemon 'default' runs\n"
    assert (file.stat().st_ino, file.stat().st_mtime_ns) == (before.st_ino, before.st_mtime_ns)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["tdap"], 'controller.law = "tdap": not installed'),
        (["mylab.absent"], 'controller.law = "mylab.absent"'),
        (["tdpa", "--set", "window=2"], "controller.params.window = 2: unknown key"),
        (["tdpa", "--set", "damping_cap_n_s_per_m=-2"], "damping_cap_n_s_per_m = -2: must be from 0"),
        (["tdpa", "--set", "damping_cap_n_s_per_m=much"], 'damping_cap_n_s_per_m = "much": must be a number'),
        (["tdpa", "--set", "reset=1\nlaw='none'"], "controller.params.reset"),
        (["tdpa", "--set", "window"], "must be KEY=VALUE"),
        (["tdpa", "--set", "=2"], "must be KEY=VALUE"),
    ],
)
def test_what_cannot_be_used_changes_nothing_and_is_named(file: Path, arguments: list[str], named: str) -> None:
    done = switch(file, *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert named in done.stderr
    assert file.read_text() == TEXT


def test_a_file_must_be_there(file: Path) -> None:
    file.unlink()
    done = switch(file, "none")
    assert (done.returncode, done.stderr) == (2, f"hapticd: {file}: no such file\n")


def test_of_a_daemon_that_does_not_answer_it_is_not_said_that_none_runs(
    file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The file was edited, and said to count from the next start on; it did so from the next reload on."""

    def silent(*_: object, **__: object) -> None:
        raise InstanceError("a daemon runs there and does not answer")

    monkeypatch.setattr(cli_switch, "command", silent)
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(file.parent / "run"))
    lock = InstanceLock("default")
    with pytest.raises(SystemExit) as ended:
        main(["switch", "tdpa", "--config", str(file)])
    lock.close()
    assert ended.value.code == 1
    assert "does not answer" in capsys.readouterr().err
    assert file.read_text() == TEXT
