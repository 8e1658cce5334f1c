"""A service that reaches its memory bound: the kernel kills a process, and the other one takes the force away."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.daemon.running import Daemon
from tests.daemon.test_deaths import PRESSED, nothing_left

BOUND = 200 << 20
"""Less than the unit's, so that less has to be filled [bytes]."""

LEAKING_LAW = '''
"""A law that keeps ever more once it has been asked 1000 times in contact."""
from hapticd.law import LawParams
kept = []
class Params(LawParams):
    """None."""
class State:
    """Counts."""
    asked: int
def start(state, params, snapshot):
    """Count from zero."""
def step(state, params, tick):
    """Keep a megabyte."""
    state.asked += 1
    if state.asked > 1000:
        kept.append(bytearray(1 << 20))
    return tick.contact_n
'''


@pytest.fixture
def bounded() -> Iterator[Path]:
    """A group of processes as systemd makes one of `MemoryMax`; its list of processes."""
    old, new = Path("/sys/fs/cgroup/memory"), Path("/sys/fs/cgroup")
    group, limit = (old, "memory.limit_in_bytes") if old.is_dir() else (new, "memory.max")
    group /= "hapticd-test"
    try:
        group.mkdir()
        (group / limit).write_text(str(BOUND))
    except OSError as error:
        with contextlib.suppress(OSError):
            group.rmdir()
        pytest.skip(f"no group of processes with a memory bound can be made here: {error}")
    yield group / "cgroup.procs"
    group.rmdir()


@pytest.mark.nightly
def test_beyond_its_memory_the_loop_is_killed_and_the_device_left_without_force(bounded: Path, tmp_path: Path) -> None:
    """As after any death of the loop; the unit is started again, since this is no exit with 2."""
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab/leaking.py").write_text(LEAKING_LAW)
    config = PRESSED + '[controller]\nlaw = "lab.leaking"\n[loop]\nlaw_budget = 1.0\n'
    prefix = ("sh", "-c", f'echo $$ > {bounded}; exec "$0" "$@"')
    with Daemon(config, prefix=prefix, pythonpath=tmp_path) as daemon:
        assert daemon.wait_exit() == 1
        assert "killed by signal 9; the device is without force" in daemon.output()
        assert nothing_left(daemon)
