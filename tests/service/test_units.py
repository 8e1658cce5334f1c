"""The units as they lie in the tree: faultless, hardened, and the same for one device and for several."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from hapticd.keys.connections import DESCRIPTORS
from hapticd.paths import directory
from hapticd.service.install import METRICS_UNIT, UNITS

SYSTEMD = directory("systemd")
MOST_EXPOSED = 2.0


def systemd(*command: str | Path) -> subprocess.CompletedProcess[str]:
    if shutil.which(str(command[0])) is None:
        pytest.skip(f"{command[0]} is missing")
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(params=UNITS)
def unit(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A unit whose program exists."""
    text = (SYSTEMD / request.param).read_text()
    path: Path = tmp_path / request.param
    path.write_text(text.replace("/opt/hapticd/bin/hapticd", "/bin/true"))
    return path


def settings(unit: str) -> list[str]:
    lines = (SYSTEMD / unit).read_text().splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def test_systemd_finds_no_fault(unit: Path) -> None:
    done = systemd("systemd-analyze", "verify", "--man=no", unit)
    assert (done.stdout + done.stderr, done.returncode) == ("", 0)


def test_the_exposure_is_low(unit: Path) -> None:
    done = systemd("systemd-analyze", "security", "--offline=true", "--no-pager", unit)
    overall = re.search(r"Overall exposure level for \S+: ([\d.]+)", done.stdout)
    assert overall, done.stderr
    assert float(overall[1]) <= MOST_EXPOSED


def test_every_exposure_that_remains_is_explained(unit: Path) -> None:
    """A comment of it or of hapticd.service names it, in the words of `systemd-analyze security`."""
    explaining = METRICS_UNIT if unit.name == METRICS_UNIT else "hapticd.service"
    explained = " ".join(line for line in (SYSTEMD / explaining).read_text().splitlines() if line.startswith("#"))
    done = systemd("systemd-analyze", "security", "--offline=true", "--json=short", unit)
    exposed = [check["name"] for check in json.loads(done.stdout) if check["exposure"]]
    assert exposed
    for name in exposed:
        word = name.partition("=~")[2] or name.rstrip("=")
        assert word in explained, f"{explaining} does not say why: {name}"


def test_the_template_differs_by_its_instance_only() -> None:
    one = settings("hapticd.service")
    for only in ("Conflicts=hapticd@default.service", "After=hapticd@default.service"):
        one.remove(only)
    several = settings("hapticd@.service")
    several.remove("ConditionPathExists=/etc/hapticd/%i.toml")
    several = [re.sub(r" --instance %i|, instance %i", "", line) for line in several]
    several = [line.replace("%i.toml", "hapticd.toml").replace("%i", "default") for line in several]
    assert several == one


def test_the_page_says_what_the_unit_does_after_a_failure() -> None:
    """S10: the page promised 1 s and five times a minute."""
    unit = settings("hapticd.service")
    assert {"RestartSec=5", "StartLimitIntervalSec=0", "WatchdogSec=5"} <= set(unit)
    page = " ".join((SYSTEMD.parent / "docs/service.md").read_text().split())
    assert "After a failure it is started again after 5 s, as often as it takes" in page
    assert "When it is not fed for 5 s" in page


def test_the_unit_bounds_what_clients_can_make_of_it() -> None:
    unit = settings("hapticd.service")
    assert f"LimitNOFILE={DESCRIPTORS}" in unit
    assert "MemoryMax=512M" in unit


def test_the_user_and_its_groups_come_into_being(tmp_path: Path) -> None:
    (tmp_path / "etc").mkdir()
    done = systemd("systemd-sysusers", f"--root={tmp_path}", SYSTEMD / "hapticd.sysusers")
    assert done.returncode == 0, done.stderr
    user = next(line for line in (tmp_path / "etc/passwd").read_text().splitlines() if line.startswith("hapticd:"))
    assert user.split(":")[5] == "/var/lib/hapticd"
    assert "nologin" in user
    groups = (tmp_path / "etc/group").read_text()
    assert re.search(r"^hapticd:", groups, re.MULTILINE)
    assert re.search(r"^dialout:.*:hapticd$", groups, re.MULTILINE)


def test_the_common_directories_come_into_being(tmp_path: Path) -> None:
    done = systemd("systemd-tmpfiles", "--create", f"--root={tmp_path}", SYSTEMD / "hapticd.tmpfiles")
    assert done.returncode == 0, done.stderr
    for path in ("run/hapticd", "var/lib/hapticd"):
        assert (tmp_path / path).stat().st_mode & 0o777 == 0o755
