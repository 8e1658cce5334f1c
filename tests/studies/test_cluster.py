"""On a cluster of real worker processes no result is lost when one of them is killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hapticd.cli import main

pytest.importorskip("distributed")

HAPTICD = str(Path(sys.executable).with_name("hapticd"))
ROOT = Path(__file__).parents[2]
BLOCKS = 16
MAP = ("study", "zwidth", "--cells", "80x100", "--duration", "8", "--laws", "none")


class Cluster:
    """A scheduler and two workers, each a process of its own, without nannies that would start them again."""

    def __init__(self, folder: Path) -> None:
        self.address = folder / "scheduler.json"
        self._folder = folder
        # A worker that is killed leaves its scratch behind.
        self._environment = {**os.environ, "PYTHONPATH": str(ROOT), "DASK_TEMPORARY_DIRECTORY": str(folder)}
        self._processes: list[subprocess.Popen[bytes]] = []
        self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-jupyter")
        # The file is there before its text is.
        wait(lambda: self.address.exists() and self.address.read_text().rstrip().endswith("}"))
        self.url: str = json.loads(self.address.read_text())["address"]
        self.workers = [self._start("worker", "--no-nanny", "--nthreads", "1", "--no-dashboard") for _ in range(2)]

    def _start(self, role: str, *arguments: str) -> subprocess.Popen[bytes]:
        command = [
            sys.executable,
            "-m",
            f"distributed.cli.dask_{role}",
            "--scheduler-file",
            str(self.address),
            *arguments,
        ]
        log = (self._folder / f"{role}-{len(self._processes)}.log").open("wb")
        with log:
            process = subprocess.Popen(command, stdout=log, stderr=log, cwd=self._folder, env=self._environment)
        self._processes.append(process)
        return process

    def stop(self) -> None:
        for process in reversed(self._processes):
            process.kill()
            process.wait()


def wait(condition: Callable[[], bool], at_most_s: float = 60.0) -> None:
    until = time.monotonic() + at_most_s
    while not condition():
        assert time.monotonic() < until, "waited in vain"
        time.sleep(0.01)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    running = Cluster(tmp_path_factory.mktemp("cluster"))
    try:
        yield running
    finally:
        running.stop()


def here(folder: Path) -> int:
    """The same map on this machine."""
    with pytest.raises(SystemExit) as left:
        main([*MAP, "--output", str(folder)])
    return int(left.value.code or 0)


def finished(journal: Path) -> int:
    return max(0, journal.read_bytes().count(b"\n") - 1) if journal.exists() else 0


@pytest.mark.nightly
def test_a_worker_that_is_killed_in_the_middle_costs_no_result(cluster: Cluster, tmp_path: Path) -> None:
    command = [HAPTICD, *MAP, "--output", str(tmp_path / "far"), "--cluster", cluster.url]
    study = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    journal = tmp_path / "far" / "zwidth.journal"
    wait(lambda: finished(journal) >= 2 or study.poll() is not None)
    victim, survivor = cluster.workers
    victim.send_signal(signal.SIGKILL)
    before = finished(journal)
    _, said = study.communicate(timeout=100)
    assert study.returncode == 0, said
    assert 2 <= before < BLOCKS - 2  # it died with work still to do
    assert victim.wait() == -signal.SIGKILL
    assert survivor.poll() is None

    assert here(tmp_path / "near") == 0
    for name in ("zwidth.csv", "zwidth.json", "zwidth.png"):
        assert (tmp_path / "far" / name).read_bytes() == (tmp_path / "near" / name).read_bytes()


def test_a_cluster_that_is_gone_leaves_what_was_done(cluster: Cluster, tmp_path: Path) -> None:
    """The scheduler dies too: one line, and the same command goes on from the journal, here without a cluster."""
    command = [HAPTICD, *MAP, "--output", str(tmp_path / "out"), "--cluster", cluster.url]
    impatient = {**os.environ, "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "2s"}
    study = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=impatient)
    journal = tmp_path / "out" / "zwidth.journal"
    wait(lambda: finished(journal) >= 2 or study.poll() is not None)
    cluster.stop()
    _, said = study.communicate(timeout=100)
    assert study.returncode == 1
    assert b"lost the scheduler" in said
    assert b"Traceback" not in said
    assert finished(journal) >= 2
    assert here(tmp_path / "out") == 0
    assert not journal.exists()
