"""The Debian package on a clean Debian: built there, installed, upgraded while it runs, removed, purged."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from email.parser import Parser

import pytest

from hapticd.version import __version__
from tests.daemon.running import Subscriber
from tests.daemon.test_deaths import PRESSED
from tests.service.machine import SOURCE, Machine, booted, eventually

pytestmark = pytest.mark.timeout(900)  # the first machine ever has to be made

CONFIG = "/etc/hapticd/hapticd.toml"
NEXT = "99.1"
REPACK = f"""
set -e
dpkg-deb --raw-extract /run/dist/hapticd_*.deb /run/next
sed -i 's/^Version: .*/Version: {NEXT}/' /run/next/DEBIAN/control
dpkg-deb --root-owner-group -Znone --build /run/next /run/next.deb
rm -r /run/next
"""


@dataclass(frozen=True)
class Built:
    machine: Machine
    package: str

    def said(self, *command: str) -> str:
        return self.machine.run(*command).stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Built]:
    """A machine that has built the package and has nothing of hapticd besides."""
    with booted(tmp_path_factory.mktemp("machine") / "console") as machine:
        machine.run("/opt/src/deb/build", "/run/dist")
        package = machine.run("sh", "-c", "ls /run/dist/*.deb").stdout.strip()
        yield Built(machine, package)


def entries(built: Built) -> dict[str, tuple[str, str]]:
    """Mode and owner of everything in the package, by its path."""
    lines = built.said("dpkg-deb", "--contents", built.package).splitlines()
    fields = [line.split(maxsplit=5) for line in lines]
    return {path.partition(" -> ")[0].removeprefix("."): (mode, owner) for mode, owner, *_, path in fields}


def ours(built: Built) -> set[str]:
    """What there is of hapticd in the machine, besides what a running service has."""
    places = ("/etc", "/usr", "/opt", "/var", "/lib/systemd", "/home")
    found = built.said("find", *places, "-path", "/opt/src", "-prune", "-o", "-name", "*hapticd*", "-print")
    return {path for path in found.split() if not path.startswith(("/var/lib/dpkg/", "/var/lib/systemd/"))}


def test_what_it_says_of_itself(built: Built) -> None:
    said = Parser().parsestr(built.said("dpkg-deb", "--field", built.package))
    assert (said["Package"], said["Version"]) == ("hapticd", __version__)
    assert re.fullmatch(r"python3 \(>= 3\.(\d+)~\), python3 \(<< 3\.\d+\), .*systemd", said["Depends"])
    assert int(said["Installed-Size"]) > 10_000
    summary, *more = said["Description"].splitlines()
    assert len(summary) < 80
    assert not summary.startswith(("A ", "An ", "The "))
    assert all(re.match(r" \S", line) for line in more)
    assert built.said("dpkg-deb", "--info", built.package, "conffiles").split() == [CONFIG]


def test_it_has_the_page_of_the_dashboard_with_the_licence_of_its_plots(built: Built) -> None:
    (plots,) = [path for path in entries(built) if path.endswith("/page/vendor/uPlot.esm.js")]
    assert plots.replace("esm.js", "LICENSE") in entries(built)


def test_its_files_are_where_those_of_a_package_are_and_belong_to_root(built: Built) -> None:
    found = entries(built)
    places = ("/opt/hapticd/", "/usr/lib/", "/usr/share/", "/usr/bin/", "/etc/hapticd/")
    parents = {"/", "/opt/", "/usr/", "/etc/"}
    assert [path for path in found if path not in parents and not path.startswith(places)] == []
    assert {owner for _, owner in found.values()} == {"root/root"}
    assert [path for path, (mode, _) in found.items() if "s" in mode or ("w" in mode[4:] and mode[0] != "l")] == []
    shared = (
        *("doc/hapticd/copyright", "doc/hapticd/changelog.gz", "man/man1/hapticd.1.gz"),
        *("bash-completion/completions/hapticd", "zsh/vendor-completions/_hapticd"),
        *("fish/vendor_completions.d/hapticd.fish", "hapticd/grafana-dashboard.json"),
    )
    for path in shared:
        assert found[f"/usr/share/{path}"][0] == "-rw-r--r--"
    assert found["/usr/bin/hapticd"][0].startswith("l")
    sums = built.said("dpkg-deb", "--ctrl-tarfile", built.package)
    assert "md5sums" in sums


def test_it_installs_and_the_service_runs_from_it(built: Built) -> None:
    machine = built.machine
    done = machine.run("dpkg", "--install", built.package)
    assert "start it, now and with the computer: systemctl enable --now hapticd" in done.stdout
    machine.run("dpkg", "--verify", "hapticd")
    machine.run("id", "hapticd")
    machine.path(CONFIG).write_text(PRESSED)
    machine.run("systemctl", "enable", "--now", "hapticd")
    supervisor, control = machine.processes("hapticd.service")
    assert supervisor != control
    with Subscriber(f"ipc://{machine.path('/run/hapticd/default/telemetry')}", "hapticd/position") as subscriber:
        assert subscriber.until("hapticd/position")["seq"] >= 0
    shown = machine.run("hapticd", "service", "status")
    assert "missing" not in shown.stdout + shown.stderr
    assert "/usr/lib/systemd/system/hapticd.service" in shown.stdout
    assert machine.run("hapticd", "--version").stdout == f"hapticd {__version__}\n"


def test_its_metrics_are_served_to_this_computer(built: Built) -> None:
    machine = built.machine
    machine.run("systemctl", "start", "hapticd-metrics")
    assert machine.show("hapticd-metrics", "DynamicUser") == "yes"

    def scraped() -> str:
        script = "import urllib.request as u; print(u.urlopen('http://127.0.0.1:9876/metrics').read().decode())"
        return machine.run("python3", "-c", script, check=False).stdout

    eventually(lambda: 'hapticd_up{daemon="system/default"} 1.0' in scraped(), "the daemon in the metrics", machine)
    assert 'hapticd_armed{daemon="system/default"} 1.0' in scraped()
    assert "hapticd-metrics.service" in machine.run("hapticd", "service", "status").stdout


def test_all_that_it_brings_has_the_version_that_was_tested(built: Built) -> None:
    installed = set(built.said("/opt/hapticd/bin/pip", "freeze").lower().replace("_", "-").split())
    pinned = {line for line in (SOURCE / "constraints.txt").read_text().splitlines() if not line.startswith("#")}
    assert installed - pinned == {f"hapticd=={__version__}"}
    assert pinned - installed == set()


@pytest.mark.parametrize("command", [("make", "-C", "/opt/src"), ("hapticd", "service")], ids=["make", "service"])
@pytest.mark.parametrize("action", ["install", "uninstall"])
def test_the_other_way_of_installing_leaves_the_packages_files_alone(
    built: Built, command: tuple[str, ...], action: str
) -> None:
    before = built.machine.processes("hapticd.service")
    refused = built.machine.run(*command, action, check=False)
    assert refused.returncode != 0
    assert "hapticd is here as a package, which owns its files: apt install or apt remove hapticd" in (
        refused.stdout + refused.stderr
    )
    assert built.machine.processes("hapticd.service") == before
    built.machine.run("dpkg", "--verify", "hapticd")


def test_an_upgrade_keeps_the_configuration_and_says_what_goes_on_with_the_old_version(built: Built) -> None:
    machine = built.machine
    before = machine.processes("hapticd.service")
    machine.run("sh", "-c", REPACK)
    done = machine.run("dpkg", "--install", "/run/next.deb")
    assert "hapticd.service still runs what was installed before: systemctl restart hapticd.service" in done.stdout
    assert "systemctl restart hapticd-metrics.service" in done.stdout
    assert "enable --now" not in done.stdout
    assert machine.processes("hapticd.service") == before
    assert machine.path(CONFIG).read_text() == PRESSED
    machine.run("systemctl", "restart", "hapticd")
    assert not set(machine.processes("hapticd.service")) & set(before)


def test_a_removal_leaves_configurations_and_records_only(built: Built) -> None:
    machine = built.machine
    machine.path("/etc/hapticd/left.toml").write_text(PRESSED)
    machine.run("systemctl", "enable", "--now", "hapticd@left")
    machine.path("/opt/hapticd/lib/my_lab.py").write_text("# what pip puts there\n")
    machine.run("dpkg", "--remove", "hapticd")
    assert machine.show("hapticd", "LoadState") == "not-found"
    assert machine.show("hapticd@left", "ActiveState") == "inactive"
    assert ours(built) == {"/etc/hapticd", CONFIG, "/var/lib/hapticd"}
    assert not list(machine.path("/etc/systemd/system/multi-user.target.wants").glob("hapticd*"))


def test_a_purge_leaves_what_others_wrote(built: Built) -> None:
    machine = built.machine
    done = machine.run("dpkg", "--purge", "hapticd")
    assert "kept: /etc/hapticd, in which there are files of yours" in done.stdout
    assert ours(built) == {"/etc/hapticd"}
    machine.run("rm", "-r", "/etc/hapticd")


def test_it_does_not_install_over_what_make_install_made(built: Built) -> None:
    machine = built.machine
    unit = machine.path("/usr/local/lib/systemd/system/hapticd.service")
    unit.parent.mkdir(parents=True)
    unit.touch()
    refused = machine.run("dpkg", "--install", built.package, check=False)
    assert refused.returncode != 0
    assert "installed here from its source tree already" in refused.stderr
    assert not machine.path("/opt/hapticd").exists()
