"""Test files that take longest, longest first: begun with, so that no worker is left alone with one at the end."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parent.parent

LONGEST = (
    "tests/service/test_systemd.py",
    "tests/studies/test_transparency.py",
    "tests/daemon/test_faults.py",
    "tests/studies/test_paper.py",
    "tests/views/dashboard/test_page.py",
    "tests/daemon/test_verdicts.py",
    "tests/views/test_report.py",
    "tests/daemon/test_walls.py",
    "tests/drivers/moteus/test_daemon.py",
    "tests/drivers/odrive/test_daemon.py",
    "tests/daemon/test_space_presses.py",
    "tests/drivers/forcedimension/test_states.py",
    "tests/daemon/test_commands.py",
    "tests/simulation/test_batch.py",
    "tests/drivers/forcedimension/test_daemon.py",
    "tests/studies/test_scene.py",
    "tests/drivers/haply/test_faults.py",
    "tests/service/test_package.py",
    "tests/simulation/test_space_batch.py",
    "tests/studies/test_zwidth.py",
    "tests/service/test_install.py",
    "tests/cli/test_devices.py",
    "tests/studies/test_cluster.py",
)
"""By the seconds of a whole run on two processors; what takes less than 27 s is not here."""


def rank(file: Path) -> int:
    """When a file is begun: the longest first, the others after them."""
    return _RANKS.get(file, len(LONGEST))


_RANKS = {ROOT / name: at for at, name in enumerate(LONGEST)}
