"""`make install` and `hapticd service` fill a tree, leave what is the user's, and take the rest away again."""

from __future__ import annotations

import json
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from hapticd.service.install import Installation, InstallationError, UnitState, advice_after_install
from tests.service.machine import SOURCE

CONFIG = "etc/hapticd/hapticd.toml"
FILES = {
    "etc/hapticd/hapticd.toml",
    "usr/local/bin/hapticd",
    "usr/local/lib/systemd/system/hapticd.service",
    "usr/local/lib/systemd/system/hapticd-metrics.service",
    "usr/local/lib/systemd/system/hapticd@.service",
    "usr/local/lib/sysusers.d/hapticd.conf",
    "usr/local/lib/tmpfiles.d/hapticd.conf",
    "usr/local/lib/udev/rules.d/70-hapticd.rules",
}


SHARED = {
    "usr/local/share/bash-completion/completions/hapticd",
    "usr/local/share/fish/vendor_completions.d/hapticd.fish",
    "usr/local/share/hapticd/grafana-dashboard.json",
    "usr/local/share/man/man1/hapticd.1.gz",
    "usr/local/share/zsh/site-functions/_hapticd",
}
"""What the command line adds: it knows its own words."""


def files(root: Path) -> set[str]:
    found = (Path(place) / name for place, inner, names in os.walk(root) for name in [*names, *inner])
    return {str(path.relative_to(root)) for path in found if path.is_symlink() or path.is_file()}


def silent(_line: str) -> None:
    pass


def installed(root: Path, executable: str = "/opt/hapticd/bin/hapticd") -> Installation:
    installation = Installation(root, Path(executable))
    installation.install(silent)
    return installation


def make(*arguments: str) -> str:
    done = subprocess.run(["make", *arguments], cwd=SOURCE, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_every_file_of_the_service_goes_to_its_place_readable_by_all(tmp_path: Path) -> None:
    previous = os.umask(0o077)
    try:
        installed(tmp_path)
    finally:
        os.umask(previous)
    assert files(tmp_path) == FILES
    assert (tmp_path / "usr/local/bin/hapticd").readlink() == Path("/opt/hapticd/bin/hapticd")
    for name in FILES - {"usr/local/bin/hapticd"}:
        assert stat.S_IMODE((tmp_path / name).stat().st_mode) == 0o644
    assert stat.S_IMODE((tmp_path / "etc/hapticd").stat().st_mode) == 0o755


def test_a_prefix_counts_from_where_one_is_as_a_root_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir("/")
    Installation(tmp_path, prefix=Path("opt/lab")).install(silent)
    assert (tmp_path / "opt/lab/lib/systemd/system/hapticd.service").is_file()


def test_the_units_run_the_hapticd_that_installed_them(tmp_path: Path) -> None:
    installed(tmp_path, "/srv/lab/bin/hapticd")
    unit = (tmp_path / "usr/local/lib/systemd/system/hapticd@.service").read_text()
    assert "ExecStart=/srv/lab/bin/hapticd run" in unit
    assert "/opt/hapticd" not in unit


def test_a_package_has_its_files_where_packages_have_them(tmp_path: Path) -> None:
    installation = Installation(tmp_path, Path("/opt/hapticd/bin/hapticd"), Path("/usr"))
    installation.install(silent)
    assert files(tmp_path) == {name.replace("usr/local/", "usr/") for name in FILES}
    found = Installation(tmp_path, Path("/opt/hapticd/bin/hapticd"))
    assert {file.state for file in found.files()} == {"installed"}
    for change in (found.install, found.uninstall):
        with pytest.raises(InstallationError, match="as a package, which owns its files"):
            change(silent)
    assert files(tmp_path) == {name.replace("usr/local/", "usr/") for name in FILES}


def test_a_configuration_is_never_overwritten(tmp_path: Path) -> None:
    installed(tmp_path)
    (tmp_path / CONFIG).write_text("# mine\n")
    installed(tmp_path)
    assert (tmp_path / CONFIG).read_text() == "# mine\n"


def test_an_uninstall_leaves_configurations_and_what_others_own(tmp_path: Path) -> None:
    installation = installed(tmp_path)
    (tmp_path / "usr/local/lib/udev/rules.d/99-mine.rules").write_text("")
    (tmp_path / "etc/hapticd/left.toml").write_text("")
    installation.uninstall(silent)
    assert files(tmp_path) == {CONFIG, "etc/hapticd/left.toml", "usr/local/lib/udev/rules.d/99-mine.rules"}
    assert not (tmp_path / "usr/local/lib/systemd").exists()
    installation.uninstall(silent)


def test_an_uninstall_removes_the_links_of_units_that_have_gone_already(tmp_path: Path) -> None:
    """S9: one missing file left every link behind, and systemd complained at each start of the computer."""
    installation = installed(tmp_path)
    wants = tmp_path / "etc/systemd/system/multi-user.target.wants"
    wants.mkdir(parents=True)
    units = Path("/usr/local/lib/systemd/system")
    (wants / "hapticd.service").symlink_to(units / "hapticd.service")
    (wants / "hapticd@left.service").symlink_to(units / "hapticd@.service")
    (wants / "hapticd@other.service").symlink_to("/srv/other/hapticd@.service")
    (tmp_path / "usr/local/lib/systemd/system/hapticd.service").unlink()
    for _ in range(2):
        installation.uninstall(silent)
        assert files(tmp_path) == {CONFIG, "etc/systemd/system/multi-user.target.wants/hapticd@other.service"}


def test_what_runs_after_an_install_is_named_with_how_to_restart_it() -> None:
    """S9: a second install said how to start it, and the old process went on unseen."""
    left = UnitState("hapticd@left.service", "active", "enabled", "1000 Hz", "success", 0)
    one = UnitState("hapticd.service", "inactive", "disabled", "", "success", 0)
    assert advice_after_install([one]) == ["start it, now and with the computer: systemctl enable --now hapticd"]
    assert advice_after_install([one, left]) == [
        "hapticd@left.service still runs what was installed before: systemctl restart hapticd@left.service"
    ]


def test_make_uninstall_may_be_asked_for_twice(tmp_path: Path) -> None:
    make("uninstall", f"DESTDIR={tmp_path}")


def test_a_command_of_the_same_name_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "usr/local/bin").mkdir(parents=True)
    (tmp_path / "usr/local/bin/hapticd").write_text("somebody else's")
    installed(tmp_path).uninstall(silent)
    assert (tmp_path / "usr/local/bin/hapticd").read_text() == "somebody else's"


