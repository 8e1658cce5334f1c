"""`hapticd tare`: the present position becomes the scene's origin, never under a force, and not for a device anew."""

from __future__ import annotations

from typing import Any

import pytest

from hapticd.tick.event import EventCode
from tests.daemon.running import Subscriber
from tests.faults.rig import Rig, anew_where_late, events_until


@anew_where_late
def test_walls_stand_where_it_was_tared_until_the_device_is_lost_and_then_nobody_arms_by_himself() -> None:
    with Rig(safety="auto_arm = true") as rig, rig.subscriber() as subscriber:
        rig.pressing()
        refused = rig.hapticd("tare")
        assert refused.returncode == 1
        assert "hapticd disarm" in refused.stderr
        assert subscriber.until("hapticd/status", armed=True)["origin_m"] == [0.0]

        # Without a wall the hand's own spring holds the device 1.5 mm behind where the wall stood.
        assert rig.ask("disarm")["ok"]
        subscriber.until("hapticd/status", armed=False, releasing=False)
        here = settled(subscriber)
        assert rig.hapticd("tare").returncode == 0
        event = events_until(subscriber, EventCode.TARED)[-1]
        assert event["origin_x_m"] == pytest.approx(here["position_m"][0], abs=5e-5)
        status = subscriber.until("hapticd/status", armed=False)
        assert status["origin_m"] == [event["origin_x_m"]]
        there = behind(subscriber, event["seq"])
        assert there["position_m"][0] == pytest.approx(0.0, abs=5e-5)
        assert there["velocity_m_per_s"][0] == pytest.approx(0.0, abs=0.1), "nothing has moved"

        # It is kept through a reload, and the wall is felt there.
        rig.switch('\n[controller]\nlaw = "none"\n')
        assert subscriber.until("hapticd/status", law="none")["origin_m"] == status["origin_m"]
        assert rig.ask("arm")["ok"]
        armed = events_until(subscriber, EventCode.ARMED)[-1]
        assert behind(subscriber, armed["seq"] + 200)["force_n"][0] == pytest.approx(0.0, abs=1.0)

        rig.order("unplugged")
        events_until(subscriber, EventCode.DEVICE_LOST)
        assert not rig.ask("tare")["ok"]
        rig.mend()
        events_until(subscriber, EventCode.DEVICE_FOUND)
        status = subscriber.until("hapticd/status", device_lost_timestamp=0.0)
        assert (status["armed"], status["origin_m"]) == (False, [0.0])
        rig.goes_on("arm")


def settled(subscriber: Subscriber) -> dict[str, Any]:
    """A position at which the device has come to rest."""
    still = 0
    for topic, fields in subscriber.maps():
        if topic == "hapticd/position":
            still = still + 1 if abs(fields["velocity_m_per_s"][0]) < 1e-3 else 0
            if still > 200:
                return fields
    raise AssertionError("nothing is published")


def behind(subscriber: Subscriber, seq: int) -> dict[str, Any]:
    """The first position after a tick."""
    for topic, fields in subscriber.maps():
        if topic == "hapticd/position" and fields["seq"] > seq:
            return fields
    raise AssertionError("nothing is published")
