"""The fault table of docs/serial-rig.md: how soon the driver names what goes wrong, and what push is left."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from hapticd.driver import DriverState
from hapticd.errors import DeviceDisconnectedError, DeviceFaultError, DeviceTimeoutError
from hapticd_drivers.rig import conversation
from hapticd_drivers.rig.serial_rig import SerialRig
from tests.drivers.rig.device import Rig
from tests.drivers.rig.ticking import tick
from tests.drivers.trouble import Trouble

PUSH_N = 1.0
SILENCE_MS = 20
STALL_US = 24_000
PAGE = Path(__file__).parents[3] / "docs" / "serial-rig.md"


def fall_silent(rig: Rig) -> None:
    rig.up = lambda _: b""


FAULTS = (
    Trouble(
        "the computer says nothing for 24 ms",
        lambda rig: rig.pass_time(STALL_US),
        DeviceFaultError,
        "watchdog heard no command for 20 ms",
        2,
        PUSH_N,
    ),
    Trouble("encoder fault", lambda rig: rig.break_down(1, 0, 1234), DeviceFaultError, "position signal", 2, 0.0),
    Trouble("motor driver fault", lambda rig: rig.break_down(2, 0, 0), DeviceFaultError, "motor driver", 2, 0.0),
    Trouble("switched off and on", Rig.restart, DeviceDisconnectedError, "has restarted", 2, 0.0),
    Trouble("unplugged", Rig.unplug, DeviceDisconnectedError, "is gone", 1, 0.0),
    Trouble("the rig says nothing", fall_silent, DeviceTimeoutError, "has not answered for 500 ticks", 502, PUSH_N),
)


@pytest.mark.parametrize("trouble", FAULTS, ids=lambda trouble: trouble.name)
def test_what_goes_wrong_is_named_soon_and_leaves_no_force(
    rig: Rig,
    pushing: SerialRig,
    trouble: Trouble,
    record_property: Callable[[str, object], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig.watch_force()
    trouble.happen(rig)
    ticks = ticks_until(rig, pushing, trouble)
    record_property("ticks", ticks)
    record_property("peak_n", rig.peak_n)
    assert ticks <= trouble.most_ticks
    assert rig.peak_n == pytest.approx(trouble.peak_n)
    monkeypatch.setattr(conversation, "PATIENCE_S", 0.2)  # some of them never answer
    monkeypatch.setattr(conversation, "URGENT_PATIENCE_S", 0.2)
    pushing.disable()
    assert pushing.state is DriverState.OPEN
    rig.pass_time(1000 * SILENCE_MS)
    assert rig.force_n == 0.0
    assert trouble.row() in PAGE.read_text()


def test_a_silent_computer_is_pushed_for_no_longer_than_the_watchdog_allows(rig: Rig, pushing: SerialRig) -> None:
    rig.watch_force()
    rig.pass_time(STALL_US)
    assert rig.force_n == 0.0
    assert SILENCE_MS - 1 <= 1e-3 * rig.pushed_us <= SILENCE_MS


def ticks_until(rig: Rig, driver: SerialRig, trouble: Trouble) -> int:
    ticks = 0

    def press_on() -> None:
        nonlocal ticks
        while ticks < 2000:
            ticks += 1
            tick(rig, driver, PUSH_N)

    with pytest.raises(trouble.kind, match=trouble.text):
        press_on()
    return ticks