def test_what_is_missing_or_was_changed_is_told(tmp_path: Path) -> None:
    installation = installed(tmp_path)
    (tmp_path / "usr/local/lib/tmpfiles.d/hapticd.conf").write_text("# changed\n")
    (tmp_path / "usr/local/lib/sysusers.d/hapticd.conf").unlink()
    states = {file.path.parent.name: file.state for file in installation.files()}
    assert (states["tmpfiles.d"], states["sysusers.d"], states["system"]) == ("changed", "missing", "installed")


@pytest.mark.parametrize(
    "place", ["/home/lab/venv/bin/hapticd", "/run/user/7/venv/bin/hapticd", "/tmp/venv/bin/hapticd"]
)
def test_a_live_installation_from_where_the_sandbox_cannot_look_is_refused(place: str) -> None:
    with pytest.raises(InstallationError, match=r"the service may not look into /(home|run/user|tmp), .*make install"):
        Installation(executable=Path(place)).install(silent)


def test_a_root_that_is_a_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "tree").touch()
    with pytest.raises(InstallationError, match=r"tree.*: Not a directory"):
        installed(tmp_path / "tree")


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "usr").write_text("a file where a directory should be")
    with pytest.raises(InstallationError, match="usr/local/lib"):
        installed(tmp_path)


def test_a_relative_executable_is_taken_from_where_one_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    installed(tmp_path / "tree", "bin/hapticd")
    unit = (tmp_path / "tree/usr/local/lib/systemd/system/hapticd.service").read_text()
    assert f"ExecStart={tmp_path}/bin/hapticd run" in unit


def test_status_can_be_read_by_a_program() -> None:
    hapticd = Path(sys.executable).with_name("hapticd")
    done = subprocess.run([hapticd, "service", "status", "--json"], capture_output=True, text=True, check=False)
    shown = json.loads(done.stdout)
    assert len(shown["files"]) == len(FILES) - 2 + len(SHARED)
    told = subprocess.run([hapticd, "service", "status"], capture_output=True, text=True, check=False).stdout
    assert ("sudo hapticd service install" in told) == (set(shown["files"].values()) != {"installed"})
    assert done.returncode == (0 if shown["units"] and set(shown["files"].values()) == {"installed"} else 1)


@pytest.mark.timeout(600)
def test_make_installs_into_a_tree_that_does_not_remember_where_it_was_built(tmp_path: Path) -> None:
    root = tmp_path / "tree"
    make("install", f"PYTHON={sys.executable}", f"DESTDIR={root}")
    program = {name for name in files(root) if name.startswith("opt/hapticd/")}
    assert files(root) - program == FILES | SHARED
    assert "opt/hapticd/bin/hapticd" in program
    texts = [root / name for name in program if (root / name).is_file()]
    remembering = [path for path in texts if str(root).encode() in path.read_bytes()]
    assert remembering == []
    assert (root / "opt/hapticd/bin/hapticd").read_text().startswith("#!/opt/hapticd/bin/python")
    shared = "import hapticd.paths, sys; sys.stdout.write(str(hapticd.paths.directory('systemd')))"
    place = subprocess.run(
        [root / "opt/hapticd/bin/python", "-c", shared], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert place.stdout.startswith(str(root)), "units come with the wheel, not from the source tree"

    make("uninstall", f"DESTDIR={root}")
    assert files(root) == {CONFIG}


def test_make_uninstall_removes_only_a_directory_of_its_own(tmp_path: Path) -> None:
    done = subprocess.run(
        ["make", "uninstall", f"DESTDIR={tmp_path}", "PREFIX=/usr/local"],
        cwd=SOURCE,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert "directory of its own" in done.stdout
