"""The command line as a shell sees it: exit codes, plain lines on stderr, no tracebacks."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest
import typer

from hapticd import __version__
from hapticd.cli import main, remote
from hapticd.cli.app import COMMANDS, GROUP, application
from hapticd.client import RefusedError
from hapticd.errors import DeviceNotFoundError
from tests.cli.shell import GOOD, HAPTICD, hapticd
from tests.daemon.running import sleeps, wait_until


def test_version_and_help_are_answers() -> None:
    assert hapticd("--version").stdout == f"hapticd {__version__}\n"
    done = hapticd("--help")
    assert done.returncode == 0
    assert hapticd("-h").stdout == done.stdout
    assert "..." not in done.stdout.partition("Commands:")[2], "what a command does is said in full"
    assert hapticd("fault", "list", "-h").stdout == hapticd("fault", "list", "--help").stdout
    assert all(summary in done.stdout for _, summary in COMMANDS.values())
    assert "Put laws to the test" in done.stdout, "commands of the entry-point group are listed"


@pytest.mark.parametrize("group", [(), ("fault",), ("gateway",)])
def test_no_command_is_a_misuse_that_shows_the_overview(group: tuple[str, ...]) -> None:
    done = hapticd(*group)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(" ".join(["Usage: hapticd", *group]))
    assert "Commands:" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "named", "advice"),
    [
        (["chek"], "'check'", "hapticd --help"),
        (["check"], "FILE...", "hapticd check --help"),
        (["check", "--jsn"], "--json", "hapticd check --help"),
        (["config", "shw"], "'show'", "hapticd config --help"),
    ],
)
def test_misuse_is_a_line_with_advice_and_exit_code_2(arguments: list[str], named: str, advice: str) -> None:
    done = hapticd(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    line, see = done.stderr.splitlines()
    assert line.startswith("hapticd: ")
    assert named in line
    assert see == f"  see {advice}"


@pytest.mark.parametrize(
    ("typed", "meant"),
    [("recrod", "'record'"), ("plto", "'plot'"), ("hapkit-tabel", "'hapkit-table'"), ("relaod", "'reload', 'record'")],
)
def test_a_mistyped_command_is_told_from_all_that_are_installed(typed: str, meant: str) -> None:
    """Those of the entry-point group were not among them: for `recrod` it was `reload`."""
    assert hapticd(typed).stderr.splitlines()[0] == f"hapticd: No such command '{typed}'. Did you mean {meant}?"


@pytest.mark.parametrize("typed", ["validate", "calibrat", "calibrated", "ar", "armm"])
def test_what_moves_an_arm_or_lets_it_push_is_no_suggestion(typed: str) -> None:
    said = hapticd(typed).stderr
    assert f"No such command '{typed}'" in said
    assert "'calibrate'" not in said
    assert "'arm'" not in said


def test_the_choices_of_an_argument_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    see = "  see hapticd completion --help\n"
    for arguments, said in (
        (["completion"], "Missing argument 'SHELL'. Choose from: bash, zsh, fish"),
        (["completion", "sh"], "Invalid value for 'SHELL': 'sh' is not one of 'bash', 'zsh', 'fish'."),
    ):
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        assert (ended.value.code, capsys.readouterr().err) == (2, f"hapticd: {said}\n{see}")


def test_the_overview_imports_no_command_and_nothing_heavy() -> None:
    script = (
        "import sys\nfrom hapticd.cli import main\ntry:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'pydantic', 'zmq', 'rich', 'tomlkit', 'numpy', 'numba', 'asyncio'} & set(sys.modules)\n"
        "sys.exit(repr(heavy) if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def commands_of(app: typer.Typer, *path: str) -> list[tuple[str, ...]]:
    groups = [(group.name or "", group.typer_instance) for group in app.registered_groups]
    names = [command.name or getattr(command.callback, "__name__", "") for command in app.registered_commands]
    inner = [found for name, group in groups if group for found in commands_of(group, *path, name)]
    return [(*path, name) for name in names] + inner


@pytest.mark.parametrize("name", [*COMMANDS, *sorted(entry_points(group=GROUP).names)])
def test_every_command_explains_itself_with_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [path for path in commands_of(application(name)) if path[0] == name]
    assert paths
    for path in paths:
        with pytest.raises(SystemExit) as ended:
            main([*path, "--help"])
        shown = capsys.readouterr().out
        assert ended.value.code == 0
        examples = [part.strip() for part in shown.split("\n\n") if part.startswith("  Example: ")]
        assert f"Example: hapticd {' '.join(path)}" in examples[0]
        assert not [example for example in examples if "\n" in example], "it is copied into a shell as one line"
        assert "..." not in shown.partition("Commands:")[2]
        if len(path) == 1 and name in COMMANDS:
            assert COMMANDS[name][1] in shown, "the overview and the command say different things"


@pytest.mark.parametrize("group", ["study", "bench"])
def test_a_group_and_its_commands_say_the_same(group: str, capsys: pytest.CaptureFixture[str]) -> None:
    (found,) = [each.typer_instance for each in application(group).registered_groups if each.name == group]
    assert found is not None
    assert len(found.registered_commands) >= 6
    for command in found.registered_commands:
        with pytest.raises(SystemExit):
            main([group, command.name or "", "--help"])
        assert (command.help or "").rstrip(".") in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("error", "status", "lines"),
    [
        (
            DeviceNotFoundError("omega7: nothing there\n  plug it in"),
            1,
            "hapticd: omega7: nothing there\n  plug it in\n",
        ),
        (KeyboardInterrupt(), 130, ""),
        (typer.Abort(), 1, "hapticd: nothing done\n"),
        (ZeroDivisionError("oh"), 1, "hapticd: defect: ZeroDivisionError: oh\n"),
    ],
)
def test_an_error_is_lines_and_an_exit_code(
    error: BaseException, status: int, lines: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(_: str) -> None:
        raise error

    monkeypatch.delenv("HAPTICD_DEBUG", raising=False)
    monkeypatch.setattr("hapticd.cli.check.load", fail)
    with pytest.raises(SystemExit) as ended:
        main(["check", "x.toml"])
    assert ended.value.code == status
    assert capsys.readouterr().err.startswith(lines)


def test_whoever_debugs_gets_the_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HAPTICD_DEBUG", "1")
    monkeypatch.setattr("hapticd.cli.check.load", lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        main(["check", "x.toml"])


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_a_stream_that_is_closed_leads_nowhere(closed: str) -> None:
    """And the lines for it go to no other one."""
    for arguments, status in (f"check {shlex.quote(GOOD)}", 0), ("nonsense", 2):
        done = subprocess.run(
            ["sh", "-c", f"{HAPTICD} {arguments} {closed}"], capture_output=True, text=True, check=False
        )
        assert done.returncode == status
        assert "Traceback" not in done.stderr
        assert (done.stdout != "") == (status == 0 and not closed.count(" >&-") and not closed.startswith(">"))
        assert (done.stderr != "") == (status != 0 and "2>&-" not in closed)


@pytest.mark.parametrize("arguments", [("check", GOOD), ("config", "schema"), ("--help",)])
def test_output_onto_a_full_disk_is_an_error_of_one_line(arguments: tuple[str, ...]) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([HAPTICD, *arguments], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "hapticd: standard output: No space left on device\n")


def test_an_interrupt_while_it_still_imports_shows_nothing(tmp_path: Path) -> None:
    (tmp_path / "typer.py").write_text("raise KeyboardInterrupt")
    done = hapticd("check", GOOD, PYTHONPATH=str(tmp_path))
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


def test_nobody_clears_a_workspace_for_a_daemon_that_is_not_there(tmp_path: Path) -> None:
    done = hapticd("calibrate", HAPTICD_RUNTIME_DIR=str(tmp_path))
    assert done.returncode == 1
    assert done.stderr.startswith("hapticd: no daemon answers on ")


@pytest.mark.parametrize(
    ("said", "why"), [({"armed": True}, "`hapticd disarm` first"), ({"device_lost_timestamp": 1.7e9}, "no device")]
)
def test_nor_for_one_that_is_armed_or_has_no_device(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], said: dict[str, object], why: str
) -> None:
    """It counted down to an arm that would move by itself, and was then refused."""
    monkeypatch.setattr(remote, "command", lambda *_, **__: {"status": said})
    monkeypatch.setattr("hapticd.client.commands.calibrate", lambda *_: pytest.fail("it calibrates"))
    monkeypatch.setattr("hapticd.cli.remote.signal.signal", lambda *_: None)
    with pytest.raises(RefusedError, match=why):
        remote.calibrate(countdown_s=1)
    assert capsys.readouterr().err == ""


def test_an_interrupt_ends_with_130(tmp_path: Path) -> None:
    fifo = tmp_path / "never.toml"
    os.mkfifo(fifo)
    with (
        subprocess.Popen([HAPTICD, "check", fifo], stderr=subprocess.PIPE, text=True) as waiting,
        fifo.open("w"),  # once the command opens it, and gives it nothing
    ):
        # an interrupt just before a read would be seen only once the read ends
        wait_until(lambda: sleeps(waiting.pid), "a command that reads")
        waiting.send_signal(signal.SIGINT)
        _, errors = waiting.communicate(timeout=20)
    assert (waiting.returncode, errors) == (130, "")


def test_a_reader_that_leaves_early_is_no_error_message() -> None:
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([HAPTICD, "config", "schema"], stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    os.close(write)
    assert done.stderr == ""


@pytest.mark.parametrize(
    ("command", "kind"), [(["check"], "law"), (["run", "--config"], "driver")], ids=["check", "run"]
)
def test_a_users_ctrl_c_while_a_plug_in_is_imported_is_no_fault_of_the_plug_in(
    command: list[str], kind: str, tmp_path: Path
) -> None:
    """It was reported as the module's own KeyboardInterrupt, with exit code 2."""
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab/__init__.py").touch()
    (tmp_path / "lab/slow.py").write_text("import time\nprint('importing', flush=True)\ntime.sleep(60.0)\n")
    file = tmp_path / "slow.toml"
    file.write_text(f'[{"device" if kind == "driver" else "controller"}]\n{kind} = "lab.slow"\n')
    with subprocess.Popen(
        [HAPTICD, *command, file],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as asked:
        assert asked.stdout
        assert asked.stdout.readline() == "importing\n"
        asked.send_signal(signal.SIGINT)
        _, said = asked.communicate()
    assert (asked.returncode, said) == (130, "")


@pytest.mark.parametrize("command", ["check", "run", "simulate"])
def test_an_object_on_a_device_with_one_axis_is_refused_by_name(tmp_path: Path, command: str) -> None:
    """It must not run without the object, as if there were nothing there."""
    file = tmp_path / "ball.toml"
    file.write_text('[[scene.objects]]\nname = "ball"\nshape = "sphere"\nradius_m = 0.03\nstiffness_n_per_m = 9e3\n')
    arguments: dict[str, list[str | Path]] = {
        "check": ["check", file],
        "run": ["run", "--config", file],
        "simulate": ["simulate", "--config", file, "--duration", "0.1"],
    }
    done = hapticd(*arguments[command])
    assert done.returncode == 2
    assert f'{file}: scene.objects[0] "ball": objects need three axes, and loopback (omega7 model) has 1' in done.stderr
