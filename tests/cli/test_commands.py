"""The command line as a shell sees it: exit codes, plain lines on stderr, no tracebacks."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
import tomllib
from importlib.metadata import entry_points
from pathlib import Path

import pytest
import typer

from hapticd import __version__
from hapticd.cli import main, remote
from hapticd.cli.app import COMMANDS, GROUP, application
from hapticd.client import RefusedError
from hapticd.errors import DeviceNotFoundError
from hapticd.paths import directory

HAPTICD = Path(sys.executable).with_name("hapticd")
GOOD = str(directory("config") / "hapticd.toml")


def hapticd(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [HAPTICD, *arguments], env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )


@pytest.fixture
def bad(tmp_path: Path) -> Path:
    file = tmp_path / "bad.toml"
    file.write_text("[loop]\nrate_hz = 50\n[controller]\nlaw = 'tdap'\n")
    return file


# -- the frame


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


def test_nor_for_one_that_is_armed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """It counted down to an arm that would move by itself, and was then refused."""
    monkeypatch.setattr(remote, "command", lambda *_, **__: {"status": {"armed": True}})
    with pytest.raises(RefusedError, match="`hapticd disarm` first"):
        remote.calibrate(countdown_s=1)
    assert capsys.readouterr().err == ""


def test_an_interrupt_ends_with_130(tmp_path: Path) -> None:
    fifo = tmp_path / "never.toml"
    os.mkfifo(fifo)
    waiting = subprocess.Popen([HAPTICD, "check", fifo], stderr=subprocess.PIPE, text=True)
    with fifo.open("w"):  # opens once the command reads, and gives it nothing
        waiting.send_signal(signal.SIGINT)
        _, errors = waiting.communicate(timeout=20)
    assert (waiting.returncode, errors) == (130, "")


def test_a_reader_that_leaves_early_is_no_error_message() -> None:
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([HAPTICD, "config", "schema"], stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    os.close(write)
    assert done.stderr == ""


# -- check


def test_check_prints_a_line_for_each_good_file_and_every_problem_of_the_others(bad: Path) -> None:
    done = hapticd("check", GOOD, bad, bad.parent / "absent.toml")
    assert done.returncode == 2
    (line,) = done.stdout.splitlines()
    assert line.startswith(f"{GOOD}: ok, ")
    assert line.endswith(", loopback with ring-damping at 1000 Hz")
    assert [problem.split(": ")[:2] for problem in done.stderr.splitlines()] == [
        [str(bad), "loop.rate_hz = 50"],
        [str(bad), 'controller.law = "tdap"'],
        [str(bad.parent / "absent.toml"), "no such file"],
    ]


OWN = """import sys
from pydantic import field_validator
from hapticd.driver import Field
from hapticd.simulation.options import SimulationOptions
from hapticd_drivers.loopback import Loopback
class Options(SimulationOptions):
    fails: str
    @field_validator("fails")
    def leave(cls, fails):
        if fails == "options":
            raise SystemExit(0)
        return fails
class Own(Loopback):
    Options = Options
    def __init__(self, options, period_s):
        if options.fails == "__init__":
            sys.exit(0)
        super().__init__(options, period_s)
    @classmethod
    def check(cls, options, period_s):
        if options.fails == "check":
            raise KeyboardInterrupt
    def _open(self):
        return {}["port"]
