"""A law that is never done with being imported holds up no other reload."""

from __future__ import annotations

import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from hapticd.config.loading import parse
from hapticd.supervisor import reload
from hapticd.supervisor.reload import Reload
from hapticd.supervisor.state import DaemonState
from tests.daemon.running import wait_until


def test_a_file_that_cannot_be_checked_in_time_is_refused_and_the_next_one_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "lab.toml"
    file.write_text("")
    running = parse("", str(file))
    released = threading.Event()

    def endless(*_: object) -> None:
        released.wait()

    verdicts: list[str] = []
    state: Any = SimpleNamespace(
        config=running,
        reload_asked=[verdicts.append],
        notifier=SimpleNamespace(send=lambda *_: None),
        tell=lambda *_: None,
    )
    monkeypatch.setattr(reload, "CHECK_S", 0.05)
    monkeypatch.setattr(reload, "parse", endless)
    taking = Reload(cast(DaemonState, state))

    def answered(count: int) -> bool:
        taking.turn()
        return len(verdicts) == count

    wait_until(lambda: answered(1), "a verdict")
    assert "could not be checked within 0.05 s" in verdicts[0]
    monkeypatch.setattr(reload, "CHECK_S", 60.0)
    monkeypatch.setattr(reload, "parse", lambda *_: parse("[loop]\nrate_hz = 500.0\n", str(file)))
    state.reload_asked.append(verdicts.append)
    wait_until(lambda: answered(2), "a verdict on the next file")
    assert "needs a restart" in verdicts[1]
    released.set()
