"""`hapticd check` says of each file whether it is good, else all that is wrong with it, and checks the others."""

from __future__ import annotations

import json
from pathlib import Path

from hapticd.paths import directory
from tests.cli.shell import GOOD, hapticd


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


def test_check_puts_a_simulated_device_and_its_scene_together(tmp_path: Path) -> None:
    file = tmp_path / "walls.toml"
    walls = "".join(f'[[scene.walls]]\naxis = "{axis}"\nstiffness_n_per_m = 9e3\n' for axis in "xy")
    file.write_text(walls)
    done = hapticd("check", file)
    assert done.returncode == 2
    assert 'scene.walls[1].axis = "y": loopback (omega7 model) has a single axis' in done.stderr
