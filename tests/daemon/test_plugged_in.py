"""A lost device is tried soon after something was plugged in, however long it has been away."""

from __future__ import annotations

import time
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest

from hapticd.errors import DeviceNotFoundError
from hapticd.simulation.options import SimulationOptions
from hapticd.supervisor import recovery
from hapticd.supervisor.recovery import LONGEST_S, SETTLE_S, HotplugWatch, Recovery
from hapticd_drivers.loopback import Loopback


@pytest.fixture
def bus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The kernel's list of devices; every look counts."""
    monkeypatch.setattr("hapticd.supervisor.recovery.EVERY_S", 0.0)
    monkeypatch.setattr("hapticd.supervisor.recovery.PLACES", (tmp_path, tmp_path / "nowhere"))
    (tmp_path / "usb1").touch()
    return tmp_path


def test_what_comes_is_news_once_and_what_goes_or_stays_is_none(bus: Path) -> None:
    arrivals = HotplugWatch()
    assert not arrivals.news()
    (bus / "1-2").touch()
    assert arrivals.news()
    assert not arrivals.news()
    (bus / "1-2").unlink()
    assert not arrivals.news()
    (bus / "1-2").touch()
    assert arrivals.news()


def test_the_lists_are_not_looked_at_more_often_than_needed(bus: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hapticd.supervisor.recovery.EVERY_S", 1000.0)
    arrivals = HotplugWatch()
    assert not arrivals.news()
    (bus / "1-2").touch()
    assert not arrivals.news()


class Absent:
    """A start that fails because there is no device."""

    tries = 0

    def __init__(self, *_: Any) -> None:
        Absent.tries += 1

    def poll(self) -> None:
        raise DeviceNotFoundError("not there")

    def end(self) -> None:
        """It has ended by itself."""


def test_a_device_that_has_been_away_for_long_is_tried_when_something_is_plugged_in(
    bus: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recovery, "LoopStart", Absent)
    info = Loopback(SimulationOptions(), 1e-3).open()
    lost: Any = SimpleNamespace(
        exit_code=0, force_seen_to=True, shared=SimpleNamespace(words=defaultdict(int)), info=info
    )
    looking = Recovery(Mock(), Mock())
    nothing: Any = None
    looking.begin(lost, "unplugged")
    for _ in range(8):  # time after time in vain
        looking.next_try_s = 0.0
        looking.turn(lost, nothing)
        looking.turn(lost, nothing)
    assert looking.next_try_s > time.monotonic() + 0.5 * LONGEST_S
    tries = Absent.tries
    (bus / "1-2").touch()
    looking.turn(lost, nothing)
    assert looking.next_try_s <= time.monotonic() + SETTLE_S
    assert Absent.tries == tries
    looking.next_try_s = 0.0
    looking.turn(lost, nothing)
    looking.turn(lost, nothing)
    assert Absent.tries == tries + 1
    assert looking.why == "not there"
