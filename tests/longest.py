"""Test files that take longest, longest first: begun with, so that no worker is left alone with one at the end."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parent.parent

LONGEST = (
    "tests/daemon/test_walls.py",
    "tests/service/test_systemd.py",
    "tests/daemon/test_subscribers.py",
    "tests/daemon/test_faults.py",
    "tests/studies/test_transparency.py",
    "tests/keys/test_server.py",
    "tests/daemon/test_verdicts.py",
    "tests/views/dashboard/test_page.py",
    "tests/views/test_report.py",
    "tests/drivers/odrive/test_daemon.py",
    "tests/drivers/moteus/test_daemon.py",
    "tests/studies/test_cluster.py",
    "tests/daemon/test_space.py",
    "tests/studies/test_zwidth.py",
)
"""By the seconds of a whole run on two processors; what takes less than 30 s is not here."""


def rank(file: Path) -> int:
    """When a file is begun: the longest first, the others after them."""
    return _RANKS.get(file, len(LONGEST))


_RANKS = {ROOT / name: at for at, name in enumerate(LONGEST)}
