"""An upgrade under a running daemon: a process of another version does not join it."""

from __future__ import annotations

from pathlib import Path

import pytest

from hapticd import version
from hapticd.config.loading import parse
from hapticd.errors import HapticdError
from hapticd.supervisor.child import LoopStart


def test_a_loop_of_another_version_is_refused_by_name_before_it_opens_the_device(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """S9: after an upgrade the next device that was found again met two versions at once."""
    monkeypatch.setattr(version, "__version__", "0.0.7")
    with pytest.raises(HapticdError, match=r"hapticd \d.* was installed while 0\.0\.7 runs: restart the daemon"):
        LoopStart(parse("", str(Path("lab.toml")))).wait()
