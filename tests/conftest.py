"""What holds for every test: in CI nothing is skipped, since a skipped test proves nothing; examples may be slow."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from xdist.remote import Producer

from tests import neighbour, repeating, standstill, tally
from tests.dealing import TOGETHER, WAITING, Dealing
from tests.examples import TIMES, examples
from tests.longest import LONGEST, ROOT, rank

OWN_PACKAGES = ("lab", "mylab")
"""What tests call the packages of a laboratory's own."""

IN_CI = os.environ.get("CI") == "true"

# On a busy machine any example may be slow. The rest stays Hypothesis's own: in CI the same examples every time, but
# others each night in the nightly run, which has many.
settings.register_profile("unhurried", examples(100), deadline=None, derandomize=IN_CI and TIMES == 1)
settings.load_profile("unhurried")


def pytest_configure(config: pytest.Config) -> None:
    """Give every child the signals that a terminal gives it: a runner in the background has them ignored."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    in_charge = not hasattr(config, "workerinput")
    if in_charge:  # one witness, one neighbour and one busy processor for all workers
        _keep(config, standstill.witnesses())
        _keep(config, neighbour.neighbour())
    _keep(config, _own_instances())
    if repeating.REPEAT > 1:
        config.pluginmanager.register(repeating.Repeating(tally.opened(), repeating.REPEAT))
        if in_charge:
            _keep(config, repeating.busy_processor())


@contextlib.contextmanager
def _own_instances() -> Iterator[None]:
    """Meet no daemon of this computer, nor one of another worker, where a test names no directory."""
    with tempfile.TemporaryDirectory(prefix="hapticd-") as directory, pytest.MonkeyPatch.context() as patch:
        patch.setenv("HAPTICD_RUNTIME_DIR", directory)
        yield


def _keep(config: pytest.Config, what: contextlib.AbstractContextManager[None]) -> None:
    """Have it until pytest ends."""
    kept = contextlib.ExitStack()
    kept.enter_context(what)
    config.add_cleanup(kept.close)


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Generator[None, object, object]:
    """Look for no garbage in what is read, which stays: that is half the time that reading takes."""
    gc.disable()
    try:
        return (yield)
    finally:
        if hasattr(session.config, "workerinput"):  # nor later, in a worker that has read all there is
            gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files that take longest; in a file everything stays in order."""
    missing = [name for name in (*LONGEST, *WAITING, *TOGETHER) if not (ROOT / name).exists()]
    if missing:
        raise pytest.UsageError(f"tests/longest.py or tests/dealing.py names what is not there: {', '.join(missing)}")
    items.sort(key=lambda item: rank(item.path))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Dealing | None:
    """Deal whole files out; None: as xdist does it where that is not what is asked."""
    return Dealing(config, log) if config.getoption("dist") == "loadfile" else None


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of this checkout, unpacked as an installer would do it; on PYTHONPATH it comes before the checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    done = subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder],
        cwd=Path(__file__).parent.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site-packages")
    return folder / "site-packages"


@pytest.fixture(autouse=True)
def own_packages() -> Generator[None, None, None]:
    """Forget the packages of a laboratory's own that a test has made, so that the next test finds none of that name."""
    yield
    for name in [name for name in sys.modules if name.partition(".")[0] in OWN_PACKAGES]:
        del sys.modules[name]


def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool:
    """Run a test, and once more if it failed while the computer stood still."""
    return standstill.run(item, nextitem)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say what tests have to say though they pass: their property `prints`."""
    for report in terminalreporter.getreports("passed"):
        for name, said in report.user_properties:
            if name == "prints":
                terminalreporter.write_line(str(said))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    _refuse_skip(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    report = yield
    _refuse_skip(report)
    return report


def _refuse_skip(report: pytest.TestReport | pytest.CollectReport) -> None:
    if IN_CI and report.skipped and not hasattr(report, "wasxfail"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        report.outcome = "failed"
        report.longrepr = f"skipped in CI: {reason}"
