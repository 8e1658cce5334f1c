"""What is published: wheel and source distribution hold what they should, and tell what they were tested with."""

from __future__ import annotations

import email
import subprocess
import sys
import tarfile
import zipfile
from importlib.metadata import requires, version
from pathlib import Path

import pytest
from packaging.metadata import Metadata
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from hapticd.version import __version__

ROOT = Path(__file__).parent.parent
SERVICE_EXTRAS = ("metrics", "dashboard")


def build(folder: Path, source: Path, kind: str) -> Path:
    done = subprocess.run(
        # Without bytecode, which the build's own hook would leave in the tree.
        [sys.executable, "-B", "-m", "hatchling", "build", "-t", kind, "-d", folder],
        cwd=source,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    (made,) = folder.iterdir()
    return made


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    return zipfile.ZipFile(build(tmp_path_factory.mktemp("wheel"), ROOT, "wheel"))


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source distribution, unpacked."""
    place = tmp_path_factory.mktemp("source")
    with tarfile.open(build(tmp_path_factory.mktemp("sdist"), ROOT, "sdist")) as archive:
        archive.extractall(place, filter="data")
    (unpacked,) = place.iterdir()
    return unpacked


def test_the_wheel_has_all_that_runs_and_nothing_else(wheel: zipfile.ZipFile) -> None:
    names = wheel.namelist()
    tops = {name.split("/")[0] for name in names}
    packages = {
        "hapticd",
        "hapticd_drivers",
        "hapticd_controllers",
        "hapticd_studies",
        "hapticd_bench",
        "hapticd_views",
    }
    assert tops == packages | {f"hapticd-{__version__}.dist-info"}
    for name in (
        "py.typed",
        "share/config/hapticd.toml",
        "share/systemd/hapticd.service",
        "share/drivers/udev/70-hapticd.rules",
    ):
        assert f"hapticd/{name}" in names
    for plugins in ("hapticd_drivers", "hapticd_controllers"):
        assert f"{plugins}/py.typed" in names
    shipped = {path.name for path in (ROOT / "systemd").iterdir()}
    assert {name.rpartition("/")[2] for name in names if name.startswith("hapticd/share/systemd/")} == shipped
    assert [name for name in names if name.endswith((".pyc", ".toml~", ".orig"))] == []


def test_what_the_wheel_says_of_itself_is_what_registries_take(wheel: zipfile.ZipFile) -> None:
    text = wheel.read(f"hapticd-{__version__}.dist-info/METADATA")
    said = Metadata.from_email(text, validate=True)
    assert (said.name, str(said.version)) == ("hapticd", __version__)
    assert said.license_expression == "BSD-3-Clause"
    assert said.license_files == ["LICENSE"]
    assert said.description_content_type == "text/markdown"
    assert email.message_from_bytes(text).get_payload() == (ROOT / "README.md").read_text()


def test_core_needs_no_extra(wheel: zipfile.ZipFile) -> None:
    said = Metadata.from_email(wheel.read(f"hapticd-{__version__}.dist-info/METADATA"), validate=True)
    core = {requirement.name for requirement in said.requires_dist or [] if requirement.marker is None}
    assert core == {
        "cobs", "hidapi", "msgpack", "pydantic", "pyserial", "pyusb", "pyzmq", "rich", "tomlkit", "typer"
    }  # fmt: skip


def test_the_source_distribution_makes_the_same_wheel(wheel: zipfile.ZipFile, source: Path, tmp_path: Path) -> None:
    again = zipfile.ZipFile(build(tmp_path, source, "wheel"))
    assert {entry.filename: entry.CRC for entry in again.infolist()} == {
        entry.filename: entry.CRC for entry in wheel.infolist()
    }


def test_the_source_distribution_has_all_that_is_in_the_tree(source: Path) -> None:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode != 0:
        pytest.skip("this tree is no clone")
    tree = {name for name in listed.stdout.split("\0") if name and (ROOT / name).is_file()}
    made = {str(path.relative_to(source)) for path in source.rglob("*") if path.is_file()}
    assert tree - made == set()
    # What is not committed yet may be in it; what tools leave may not.
    assert [name for name in made - tree if name.split("/")[0] in (".venv", "dist", ".git") or "cache" in name] == []
    assert "PKG-INFO" in made


def test_to_run_it_nothing_is_installed_that_only_tests_need_and_all_in_the_versions_that_were_tested() -> None:
    lines = (ROOT / "Makefile").read_text().replace("\\\n", " ").splitlines()
    installs = [line.strip() for line in lines if "PIP_INSTALL" in line or "-m pip install" in line]
    assert [line for line in installs if line.startswith("$(PIP_INSTALL)")] == [
        "$(PIP_INSTALL) .",
        "$(PIP_INSTALL) '.[dev]'",
    ]
    own = [line for line in installs if "-m pip install" in line]
    assert len(own) == 2
    assert all("--constraint $(CONSTRAINTS)" in line for line in own)


def pinned() -> dict[str, str]:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    return dict(line.split("==") for line in lines if not line.startswith("#"))


def needed(name: str, extra: str = "", found: set[str] | None = None) -> set[str]:
    """Every distribution that one needs, and what those need."""
    found = set() if found is None else found
    for requirement in map(Requirement, requires(name) or []):
        if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
            wanted = canonicalize_name(requirement.name)
            if wanted not in found:
                found.add(wanted)
                needed(wanted, "", found)
    return found


def test_the_versions_of_all_that_the_service_needs_are_written_down() -> None:
    assert set(pinned()) == set().union(*(needed("hapticd", extra) for extra in SERVICE_EXTRAS))
    assert f"SERVICE_EXTRAS := {','.join(SERVICE_EXTRAS)}\n" in (ROOT / "Makefile").read_text()


def test_these_tests_run_with_those_versions() -> None:
    assert {name: version(name) for name in pinned()} == pinned()
