"""A small Debian that systemd runs, without a network and thrown away afterwards, for tests of the installed service.

Root file system and wheels are made once and kept below the user's cache directory; each machine changes only an
overlay in memory. It sees the source tree read-only.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import platform
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hapticd.loop.memory import SharedMemory
from hapticd.tick.record import RecordLayout
from tests.daemon.running import PATIENCE_S, wait_until

SOURCE = Path(__file__).parent.parent.parent
PACKAGES = ("systemd", "systemd-sysv", "dbus", "python3", "python3-venv", "make", "udev", "umockdev")
TOOLS = ("systemd-nspawn", "debootstrap", "nsenter", "apt-get")
PLATFORMS = ("manylinux2014_x86_64", "manylinux_2_17_x86_64", "manylinux_2_28_x86_64", "manylinux_2_34_x86_64")
NODES = {"null": 3, "zero": 5, "full": 7, "random": 8, "urandom": 9}
"""Devices that a machine gets copies of, by their minor numbers; the major number of all is 1."""

PATH = "/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


class Machine:
    """A booted machine.

    Args:
        tree: its root file system, which is not changed.
        wheels: a directory of wheels, all that its pip can install.
        log: where its console goes.
    """

    def __init__(self, tree: Path, wheels: Path, log: Path) -> None:
        self._log = log
        with log.open("w") as console:
            self._nspawn = subprocess.Popen(
                [
                    *("systemd-nspawn", "--quiet", f"--directory={tree}", "--volatile=overlay"),
                    *("--register=no", "--keep-unit", "--private-network", "--capability=CAP_IPC_LOCK"),
                    *(f"--bind-ro={SOURCE}:/opt/src", f"--bind-ro={wheels}:/opt/wheels"),
                    *("--boot", "systemd.unit=multi-user.target"),
                ],
                stdin=subprocess.DEVNULL,
                stdout=console,
                stderr=console,
                start_new_session=True,
            )
        self._leader = 0
        try:
            wait_until(self._booted, "the machine to boot")
        except BaseException:
            self.power_off()
            raise

    def run(
        self, *command: str, check: bool = True, user: str | None = None, given: str = ""
    ) -> subprocess.CompletedProcess[str]:
        """Run a command in the machine, as root or a user."""
        as_user = ["runuser", "-u", user, "--"] if user else []
        done = subprocess.run(
            [
                *("nsenter", "--target", str(self._leader), "--all"),
                *("env", "--ignore-environment", f"PATH={PATH}", "PIP_NO_INDEX=1", "PIP_FIND_LINKS=/opt/wheels"),
                *as_user,
                *command,
            ],
            input=given,
            capture_output=True,
            text=True,
            check=False,
        )
        assert not check or done.returncode == 0, f"{' '.join(command)}: {done.stdout}{done.stderr}{self.journal()}"
        return done

    def show(self, unit: str, key: str) -> str:
        """A property of a unit."""
        return self.run("systemctl", "show", "--value", f"--property={key}", unit).stdout.strip()

    def journal(self) -> str:
        """The last lines of the journal."""
        command = ("nsenter", "--target", str(self._leader), "--all", "journalctl", "--no-pager", "--lines=30")
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout

    def path(self, path: str) -> Path:
        """A path of the machine as this process reaches it; sockets too."""
        return Path(f"/proc/{self._leader}/root{path}")

    def processes(self, unit: str) -> tuple[int, int]:
        """Supervisor and control process of a unit, as this process numbers them."""
        main = self.show(unit, "MainPID")
        namespace = Path(f"/proc/{self._leader}/ns/pid").readlink()
        supervisor = control = 0
        for entry in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                if (entry / "ns/pid").readlink() != namespace:
                    continue
                status = (entry / "status").read_bytes()  # and a command line: bytes of any kind
                inside = next(line for line in status.splitlines() if line.startswith(b"NSpid:")).split()[-1].decode()
                command = (entry / "cmdline").read_bytes().split(b"\0")
                if inside == main:
                    supervisor = int(entry.name)
                elif b"hapticd.loop.process" in command and command[command.index(b"--parent") + 1].decode() == main:
                    control = int(entry.name)
        assert supervisor
        assert control, self.journal()
        return supervisor, control

    def power_off(self) -> None:
        """Switch it off."""
        if self._leader:
            self.run("systemctl", "poweroff", check=False)
        try:
            self._nspawn.wait(PATIENCE_S if self._leader else 0.0)
        except subprocess.TimeoutExpired:
            for pid in (self._nspawn.pid, self._leader):
                if pid:
                    os.kill(pid, signal.SIGKILL)
            self._nspawn.wait()

    def _booted(self) -> bool:
        assert self._nspawn.poll() is None, f"the machine did not boot: {self._log.read_text()}"
        children = Path(f"/proc/{self._nspawn.pid}/task/{self._nspawn.pid}/children").read_text().split()
        self._leader = int(children[0]) if children else 0
        # Before it has a root of its own, a command would meet the host's systemd; and nspawn's first child goes away.
        with contextlib.suppress(FileNotFoundError):
            own_root = self._leader and not self.path("/").samefile("/") and self.path("/run/systemd/system").is_dir()
            return bool(own_root) and self._is_running()
        return False

    def _is_running(self) -> bool:
        return self.run("systemctl", "is-system-running", check=False).stdout.strip() in {"running", "degraded"}


def memory_of(control_pid: int) -> SharedMemory:
    """The shared memory of a control process, which outlives it while we hold it."""
    for link in Path(f"/proc/{control_pid}/fd").iterdir():
        if str(link.readlink()) == "/memfd:hapticd (deleted)":
            return SharedMemory(RecordLayout(1, False, 8), 1000.0, os.open(link, os.O_RDWR | os.O_CLOEXEC))
    raise AssertionError("the control process has no shared memory")


@contextlib.contextmanager
def booted(log: Path) -> Iterator[Machine]:
    """A machine for the time of a test module; skips where there can be none."""
    if os.geteuid() != 0:
        pytest.skip("only root can boot a machine")
    broken = broken_nodes(Path("/dev"))
    if broken:
        pytest.fail(broken, pytrace=False)
    missing = [tool for tool in TOOLS if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"missing: {', '.join(missing)}; `make packages` installs them")
    if platform.machine() != "x86_64":
        pytest.skip("the machine is one of x86-64")
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "hapticd-tests"
    cache.mkdir(parents=True, exist_ok=True)
    with (cache / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # one machine at a time uses the tree and our control group
        release, mirror = _distribution()
        tree = _made(cache, "tree", " ".join((release, *PACKAGES)), lambda place: _debootstrap(place, release, mirror))
        python = max(tree.glob("usr/bin/python3.*[0-9]")).name.removeprefix("python")
        needed = _needed()
        wheels = _made(cache, "wheels", " ".join((python, *needed)), lambda place: _download(place, python, needed))
        machine = Machine(tree, wheels, log)
        try:
            yield machine
        finally:
            machine.power_off()


def broken_nodes(directory: Path) -> str:
    """Which devices are there no more, with the line that mends it; empty when all are.

    A program that puts its output over /dev/null as root breaks it for every program; systemd-nspawn then only says
    `Input/output error`.

    Args:
        directory: where they are, /dev.
    """
    broken = {}
    for name, minor in NODES.items():
        with contextlib.suppress(OSError):
            node = (directory / name).stat()
            if stat.S_ISCHR(node.st_mode) and node.st_rdev == os.makedev(1, minor):
                continue
        broken[directory / name] = minor
    if not broken:
        return ""
    mend = "; ".join(f"rm -f {path}; mknod -m 666 {path} c 1 {minor}" for path, minor in broken.items())
    return (
        f"{', '.join(map(str, broken))}: not the device any more, so no machine can boot: a program that ran as root "
        f"has put a file there. To mend it: sudo sh -c '{mend}'"
    )


def _made(cache: Path, kind: str, of: str, make: Callable[[Path], None]) -> Path:
    """A directory of the cache, made when there is none for this recipe yet; older ones of its kind are removed."""
    wanted = cache / f"{kind}-{hashlib.sha256(of.encode()).hexdigest()[:16]}"
    if not wanted.is_dir():
        for old in cache.glob(f"{kind}-*"):
            shutil.rmtree(old)
        unfinished = Path(tempfile.mkdtemp(prefix=f"{kind}-", dir=cache))
        unfinished.chmod(0o755)
        make(unfinished)
        unfinished.rename(wanted)
    return wanted


def _distribution() -> tuple[str, str]:
    """This computer's release, and where its packages come from."""
    system = platform.freedesktop_os_release()
    release = system.get("VERSION_CODENAME", "")
    asked = ["apt-get", "indextargets", "--format", "$(ORIGIN) $(RELEASE) $(COMPONENT) $(REPO_URI)"]
    listed = subprocess.run(asked, capture_output=True, text=True, check=True).stdout
    sources = [line.rsplit(" ", 3) for line in listed.splitlines()]
    sources = [source for source in sources if source[1:3] == [release, "main"]]
    sources.sort(key=lambda source: source[0].lower() != system.get("ID", ""))
    if not sources:
        pytest.skip("apt knows no source of this computer's own release")
    return release, sources[0][3]


def _debootstrap(place: Path, release: str, mirror: str) -> None:
    command = ["debootstrap", "--variant=minbase", f"--include={','.join(PACKAGES)}", release, str(place), mirror]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]


def _needed() -> list[str]:
    """What `make install` takes from a package registry, in the versions that it names."""
    project = tomllib.loads((SOURCE / "pyproject.toml").read_text())
    pinned = [line for line in (SOURCE / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    return [*pinned, *project["build-system"]["requires"]]


def _download(place: Path, python: str, needed: list[str]) -> None:
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--dest", str(place), "--only-binary=:all:"]
    platforms = [f"--platform={platform}" for platform in PLATFORMS]
    done = subprocess.run(
        [*command, f"--python-version={python}", *platforms, *needed], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]


def eventually(condition: Callable[[], bool], what: str, machine: Machine) -> None:
    """Wait for something that systemd does; say what the journal says when it does not."""
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s, f"waited in vain for: {what}\n{machine.journal()}"
        time.sleep(0.05)
