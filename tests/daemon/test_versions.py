"""An upgrade under a running daemon: a process of another version does not join it."""

from __future__ import annotations

import signal
from dataclasses import replace
from pathlib import Path

import pytest

from hapticd import version
from hapticd.config.loading import LoadedConfig, parse
from hapticd.errors import ConfigError, HapticdError
from hapticd.supervisor.child import LoopStart


def test_a_loop_of_another_version_is_refused_by_name_before_it_opens_the_device(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """S9: after an upgrade the next device that was found again met two versions at once."""
    monkeypatch.setattr(version, "__version__", "0.0.7")
    with pytest.raises(HapticdError, match=r"hapticd \d.* was installed while 0\.0\.7 runs: restart the daemon"):
        LoopStart(parse("", str(Path("lab.toml")))).wait()


def test_a_loop_that_refuses_before_it_is_told_to_go_on_is_heard(tmp_path: Path) -> None:
    """A packet that it has not read when it ends would take its answer away."""
    file = tmp_path / "lab.toml"
    for wait in (True, False):
        start = LoopStart(_with_text(parse("", str(file)), "[loop]\nrate_hz = 5\n"), wait=wait)
        if wait:
            start.go()
        with pytest.raises(ConfigError, match="rate_hz"):
            start.wait()


def test_a_loop_that_was_killed_before_it_was_told_to_go_on_has_died(tmp_path: Path) -> None:
    start = LoopStart(parse("", str(tmp_path / "lab.toml")), wait=True)
    start._process.send_signal(signal.SIGSTOP)
    start.go()
    start._process.kill()
    with pytest.raises(HapticdError, match="died while it started"):
        start.wait()


def _with_text(config: LoadedConfig, text: str) -> LoadedConfig:
    """A configuration that became unusable between the supervisor's look and the loop's."""
    return replace(config, text=text)
