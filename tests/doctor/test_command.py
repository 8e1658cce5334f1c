"""`hapticd doctor` on this computer, as a shell sees it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from hapticd.cli.doctor import folded
from hapticd.config.models import LoopConfig
from hapticd.doctor.configuration import Wanted
from hapticd.doctor.examination import Examination, verdict
from hapticd.doctor.finding import Finding, Mark
from hapticd.paths import directory
from tests.daemon.running import Daemon
from tests.drivers.plugin import write_module
from tests.ports import free_port

HAPTICD = str(Path(sys.executable).with_name("hapticd"))
GOOD = str(directory("config") / "hapticd.toml")
DOCS = Path(__file__).parent.parent.parent / "docs" / "doctor.md"

SCHEMA: dict[str, Any] = {
    "type": "object",
    "additionalProperties": False,
    "required": [
        *("schema", "version", "config", "driver", "rate_hz", "instance", "verdict", "findings"),
        *("late_edges_us", "latency"),
    ],
    "properties": {
        "schema": {"const": 1},
        "version": {"type": "string"},
        "config": {"type": "string"},
        "driver": {"type": "string"},
        "rate_hz": {"type": "number"},
        "instance": {"type": "string"},
        "verdict": {"enum": ["ok", "advice", "problem"]},
        "findings": {
            "type": "array",
            "items": {
                "type": "object",
                "additionalProperties": False,
                "required": ["mark", "text", "mend", "check", "title"],
                "properties": {
                    "mark": {"enum": ["ok", "advice", "problem", "unknown"]},
                    "text": {"type": "string", "minLength": 1},
                    "mend": {"type": "array", "items": {"type": "string", "minLength": 1}},
                    "check": {"type": "string", "pattern": r"^[a-z]+\.[a-z_]+$"},
                    "title": {"type": "string", "minLength": 1, "maxLength": 12},
                },
            },
        },
        "late_edges_us": {"type": "array", "items": {"type": "integer"}, "minItems": 11, "maxItems": 11},
        "latency": {
            "type": ["object", "null"],
            "additionalProperties": False,
            "required": [
                *("rate_hz", "seconds", "realtime", "late_us", "skipped", "histogram", "virtual", "stolen", "others"),
                *("rivals", "tick_us", "tick_fault"),
            ],
            "properties": {
                "rate_hz": {"type": "number"},
                "seconds": {"type": "number"},
                "realtime": {"type": "boolean"},
                "late_us": {"type": "object", "required": ["count", "p50", "p99", "p999", "max"]},
                "tick_us": {"type": "object", "required": ["count", "p50", "p99", "p999", "max"]},
                "tick_fault": {"const": ""},
                "skipped": {"type": "integer"},
                "histogram": {"type": "array", "items": {"type": "integer"}, "minItems": 12, "maxItems": 12},
                "virtual": {"type": "boolean"},
                "stolen": {"type": "number"},
                "others": {"type": "number"},
                "rivals": {"type": "array", "items": {"type": "string"}},
            },
        },
    },
}


def doctor(*arguments: str, prefix: Sequence[str] = (), **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*prefix, HAPTICD, "doctor", *arguments],
        env={**os.environ, "COLUMNS": "80", **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def reported(done: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    report: dict[str, Any] = json.loads(done.stdout)
    jsonschema.validate(report, SCHEMA)
    assert done.returncode == int(report["verdict"] == "problem"), report["verdict"]
    return report


def marked(report: dict[str, Any], check: str) -> dict[str, Any]:
    (found,) = [finding for finding in report["findings"] if finding["check"] == check]
    return dict(found)


@pytest.fixture
def empty(tmp_path: Path) -> dict[str, str]:
    """An environment in which no daemon runs."""
    return {"HAPTICD_RUNTIME_DIR": str(tmp_path)}


def test_the_table_fits_a_terminal_and_agrees_with_its_exit_code(empty: dict[str, str]) -> None:
    done = doctor("--config", GOOD, "--duration", "0.5", **empty)
    assert done.stderr == ""
    # A path that is longer than a line stands alone: a torn one could not be copied.
    long = [line for line in done.stdout.splitlines() if len(line) > 80 and len(line.split()) > 2]
    assert not long
    rows = [line.split()[0] for line in done.stdout.splitlines() if line.startswith(("ok ", "advice ", "problem "))]
    assert len(rows) > 17
    assert done.returncode == int("problem" in rows)
    assert "ticks: p50" in done.stdout


def test_the_report_is_for_programs_and_its_shape_is_a_promise(empty: dict[str, str]) -> None:
    report = reported(doctor("--config", GOOD, "--duration", "0.5", "--json", **empty))
    latency = report["latency"]
    assert sum(latency["histogram"]) == latency["late_us"]["count"]
    assert latency["seconds"] == 0.5
    assert latency["tick_us"]["count"] == latency["late_us"]["count"]
    named = {finding["check"] for finding in report["findings"]}
    assert named >= {"kernel.preemption", "memory.swap", "latency.loop", "latency.tick"}
    for finding in report["findings"]:
        assert finding["mend"] or finding["mark"] in ("ok", "unknown")


def test_without_the_measurement_there_is_none(empty: dict[str, str]) -> None:
    report = reported(doctor("--config", GOOD, "--no-latency", "--json", **empty))
    assert report["latency"] is None
    assert not any(finding["check"].startswith("latency.") for finding in report["findings"])


@pytest.mark.skipif(shutil.which("setpriv") is None or os.geteuid() != 0, reason="needs root and util-linux's setpriv")
def test_a_user_without_rights_is_told_how_to_get_them(empty: dict[str, str]) -> None:
    """Root may raise its limits, so that right is taken as well."""
    prefix = (
        *("prlimit", "--rtprio=0", "--memlock=8388608"),
        *("setpriv", "--bounding-set", "-sys_nice,-ipc_lock,-sys_resource"),
    )
    report = reported(doctor("--config", GOOD, "--no-latency", "--json", prefix=prefix, **empty))
    scheduling, memory = marked(report, "scheduling.priority"), marked(report, "memory.locking")
    assert (scheduling["mark"], memory["mark"]) == ("problem", "problem")
    assert "CAP_SYS_NICE" in scheduling["text"]
    assert "CAP_IPC_LOCK" in memory["text"]
    for found in (scheduling, memory):
        assert "'rtprio 80' 'memlock unlimited'" in found["mend"][0]
    assert "sudo" not in str(report["findings"]), "root needs none, and a small system has none"


def test_the_disk_is_that_of_the_daemons_fault_records(tmp_path: Path, empty: dict[str, str]) -> None:
    done = doctor("--config", GOOD, "--no-latency", "--json", HAPTICD_STATE_DIR=str(tmp_path / "state"), **empty)
    assert str(tmp_path / "state/default/faults") in marked(reported(done), "endpoints.state")["text"]


def test_a_file_that_cannot_be_used_is_a_problem_among_others(tmp_path: Path, empty: dict[str, str]) -> None:
    path = tmp_path / "lab.toml"
    path.write_text("[loop]\nrate_hz = 2000\n[device]\ndriver = 'omega7'\nspeed = 3\n")
    report = reported(doctor("--config", str(path), "--no-latency", "--json", **empty))
    assert report["rate_hz"] == 2000.0
    assert marked(report, "driver.devices")["mark"] == "problem"
    lines = [finding["text"] for finding in report["findings"] if finding["check"] == "configuration.usable"]
    checked = subprocess.run([HAPTICD, "check", path], capture_output=True, text=True, check=False)
    assert lines == checked.stderr.splitlines()


def test_a_device_is_looked_for_where_its_options_say(tmp_path: Path, empty: dict[str, str]) -> None:
    """A rig on a port that is not on USB is there all the same."""
    port = tmp_path / "ttyS0"
    port.touch()
    path = tmp_path / "lab.toml"
    path.write_text(f'[device]\ndriver = "serial-rig"\n[device.options]\nport = "{port}"\n')
    report = reported(doctor("--config", str(path), "--no-latency", "--json", **empty))
    found = marked(report, "driver.devices")
    assert (found["mark"], str(port) in found["text"]) == ("ok", True)


@pytest.mark.parametrize(("find", "mark"), [("return []", "problem"), ("return [FoundDevice('rig', '7')]", "ok")])
def test_a_driver_that_is_named_by_its_module_is_asked_like_any_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, empty: dict[str, str], find: str, mark: str
) -> None:
    write_module(tmp_path, monkeypatch, f"find(cls, options=None): {find}")
    path = tmp_path / "lab.toml"
    path.write_text('[device]\ndriver = "mylab.rig"\n')
    report = reported(doctor("--config", str(path), "--no-latency", "--json", **empty))
    assert marked(report, "configuration.usable")["mark"] == "ok"
    assert marked(report, "driver.devices")["mark"] == mark


def test_a_running_daemon_is_seen_and_not_delayed() -> None:
    with Daemon(f'[telemetry]\ntcp = "tcp://127.0.0.1:{free_port()}"\n') as daemon:
        daemon.wait_ready()
        directory = str(daemon.directory / "run")
        done = doctor("--config", str(daemon.config), "--json", HAPTICD_RUNTIME_DIR=directory)
        report = reported(done)
    assert f"process {daemon.process.pid}" in marked(report, "endpoints.instance")["text"]
    assert marked(report, "endpoints.tcp")["mark"] == "ok"
    assert "hapticd watch" in marked(report, "driver.devices")["text"]
    assert "hapticd watch" in marked(report, "latency.loop")["text"]
    assert report["latency"] is None


@pytest.mark.parametrize("arguments", [["--duration", "0"], ["--instance", "../x"], ["--quick"]])
def test_misuse_is_told_from_a_problem(arguments: list[str]) -> None:
    done = doctor(*arguments)
    assert (done.returncode, done.stdout) == (2, "")


def test_on_a_computer_that_tells_nothing_nothing_is_claimed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a sandbox without /proc and /sys: every check survives, and none says ok of what it could not see."""
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(tmp_path / "run"))
    wanted = Wanted(Path("lab.toml"), LoopConfig(), "omega7", {})
    found = {finding.check: finding for finding in Examination(wanted, "default", tmp_path).findings()}
    for check in ("kernel.preemption", "processor.count", "processor.governor", "scheduling.throttling", "memory.swap"):
        assert found[check].mark == "unknown", found[check]
    assert not [finding for finding in found.values() if "Error" in finding.text]


@pytest.mark.parametrize(
    ("marks", "worst"), [(["ok", "unknown"], "ok"), (["ok", "advice"], "advice"), (["problem", "advice"], "problem")]
)
def test_what_could_not_be_told_is_no_problem(marks: list[Mark], worst: Mark) -> None:
    assert verdict([Finding(mark, "") for mark in marks]) == worst


def test_a_folded_command_is_still_the_same_command() -> None:
    """A backslash ends no line of a comment, and no quoted text is torn."""
    command = "printf '%s\\n' 'one  two' \"three four\" | tr -d x | cat | cat | cat # why this is so and not otherwise"
    lines = folded(command, 30)
    assert max(map(len, lines)) <= 30
    done = subprocess.run(["sh", "-c", "\n".join(lines)], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("one  two\nthree four\n", "")


def test_the_page_names_every_check() -> None:
    page = DOCS.read_text()
    wanted = Wanted.of(Path(GOOD))
    names = [check.name for check in Examination(wanted, "default").checks()] + ["latency.loop", "latency.tick"]
    assert not [name for name in names if f"`{name}`" not in page]