DRIVER = Own
"""


def test_what_plug_ins_do_to_a_check_is_a_line_of_their_file_and_the_other_files_are_checked(tmp_path: Path) -> None:
    """A module that exits ended it without a word."""
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab/__init__.py").touch()
    (tmp_path / "lab/own.py").write_text(OWN)
    files = []
    for failing in ("options", "check", "__init__", "_open"):
        files.append(tmp_path / f"{failing}.toml")
        files[-1].write_text(f'[device]\ndriver = "lab.own"\n[device.options]\nfails = "{failing}"\n')
    for kind, failing in (("device", "driver"), ("controller", "law")):
        (tmp_path / f"lab/{failing}.py").write_text("import sys\nsys.exit(0)\n")
        files.append(tmp_path / f"{failing}.toml")
        files[-1].write_text(f'[{kind}]\n{failing} = "lab.{failing}"\n')
    done = hapticd("check", *files, GOOD, PYTHONPATH=str(tmp_path))
    assert done.returncode == 2
    assert done.stdout.startswith(f"{GOOD}: ok, ")
    said = [line.removeprefix(f"{tmp_path}/") for line in done.stderr.splitlines()]
    assert said == [
        "options.toml: device.options: cannot be checked: SystemExit: 0 (own.py:11)",
        "check.toml: device.options: cannot be checked: KeyboardInterrupt (own.py:22)",
        "__init__.toml: driver lab.own.Own: __init__: SystemExit: 0 (own.py:17)",
        "_open.toml: driver lab.own.Own: _open: KeyError: 'port' (own.py:24)",
        "driver.toml: device.driver = \"lab.driver\": driver module 'lab.driver' cannot be imported: SystemExit: 0"
        " (driver.py:2)",
        "law.toml: controller.law = \"lab.law\": law module 'lab.law' cannot be imported: SystemExit: 0 (law.py:2)",
    ]


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


def test_check_as_json_says_the_same(bad: Path) -> None:
    done = hapticd("check", "--json", GOOD, bad)
    good, wrong = json.loads(done.stdout)
    assert (done.returncode, done.stderr) == (2, "")
    assert (good["ok"], good["driver"], good["law"], good["rate_hz"]) == (True, "loopback", "ring-damping", 1000.0)
    assert good["sha256"].startswith(good["hash"])
    assert (wrong["ok"], len(wrong["problems"])) == (False, 2)


def test_check_of_good_files_succeeds() -> None:
    files = sorted(directory("config").glob("*.toml"))
    done = hapticd("check", *files)
    assert (done.returncode, done.stderr, len(done.stdout.splitlines())) == (0, "", len(files))


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


def test_check_puts_a_simulated_device_and_its_scene_together(tmp_path: Path) -> None:
    file = tmp_path / "walls.toml"
    walls = "".join(f'[[scene.walls]]\naxis = "{axis}"\nstiffness_n_per_m = 9e3\n' for axis in "xy")
    file.write_text(walls)
    done = hapticd("check", file)
    assert done.returncode == 2
    assert 'scene.walls[1].axis = "y": loopback (omega7 model) has a single axis' in done.stderr


# -- config, devices, controllers


def test_config_show_fills_in_the_defaults() -> None:
    shown = tomllib.loads(hapticd("config", "show", GOOD).stdout)
    assert shown["safety"]["ramp_s"] == 0.05
    assert shown["device"]["options"]["mass_kg"] == 0.25
    assert shown["controller"]["params"]["pull_after"] == 4


def test_config_show_of_a_bad_file_prints_its_problems(bad: Path) -> None:
    done = hapticd("config", "show", bad)
    assert (done.returncode, done.stdout) == (2, "")
    assert [line.startswith(f"hapticd: {bad}: ") for line in done.stderr.splitlines()] == [True, True]


def test_config_schema_is_json() -> None:
    assert json.loads(hapticd("config", "schema").stdout)["title"] == "hapticd configuration"


def test_devices_lists_options_with_units_and_branches() -> None:
    (loopback,) = [plugin for plugin in json.loads(hapticd("devices", "--json").stdout) if plugin["name"] == "loopback"]
    parameters = {(parameter["key"], parameter["only_with"]): parameter for parameter in loopback["parameters"]}
    mass = parameters["mass_kg", ""]
    assert (mass["default"], mass["unit"], mass["required"]) == (0.25, "kg", False)
    assert parameters["changes[].at_s", ""]["required"]
    assert parameters["hand.force.newton", 'hand.force.profile = "step"']["unit"] == "N"


def test_controllers_lists_laws_for_people() -> None:
    shown = hapticd("controllers", COLUMNS="200").stdout
    assert "tdpa  Time-domain passivity control." in shown
    assert "damping_cap_n_s_per_m" in shown
    assert '"spring" | "total"' in shown
    only = hapticd("controllers", "energy-cycle", COLUMNS="40").stdout
    assert "tdpa" not in only
    assert "minimum" in "".join(only.split()), "a word that is longer than its column is broken and not cut off"
    assert "…" not in only


def test_a_parameter_without_a_description_is_told_by_what_it_may_be(tmp_path: Path) -> None:
    """Its meaning began with a semicolon."""
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab/damper.py").write_text(
        "from hapticd.law import Field, LawParams\n"
        "class Params(LawParams):\n    gain: float = Field(0.5, ge=0.0, le=1.0)\n"
        "class State:\n    pass\n"
        "def start(state, params, snapshot):\n    return State()\n"
        "def step(state, params, tick):\n    return 0.0\n"
    )
    done = hapticd("controllers", "lab.damper", PYTHONPATH=str(tmp_path), COLUMNS="120")
    assert done.returncode == 0, done.stderr
    (gain,) = [line.split() for line in done.stdout.splitlines() if "gain" in line]
    assert gain == ["gain", "0.5", "from", "0", "to", "1"]
    assert ";" not in done.stdout


@pytest.mark.parametrize(
    ("command", "kind", "typed", "meant"),
    [
        ("controllers", "law", "energy-cycl", "energy-cycle"),
        ("devices", "driver", "omega6", "omega7"),
    ],
)
def test_a_mistyped_plug_in_is_told_from_those_that_are_installed(
    command: str, kind: str, typed: str, meant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([command, typed])
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith(f'hapticd: no {kind} {typed!r}: did you mean "{meant}"? installed are ')


def test_a_plugin_that_cannot_be_imported_is_listed_with_the_reason(tmp_path: Path) -> None:
    information = tmp_path / "broken-1.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1\n")
    (information / "entry_points.txt").write_text("[hapticd.drivers]\nbroken = broken_driver:Broken\n")
    (tmp_path / "broken_driver.py").write_text("import no_such_library")
    done = hapticd("devices", "--json", PYTHONPATH=str(tmp_path))
    assert done.returncode == 0
    problems = {plugin["name"]: plugin["problem"] for plugin in json.loads(done.stdout)}
    assert problems["loopback"] == ""
    assert "No module named 'no_such_library'" in problems["broken"]
    assert "cannot be used" in hapticd("devices", PYTHONPATH=str(tmp_path)).stdout
    assert "driver.broken" not in json.loads(hapticd("config", "schema", PYTHONPATH=str(tmp_path)).stdout)["$defs"]
    alone = hapticd("devices", "broken", PYTHONPATH=str(tmp_path))
    assert (alone.returncode, alone.stdout) == (2, "")
