"""How a loop on its way refuses or fails: of another version, unusable, killed, or with no room for its descriptor."""

from __future__ import annotations

import resource
import select
import signal
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import pytest

from hapticd import version
from hapticd.config.loading import LoadedConfig, parse
from hapticd.errors import ConfigError, HapticdError
from hapticd.loop.force_mark import ForceMark
from hapticd.supervisor.child import LoopStart
from tests.daemon.running import PATIENCE_S


def test_a_loop_of_another_version_is_refused_by_name_before_it_opens_the_device(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """S9: after an upgrade the next device that was found again met two versions at once."""
    monkeypatch.setattr(version, "__version__", "0.0.7")
    with pytest.raises(HapticdError, match=r"hapticd \d.* was installed while 0\.0\.7 runs: restart the daemon"):
        LoopStart(parse("", str(Path("lab.toml"))), Mock(), ForceMark()).wait()


def test_a_loop_that_refuses_before_it_is_told_to_go_on_is_heard(tmp_path: Path) -> None:
    """A packet that it has not read when it ends would take its answer away."""
    file = tmp_path / "lab.toml"
    for wait in (True, False):
        start = LoopStart(_with_text(parse("", str(file)), "[loop]\nrate_hz = 5\n"), Mock(), ForceMark(), wait=wait)
        if wait:
            start.go()
        with pytest.raises(ConfigError, match="rate_hz"):
            start.wait()


def test_a_loop_that_was_killed_before_it_was_told_to_go_on_has_died(tmp_path: Path) -> None:
    start = LoopStart(parse("", str(tmp_path / "lab.toml")), Mock(), ForceMark(), wait=True)
    start._process.send_signal(signal.SIGSTOP)
    start.go()
    start._process.kill()
    with pytest.raises(HapticdError, match="died while it started"):
        start.wait()


def test_where_no_descriptor_is_left_for_a_loop_that_is_ready_the_error_says_so(tmp_path: Path) -> None:
    """It was a KeyError, which a search for a lost device does not survive."""
    start = LoopStart(parse("[loop]\nrealtime = 'off'\n", str(tmp_path / "lab.toml")), Mock(), ForceMark())
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, hard))
    try:
        with pytest.raises(HapticdError, match="LimitNOFILE"):
            start.wait()
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    assert start._process.returncode is not None


def test_the_force_of_a_loop_that_has_to_be_killed_is_taken_away_from_outside(tmp_path: Path) -> None:
    """It may have been ready, and armed, before it was looked at; it was only killed."""
    why: list[str] = []
    start = LoopStart(parse("[loop]\nrealtime = 'off'\n", str(tmp_path / "lab.toml")), why.append, ForceMark())
    assert select.select([start._channel], [], [], PATIENCE_S)[0]
    start._process.send_signal(signal.SIGSTOP)
    start.end()
    start.end()
    assert why == ["the control loop did not end and was killed"]
    assert start._process.returncode == -signal.SIGKILL


def _with_text(config: LoadedConfig, text: str) -> LoadedConfig:
    """A configuration that became unusable between the supervisor's look and the loop's."""
    return replace(config, text=text)
