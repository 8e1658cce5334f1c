"""What the daemons of tests leave behind."""

from __future__ import annotations

import pytest

from tests.daemon import running
from tests.daemon.running import Daemon


def test_a_daemon_that_is_never_ready_costs_no_other_test_its_processor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "PATIENCE_S", 0.1)
    daemon = Daemon("", prefix=("sh", "-c", "exec sleep 60"))
    with pytest.raises(AssertionError, match="no READY=1"), daemon.wait_ready():
        pass
    assert daemon.process.poll() is not None
    assert not daemon.directory.exists()
